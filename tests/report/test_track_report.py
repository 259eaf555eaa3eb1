import csv
import io
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np

from pgm_places.inference.labeling import Labeling, Status
from pgm_places.labelers.tracking import Track
from pgm_places.report.track_page import (
    belief_plot,
    belief_table,
    path_raster,
    track_page,
    write_track,
)
from pgm_places.trajectories.trajectory import Trajectory
from tests.drives import building, drive


def tracked(n_steps: int = 80) -> Track:
    path = drive(1)[:n_steps]
    names = building()[1]
    assert path.labels is not None
    beliefs = np.full((n_steps, 3), 0.1)
    beliefs[np.arange(n_steps), path.labels] = 0.8
    labeling = Labeling(path.labels, Status.CONVERGED, beliefs=beliefs)
    return Track(path, labeling, names, ("one warning <b>",))


def test_the_path_is_drawn_where_the_robot_was() -> None:
    track, grid = tracked(), building()[0].grid
    raster = path_raster(track, grid)
    rows, columns = grid.cells_at_m(track.trajectory.poses[:, :2]).T
    drawn = raster[rows, columns]
    assert (drawn >= 0).all()
    assert (drawn == track.labeling.labels).mean() > 0.9
    assert (raster[~grid.free] == -1).all()
    assert (raster >= 0).sum() < 0.2 * grid.free.sum()


def test_the_table_has_a_row_per_step_and_beliefs_that_sum_to_one() -> None:
    track = tracked()
    rows = list(csv.DictReader(io.StringIO(belief_table(track))))
    assert len(rows) == len(track.trajectory)
    sums = [sum(float(row[f"p_{name}"]) for name in track.label_names) for row in rows]
    np.testing.assert_allclose(sums, 1.0, atol=1e-5)
    assert [row["label"] for row in rows] == [row["true_label"] for row in rows]


def test_labels_without_beliefs_have_a_table_and_a_plot_too() -> None:
    track = tracked()
    bare = replace(track, labeling=Labeling(track.labeling.labels, Status.EXACT))
    assert "p_" not in belief_table(bare)
    assert belief_plot(bare).startswith(b"\x89PNG")


def test_the_report_loads_nothing_and_escapes_what_it_is_told(tmp_path: Path) -> None:
    track, grid = tracked(), building()[0].grid
    page = track_page(track, grid)
    assert "one warning &lt;b&gt;" in page
    assert "http" not in page.replace("http-equiv", "")
    assert "100.0 %" in page and "All" in page
    HTMLParser().feed(page)
    written = write_track(track, grid, tmp_path)
    assert [path.name for path in written] == [
        "beliefs.csv",
        "path.png",
        "beliefs.png",
        "report.html",
    ]
    assert track_page(track, grid) == page


def test_a_single_step_can_be_reported() -> None:
    path = Trajectory(np.zeros(1), np.array([[1.0, 1.0, 0.0]]))
    track = Track(path, Labeling(np.array([0]), Status.EXACT), ("corridor",))
    page = track_page(track, building()[0].grid)
    assert "corridor" in page
    assert "<b>1</b>visit<" in page and "<b>1</b>label<" in page


def test_visits_start_when_the_log_does() -> None:
    path = Trajectory(
        np.array([100.0, 100.5, 102.0]),
        np.array([[1.0, 1.0, 0.0], [1.5, 1.0, 0.0], [2.0, 1.0, 0.0]]),
    )
    labeling = Labeling(np.array([0, 1, 1]), Status.EXACT)
    page = track_page(Track(path, labeling, ("corridor", "room")), building()[0].grid)
    visits = page.split("All 2 visits")[1]
    rows = [re.findall(r"<td[^>]*>([^<]*)</td>", row) for row in visits.split("<tr>")[2:]]
    assert rows == [["0.0", "1", "0.5"], ["0.5", "2", "0.5"]]
