"""Pictures of a tracked trajectory: its path in the colours of places, its beliefs over time."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.labelers.tracking import Track
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.palette import label_colours
from pgm_places.report.drawing import text_width
from pgm_places.report.figure import INK, MUTED, PixelFigure
from pgm_places.report.map_pictures import label_map
from pgm_places.trajectories.path_layout import PathLayout

PLOT_COLUMNS = 1400
"""Most columns of the belief plot; longer logs show means."""


def path_raster(track: Track, grid: OccupancyGrid) -> NDArray[np.int16]:
    """(H, W) label of the path where it runs over the grid's free cells, -1 elsewhere."""
    layout = PathLayout(grid, track.trajectory.poses[:, :2])
    return layout.to_raster(track.labeling.labels.astype(np.int16), fill=-1)


def path_picture(track: Track, grid: OccupancyGrid, *, title: str | None = None) -> bytes:
    """A PNG file of the map with the path in the colours of the places it was labelled as."""
    return label_map(grid, path_raster(track, grid), track.label_names, title=title)


def belief_plot(track: Track, *, title: str | None = None) -> bytes:
    """A PNG file: beliefs along the path as stacked areas; below, labels and ground truth if known.

    A labelling without beliefs shows its labels only.
    """
    names = track.label_names
    colours = label_colours(names)
    rows = [("label", track.labeling.labels)]
    if track.truth is not None:
        rows.append(("true", track.truth))
    left, width, plot_height, strip = 90, 1100, 240, 26
    top = 110 if title else 64
    has_beliefs = track.labeling.beliefs is not None
    below = top + (plot_height + 14 if has_beliefs else 0)
    page = PixelFigure(left + width + 30, below + len(rows) * (strip + 8) + 62)
    if title:
        page.text(24, 32, title, size=20, weight="bold")
    _legend(page, names, colours, 76 if title else 30)
    way = np.concatenate([[0.0], np.cumsum(track.trajectory.step_lengths_m)])[: len(rows[0][1])]
    edges = np.linspace(0.0, max(float(way[-1]) if len(way) else 0.0, 1e-9), PLOT_COLUMNS + 1)
    column = np.clip(np.searchsorted(edges, way, side="right") - 1, 0, PLOT_COLUMNS - 1)
    if track.labeling.beliefs is not None:
        axes = page.axes(left, top, width, plot_height)
        means = _filled(column, track.labeling.beliefs)
        axes.stackplot(0.5 * (edges[1:] + edges[:-1]), means.T, colors=colours, linewidth=0)
        axes.set_xlim(edges[0], edges[-1])
        axes.set_ylim(0, 1)
        axes.set_xticks([])
        axes.set_yticks([0, 0.5, 1])
        axes.tick_params(labelsize=9, colors=MUTED)
        axes.spines[:].set_visible(False)
        page.text(24, top + plot_height / 4, "belief", size=13, color=MUTED)
    for index, (name, labels) in enumerate(rows):
        y = below + index * (strip + 8)
        axes = page.axes(left, y, width, strip)
        _strip(axes, way, np.asarray(labels), colours, float(edges[-1]))
        page.text(24, y + strip / 2, name, size=13, color=MUTED)
        last = index == len(rows) - 1
        if last:
            axes.tick_params(labelsize=9, colors=MUTED)
            axes.set_xlabel("distance along the path (m)", fontsize=10, color=MUTED)
        else:
            axes.set_xticks([])
    return page.png()


def _filled(column: NDArray[np.int64], beliefs: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
    """(PLOT_COLUMNS, K) mean beliefs per column; a column without a step shows the one before."""
    sums = np.zeros((PLOT_COLUMNS, beliefs.shape[1]))
    counts = np.bincount(column, minlength=PLOT_COLUMNS)
    np.add.at(sums, column, beliefs)
    seen = np.maximum.accumulate(np.where(counts > 0, np.arange(PLOT_COLUMNS), 0))
    means: NDArray[np.float64] = (sums / np.maximum(counts, 1)[:, None])[seen]
    return means


def _strip(
    axes: Any,
    way: NDArray[np.float64],
    labels: NDArray[np.int64],
    colours: tuple[str, ...],
    end: float,
) -> None:
    """Bars in the colour of each stretch of one label; nothing where it is unknown."""
    changes = np.flatnonzero(np.diff(labels)) + 1
    starts = [0, *changes.tolist()] if len(labels) else []
    ends = [*changes.tolist(), len(labels) - 1] if len(labels) else []
    for first, last in zip(starts, ends, strict=True):
        if labels[first] >= 0:
            axes.axvspan(way[first], way[last], color=colours[labels[first]], linewidth=0)
    axes.set_xlim(0, end)
    axes.set_yticks([])
    axes.spines[:].set_visible(False)


def _legend(page: PixelFigure, names: tuple[str, ...], colours: tuple[str, ...], y: float) -> None:
    x = 24.0
    for name, colour in zip(names, colours, strict=True):
        page.box(x, y - 8, 16, 16, facecolor=colour, edgecolor="none")
        page.text(x + 22, y, name, size=14, color=INK)
        x += 22 + text_width(name, 14) + 24
