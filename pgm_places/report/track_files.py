"""A tracked trajectory as files: beliefs, pictures and the report."""

import csv
import io
from pathlib import Path

from pgm_places.io.atomic import write_bytes, write_text
from pgm_places.labelers.tracking import Track
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.report.track_page import write_track_page
from pgm_places.report.track_pictures import belief_plot, path_picture

__all__ = ["belief_table", "write_track"]


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
