"""Maps, drives and results drawn on axes of matplotlib, for notebooks."""

import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places import palette

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_DPI = 100


class Plotted:
    """A record with ``plot(ax)``, which notebooks display as a picture."""

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw on the axes."""
        raise NotImplementedError

    def _repr_png_(self) -> bytes:
        """The plot as a PNG file; pyplot's current figure is not changed."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(6.4, 4.8), dpi=_DPI, layout="constrained", facecolor="white")
        FigureCanvasAgg(figure)
        self.plot(figure.add_subplot())
        file = io.BytesIO()
        figure.savefig(file, format="png", metadata={"Software": None})
        return file.getvalue()


def axes_or_new(ax: "Axes | None") -> "Axes":
    """The axes, or those of a new figure of pyplot."""
    if ax is not None:
        return ax
    from matplotlib import pyplot

    return pyplot.subplots(layout="constrained")[1]


def legend_beside(ax: "Axes", handles: list[Any]) -> None:
    """A legend to the right of the axes."""
    ax.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.01, 1), frameon=False)


def data_frame(columns: dict[str, Any], index: str) -> Any:
    """A table of pandas, which is optional; InputError if it is not installed."""
    from pgm_places.plugins import needed

    pandas = needed("pandas", extra="notebook", purpose="a table of pandas")
    return pandas.DataFrame(columns).set_index(index)


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
    ax.locator_params(axis="x", integer=True)
    if len(curves) > 1:
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


_MOST_PIXELS = 2000


class Frame(NamedTuple):
    """Where a raster lies: the side of its cells, its lower left corner, and its rotation."""

    resolution_m: float
    origin_xy_m: tuple[float, float]
    yaw_rad: float


def draw_ground(ax: "Axes", cells: NDArray[np.int8], frame: Frame) -> None:
    """Draw walls (100) dark, unknown cells (-1) grey and free ones (0) white, equal in x and y."""
    step = _step(cells.shape)
    colours = np.empty((3, 3), np.uint8)
    colours[:] = [palette.rgb_of(c) for c in (palette.UNKNOWN, "#ffffff", palette.WALL)]
    _draw(ax, colours[np.sign(cells[::step, ::step]) + 1], frame, step)
    known = cells >= 0
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if len(rows):  # the view covers the known cells
        sides = [(columns[0], rows[0]), (columns[-1] + 1, rows[-1] + 1)]
        low, high = (np.array(side) * frame.resolution_m for side in sides)
        corners = [low, (low[0], high[1]), (high[0], low[1]), high]
        ax.update_datalim(_turned(frame).transform(corners))
        ax.autoscale_view()
    ax.set(xlabel="x (m)", ylabel="y (m)")
    ax.set_aspect("equal")


def draw_labels(
    ax: "Axes", labels: NDArray[np.integer[Any]], names: Sequence[str], frame: Frame
) -> None:
    """Draw the labelled cells (H, W) in the colours of their labels, with a legend."""
    step = _step(labels.shape)
    shown = labels[::step, ::step]
    colours = np.zeros((len(names) + 1, 4), np.uint8)  # the last one, for -1, is transparent
    for number, colour in enumerate(palette.label_colours(names)):
        colours[number] = [*palette.rgb_of(colour), 255]
    _draw(ax, colours[shown], frame, step)
    present = np.unique(shown[shown >= 0])
    swatches = palette.label_swatches(names)
    legend_beside(ax, [_patch(swatches[number]) for number in present])


def draw_values(
    ax: "Axes", values: NDArray[np.floating[Any]], frame: Frame, *, gradient: str, title: str
) -> None:
    """Draw values from 0 to 1 of cells (H, W), nothing where they are NaN, with a colour bar."""
    from matplotlib.colors import ListedColormap

    step = _step(values.shape)
    colours = ListedColormap(palette.levels(gradient, 256))
    image = _draw(ax, values[::step, ::step], frame, step, cmap=colours, vmin=0, vmax=1)
    ax.figure.colorbar(image, ax=ax, label=title)


def _patch(swatch: palette.Swatch) -> object:
    from matplotlib.patches import Patch

    return Patch(facecolor=swatch.colour, label=swatch.name)


def _step(shape: tuple[int, ...]) -> int:
    """The step at which cells are drawn: a figure has fewer pixels than a huge map."""
    return max(1, max(shape) // _MOST_PIXELS)


def _turned(frame: Frame) -> Any:
    from matplotlib.transforms import Affine2D

    return Affine2D().rotate(frame.yaw_rad).translate(*frame.origin_xy_m)


def _draw(ax: "Axes", image: NDArray[Any], frame: Frame, step: int, **options: Any) -> Any:
    """Draw an image of every ``step``-th cell; the limits of the axes stay."""
    side = step * frame.resolution_m
    limits = ax.dataLim.frozen()
    drawn = ax.imshow(
        image,
        origin="lower",
        extent=(0, image.shape[1] * side, 0, image.shape[0] * side),
        interpolation="none",
        transform=_turned(frame) + ax.transData,
        **options,
    )
    ax.dataLim.set(limits)
    ax.autoscale_view()
    return drawn
