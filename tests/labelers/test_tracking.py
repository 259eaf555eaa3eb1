import numpy as np
import pytest

from pgm_places.errors import InputError
from pgm_places.inference.labeling import Labeling, Status
from pgm_places.labelers.tracking import Track, map_of_scans
from pgm_places.maps.occupancy_grid import OCCUPIED
from pgm_places.trajectories.trajectory import Trajectory
from tests.drives import building, drive

NAMES = ("corridor", "room")


def short_track(true_labels: list[int] | None = None) -> Track:
    x = np.array([0.0, 1.0, 2.0, 4.0, 4.5])
    poses = np.column_stack([x, np.zeros(5), np.zeros(5)])
    path = Trajectory(np.arange(5.0), poses)
    if true_labels is not None:
        path = path.with_labels(true_labels, NAMES)
    labeling = Labeling(np.array([0, 0, 1, 1, 0]), Status.CONVERGED)
    return Track(path, labeling, NAMES)


def test_visits_are_stretches_of_one_label() -> None:
    visits = list(short_track().visits())
    assert [(v.label, v.first, v.last, v.length_m) for v in visits] == [
        (0, 0, 1, 2.0),
        (1, 2, 3, 2.5),
        (0, 4, 4, 0.0),
    ]
    assert sum(visit.n_steps for visit in visits) == 5


def test_totals_add_up_to_the_whole_way() -> None:
    track = short_track()
    totals = track.totals()
    assert totals == [("corridor", 2, 3, 2.0), ("room", 1, 2, 2.5)]
    assert sum(way for *_, way in totals) == pytest.approx(track.trajectory.path_length_m)


def test_accuracy_counts_steps_whose_place_is_known() -> None:
    assert short_track([0, 1, 1, -1, -1]).accuracy == pytest.approx(2 / 3)
    assert short_track([-1] * 5).accuracy is None
    assert short_track().accuracy is None


def test_labels_must_be_those_of_the_steps() -> None:
    track = short_track()
    with pytest.raises(InputError, match="5 steps"):
        Track(track.trajectory, Labeling(np.zeros(3, np.int64), Status.EXACT), NAMES)


def test_a_map_of_scans_has_the_walls_that_the_laser_met() -> None:
    path, (known, _) = drive(1), building()
    drawn = map_of_scans(path)
    centres = drawn.cell_centres_m(np.argwhere(drawn.occupied))
    rows, columns = known.grid.cells_at_m(centres).T
    inside = (rows >= 0) & (columns >= 0)
    inside &= (rows < known.grid.shape[0]) & (columns < known.grid.shape[1])
    assert inside.mean() > 0.99
    assert (known.grid.cells[rows[inside], columns[inside]] == OCCUPIED).mean() > 0.85


def test_a_way_without_scans_or_steps_still_has_a_map_around_it() -> None:
    bare = Trajectory(np.arange(2.0), np.array([[0.0, 0, 0], [400.0, 0, 0]]))
    grid = map_of_scans(bare)
    assert grid.unknown.all() and max(grid.shape) <= 3000
    low, high = grid.cells_at_m([[0.0, 0.0], [400.0, 0.0]])
    assert (low >= 0).all() and (high < grid.shape).all()
    assert map_of_scans(Trajectory(np.zeros(0), np.zeros((0, 3)))).unknown.all()
