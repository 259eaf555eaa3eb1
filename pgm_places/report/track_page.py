"""A tracked trajectory as one self-contained HTML file."""

from collections.abc import Iterator
from pathlib import Path

from pgm_places.evaluation.evaluation import evaluate
from pgm_places.io.atomic import write_bytes, write_text
from pgm_places.io.csv_table import csv_text
from pgm_places.labelers.tracking import Track
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.palette import label_swatches
from pgm_places.report.page import data_uri, render
from pgm_places.report.track_pictures import belief_plot, path_picture

__all__ = ["belief_table", "track_page", "write_track"]


MOST_VISITS = 300
"""Visits listed; a longer list is of no use, and ``beliefs.csv`` has every step."""


def track_page(track: Track, grid: OccupancyGrid) -> str:
    """The report as text: pictures and style are in it, and it loads nothing else."""
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
    yield f"{len(visits)}", "visits"
    yield f"{len({visit.label for visit in visits})}", "kinds of places"


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
