"""Charts over steps, nodes and iterations: beliefs, bounds, learning curves."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pgm_places import palette
from pgm_places.plotting.axes import legend_beside

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_beliefs(
    ax: "Axes",
    along: NDArray[np.floating[Any]],
    beliefs: NDArray[np.floating[Any]],
    names: Sequence[str],
    xlabel: str,
) -> None:
    """Stack the beliefs (N, K) over ascending positions ``along`` (N,), in the labels' colours."""
    colours = palette.label_colours(names)
    ax.stackplot(along, beliefs.T, colors=colours, labels=names, linewidth=0)
    ax.set(xlabel=xlabel, ylabel="belief", ylim=(0, 1))
    ax.margins(x=0)
    legend_beside(ax, ax.get_legend_handles_labels()[0])


def draw_curves(
    ax: "Axes", curves: Mapping[str, NDArray[np.floating[Any]]], xlabel: str, ylabel: str
) -> None:
    """Draw a line for each curve over 1, 2, ...; values that are not finite are left out."""
    for number, (name, values) in enumerate(curves.items()):
        colour = palette.LABEL_COLOURS[(1, 2, 0)[number % 3]]
        finite = np.where(np.isfinite(values), values, np.nan)
        ax.plot(np.arange(1, len(values) + 1), finite, color=colour, label=name)
    ax.set(xlabel=xlabel, ylabel=ylabel)
    ax.legend(frameon=False)


def draw_path(
    ax: "Axes",
    xy_m: NDArray[np.float64],
    labels: NDArray[np.integer[Any]] | None,
    names: Sequence[str],
) -> None:
    """Draw a path (T, 2), with a dot in the colour of its label at each step that has one."""
    ax.plot(*xy_m.T, color="#8a8a8a", linewidth=1, zorder=2)
    ax.set(xlabel="x (m)", ylabel="y (m)")
    ax.set_aspect("equal")
    if labels is None:
        return
    dots = []
    for number, (name, colour) in enumerate(zip(names, palette.label_colours(names), strict=True)):
        mine = xy_m[labels == number]
        if len(mine):
            x, y = mine.T
            dots.append(ax.scatter(x, y, s=12, color=colour, label=name, zorder=3))
    legend_beside(ax, dots)


def draw_graph(
    ax: "Axes",
    nodes_m: NDArray[np.float64],
    edges: Sequence[NDArray[np.float64]],
    names: Sequence[str],
) -> None:
    """Draw edges as lines through points (n, 2), nodes (N, 2) as dots, and their names."""
    for line in edges:
        ax.plot(*line.T, color=palette.WALL, linewidth=1, zorder=3)
    ax.scatter(nodes_m[:, 0], nodes_m[:, 1], s=24, color="white", edgecolors=palette.WALL, zorder=4)
    for (x, y), name in zip(nodes_m, names, strict=True):
        ax.annotate(
            name,
            (x, y),
            xytext=(0, 6),
            textcoords="offset points",
            ha="center",
            fontsize="x-small",
            parse_math=False,
            clip_on=True,
            zorder=5,
            bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "alpha": 0.7, "linewidth": 0},
        )


def draw_bars(
    ax: "Axes",
    names: Sequence[str],
    bars: Mapping[str, Sequence[float]],
    errors: Mapping[str, NDArray[np.floating[Any]]],
    xlabel: str,
) -> None:
    """Draw bars for each name, a group of figures; errors (2, N) are distances to both ends."""
    height = 0.8 / len(bars)
    at = np.arange(len(names), dtype=float)
    for number, (figure, values) in enumerate(bars.items()):
        ax.barh(
            at + (number - (len(bars) - 1) / 2) * height,
            values,
            0.9 * height,
            xerr=errors.get(figure),
            color=palette.LABEL_COLOURS[(1, 0, 2)[number % 3]],
            ecolor=palette.WALL,
            label=figure,
        )
    ax.set_yticks(at, names)
    ax.invert_yaxis()
    ax.set(xlabel=xlabel, xlim=(0, 100))
    legend_beside(ax, ax.get_legend_handles_labels()[0])
