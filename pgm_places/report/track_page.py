"""Page of a tracked trajectory: one self-contained HTML file."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.evaluation.evaluation import evaluate
from pgm_places.io.atomic import write_bytes, write_text
from pgm_places.io.csv_table import csv_text
from pgm_places.labelers.tracking import Track
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.palette import label_colours, label_swatches
from pgm_places.pictures.drawing import INK, MUTED, text_width
from pgm_places.pictures.map_pictures import path_cells
from pgm_places.pictures.page import data_uri, render
from pgm_places.report.line_chart import PixelFigure
from pgm_places.trajectories.path import PathLayout

PLOT_COLUMNS = 1400
"""Most columns of the belief plot; each column of a longer log is a mean."""


def path_raster(track: Track, grid: OccupancyGrid) -> NDArray[np.int16]:
    """(H, W) label of the path where it runs over the grid's free cells, -1 elsewhere."""
    layout = PathLayout(grid, track.trajectory.poses[:, :2])
    return layout.to_raster(track.labeling.labels.astype(np.int16), fill=-1)


def path_picture(track: Track, grid: OccupancyGrid, *, title: str | None = None) -> bytes:
    """A PNG file of the map with the path in the colours of its labels."""
    return path_cells(grid, path_raster(track, grid), track.label_names, title=title)


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
    """(PLOT_COLUMNS, K) mean beliefs per column; a column without a step repeats the last one."""
    sums = np.zeros((PLOT_COLUMNS, beliefs.shape[1]))
    counts = np.bincount(column, minlength=PLOT_COLUMNS)
    np.add.at(sums, column, beliefs)
    newest = np.maximum.accumulate(np.where(counts > 0, np.arange(PLOT_COLUMNS), 0))
    means: NDArray[np.float64] = (sums / np.maximum(counts, 1)[:, None])[newest]
    return means


def _strip(
    axes: Any,
    way: NDArray[np.float64],
    labels: NDArray[np.int64],
    colours: tuple[str, ...],
    end: float,
) -> None:
    """Bars in the colours of stretches of one label; no bar where it is unknown."""
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


__all__ = ["belief_table", "track_page", "write_track"]


MOST_VISITS = 300
"""Most visits listed; ``beliefs.csv`` has every step."""


def track_page(track: Track, grid: OccupancyGrid) -> str:
    """The report as text, with pictures and style embedded."""
    labels = label_swatches(track.label_names)
    scores = None
    if track.truth is not None and track.accuracy is not None:
        scores = evaluate(track.truth, track.labeling.labels, track.label_names)
    return render(
        "track.html",
        title=f"{track.trajectory.name}: places along the path",
        trajectory=track.trajectory,
        labels=labels,
        warnings=track.warnings,
        cards=list(_cards(track)),
        path_picture=data_uri(path_picture(track, grid)),
        belief_plot=data_uri(belief_plot(track)),
        totals=track.totals(),
        found=scores,
        visits=list(track.visits()),
        most_visits=MOST_VISITS,
    )


def _cards(track: Track) -> Iterator[tuple[str, str]]:
    if track.accuracy is not None:
        yield f"{100 * track.accuracy:.1f} %", "of the labels are correct"
    visits = list(track.visits())
    yield f"{track.trajectory.path_length_m:.0f} m", "path length"
    n_labels = len({visit.label for visit in visits})
    yield f"{len(visits)}", "visit" if len(visits) == 1 else "visits"
    yield f"{n_labels}", "label" if n_labels == 1 else "labels"


def belief_table(track: Track) -> str:
    """Comma-separated values: a row per step with pose, label, and the belief in each label."""
    beliefs, names, truth = track.labeling.beliefs, track.label_names, track.truth
    columns = ["step", "t_s", "x_m", "y_m", "heading_rad", "label"]
    if truth is not None:
        columns.append("true_label")
    rows = [[*columns, *(f"p_{name}" for name in names if beliefs is not None)]]
    path = track.trajectory
    for t, label in enumerate(track.labeling.labels.tolist()):
        x, y, heading = path.poses[t]
        row = [f"{t}", f"{path.times_s[t]:.6f}", f"{x:.4f}", f"{y:.4f}", f"{heading:.5f}"]
        row.append(names[label])
        if truth is not None:
            row.append(names[truth[t]] if truth[t] >= 0 else "")
        if beliefs is not None:
            row += [f"{belief:.6f}" for belief in beliefs[t]]
        rows.append(row)
    return csv_text(rows)


def write_track(track: Track, grid: OccupancyGrid, folder: Path) -> list[Path]:
    """Write ``beliefs.csv``, ``path.png``, ``beliefs.png`` and ``report.html``; their paths."""
    name = track.trajectory.name
    return [
        write_text(folder / "beliefs.csv", belief_table(track)),
        write_bytes(folder / "path.png", path_picture(track, grid, title=name)),
        write_bytes(folder / "beliefs.png", belief_plot(track, title=name)),
        write_text(folder / "report.html", track_page(track, grid)),
    ]
