"""A tracked trajectory as one self-contained HTML file."""

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from pgm_places.evaluation.evaluation import evaluate
from pgm_places.io.atomic import write_bytes, write_text
from pgm_places.labelers.tracking import Track
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.palette import Swatch, label_swatches
from pgm_places.report.page import data_uri, render
from pgm_places.report.track_pictures import belief_plot, path_picture

__all__ = ["belief_table", "track_page", "write_track", "write_track_page"]


MOST_VISITS = 300
"""Visits listed; a longer list is of no use, and ``beliefs.csv`` has every step."""


@dataclass(frozen=True)
class _Visit:
    """A row of the list of visits."""

    label: Swatch
    start_s: float
    n_steps: int
    distance_m: float


@dataclass(frozen=True)
class _Total:
    """All visits to places of one label."""

    label: Swatch
    n_visits: int
    n_steps: int
    share: float
    distance_m: float


def write_track_page(track: Track, grid: OccupancyGrid, path: Path) -> Path:
    """The path, once the file holds the whole report."""
    return write_text(path, track_page(track, grid))


def track_page(track: Track, grid: OccupancyGrid) -> str:
    """The report as text: pictures and style are in it, and it loads nothing else."""
    labels = label_swatches(track.label_names)
    visits = _visits(track, labels)
    scores = None
    if track.truth is not None and track.accuracy is not None:
        scores = evaluate(track.truth, track.labeling.labels, track.label_names)
    return render(
        "track.html",
        title=f"{track.trajectory.name}: places along the path",
        n_steps=len(track.trajectory),
        length_m=track.trajectory.path_length_m,
        labels=labels,
        warnings=track.warnings,
        cards=list(_cards(track, visits)),
        path_picture=data_uri(path_picture(track, grid)),
        belief_plot=data_uri(belief_plot(track)),
        totals=_totals(track, labels),
        found=scores,
        visits=visits[:MOST_VISITS],
        n_visits=len(visits),
    )


def _cards(track: Track, visits: Sequence[_Visit]) -> Iterator[tuple[str, str]]:
    if track.accuracy is not None:
        yield f"{100 * track.accuracy:.1f} %", "of the labels are correct"
    yield f"{track.trajectory.path_length_m:.0f} m", "path length"
    yield f"{len(visits)}", "visits"
    yield f"{len({visit.label for visit in visits})}", "kinds of places"


def _visits(track: Track, labels: Sequence[Swatch]) -> list[_Visit]:
    times_s = track.trajectory.times_s
    return [
        _Visit(
            labels[visit.label],
            float(times_s[visit.first] - times_s[0]),
            visit.n_steps,
            visit.length_m,
        )
        for visit in track.visits()
    ]


def _totals(track: Track, labels: Sequence[Swatch]) -> list[_Total]:
    n_all = max(len(track.trajectory), 1)
    return [
        _Total(label, n_visits, n_steps, n_steps / n_all, distance_m)
        for label, (_, n_visits, n_steps, distance_m) in zip(labels, track.totals(), strict=True)
    ]


def belief_table(track: Track) -> str:
    """Comma-separated values: a row per step with pose, label, and the belief in each label."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    beliefs = track.labeling.beliefs
    names = track.label_names
    columns = ["step", "t_s", "x_m", "y_m", "heading_rad", "label"]
    truth = track.truth
    if truth is not None:
        columns.append("true_label")
    table.writerow([*columns, *(f"p_{name}" for name in names if beliefs is not None)])
    path = track.trajectory
    for t, label in enumerate(track.labeling.labels.tolist()):
        x, y, heading = path.poses[t]
        row = [f"{t}", f"{path.times_s[t]:.6f}", f"{x:.4f}", f"{y:.4f}", f"{heading:.5f}"]
        row.append(names[label])
        if truth is not None:
            row.append(names[truth[t]] if truth[t] >= 0 else "")
        if beliefs is not None:
            row += [f"{belief:.6f}" for belief in beliefs[t]]
        table.writerow(row)
    return text.getvalue()


def write_track(track: Track, grid: OccupancyGrid, folder: Path) -> list[Path]:
    """Write ``beliefs.csv``, ``path.png``, ``beliefs.png`` and ``report.html``; their paths."""
    name = track.trajectory.name
    return [
        write_text(folder / "beliefs.csv", belief_table(track)),
        write_bytes(folder / "path.png", path_picture(track, grid, title=name)),
        write_bytes(folder / "beliefs.png", belief_plot(track, title=name)),
        write_track_page(track, grid, folder / "report.html"),
    ]
