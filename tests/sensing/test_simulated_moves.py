import numpy as np
import pytest

from pgm_places import LabelledMap, OccupancyGrid
from pgm_places.errors import InputError
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED
from pgm_places.sensing.simulated_moves import STAY_M, simulate_moves
from tests.refusals import refused


def two_rooms(door_cells: int) -> LabelledMap:
    """Rooms 0 and 2 side by side, with a door, label 1, in the wall between them."""
    cells = np.full((60, 61), FREE, np.int8)
    labels = np.zeros(cells.shape, np.int16)
    labels[:, 31:] = 2
    labels[:, 30] = -1
    cells[:, 30] = OCCUPIED
    door = slice(30 - door_cells // 2, 30 + (door_cells + 1) // 2)
    cells[door, 30] = FREE
    labels[door, 28:33] = 1
    return LabelledMap(OccupancyGrid(cells, 0.05), labels)


def test_runs_never_go_through_walls() -> None:
    counts = simulate_moves([two_rooms(0)], 3, n_runs=3000)
    assert counts[0, 2] == counts[2, 0] == 0
    assert counts[1].sum() == 0
    assert counts.sum() == 3000


def test_the_other_room_is_reached_through_the_door() -> None:
    counts = simulate_moves([two_rooms(20)], 3, n_runs=6000)
    assert counts[0, 1] > counts[0, 2]
    assert counts[2, 1] > counts[2, 0]
    # A door is narrow: a robot in it is rather somewhere else after a step.
    assert counts[1, 1] < counts[1, 0] + counts[1, 2]


def test_a_robot_that_stays_stays_at_its_place() -> None:
    counts = simulate_moves([two_rooms(20)], 3, n_runs=3000, step_m=STAY_M)
    assert np.trace(counts) > 0.98 * counts.sum()
    still = simulate_moves([two_rooms(20)], 3, n_runs=500, step_m=(0.0, 0.0))
    assert np.trace(still) == 500


@pytest.mark.parametrize("axis", [0, 1])
def test_runs_head_in_all_directions(axis: int) -> None:
    cells = np.full((40, 40), FREE, np.int8)
    labels = (np.indices(cells.shape)[axis] >= 20).astype(np.int16)
    counts = simulate_moves([LabelledMap(OccupancyGrid(cells, 0.05), labels)], 2, n_runs=4000)
    # Both halves are as large, so as many runs cross their border one way as the other.
    assert counts[0, 1] > 200
    assert counts[0, 1] == pytest.approx(counts[1, 0], rel=0.2)


def test_the_same_seed_gives_the_same_counts_and_another_does_not() -> None:
    maps = [two_rooms(20), two_rooms(4)]
    first = simulate_moves(maps, 3, n_runs=500, seed=4)
    np.testing.assert_array_equal(first, simulate_moves(maps, 3, n_runs=500, seed=4))
    assert (first != simulate_moves(maps, 3, n_runs=500, seed=5)).any()


def test_starts_lie_inside_the_window() -> None:
    item = two_rooms(20)
    window = np.zeros(item.grid.shape, np.bool_)
    window[:, :20] = True
    windowed = LabelledMap(item.grid, item.labels, window)
    counts = simulate_moves([windowed], 3, n_runs=500)
    assert counts[1:].sum() == 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"n_runs": 0}, "n_runs must be at least 1, got 0"),
        ({"step_m": (0.5, 0.2)}, r"a range of metres from 0 up, got \(0\.5, 0\.2\)"),
        ({"step_m": (-1.0, 0.2)}, r"a range of metres from 0 up, got \(-1\.0, 0\.2\)"),
        ({"step_m": (4.5, 5.0), "n_runs": 9}, r"runs of 4\.5 to 5 m found no path"),
    ],
)
def test_runs_that_cannot_be_driven_are_refused(options: dict[str, object], message: str) -> None:
    refused(InputError, message, simulate_moves, [two_rooms(20)], 3, **options)


def test_labels_are_needed() -> None:
    item = two_rooms(20)
    refused(InputError, "only 2 labels", simulate_moves, [item], 2)
    blank = LabelledMap(item.grid, np.full(item.grid.shape, -1, np.int16))
    refused(InputError, "labelled free cell", simulate_moves, [blank], 3)


def test_rows_of_rare_labels_are_exact_by_default() -> None:
    """Two seeds agree in every row, also in that of the door, of which 1,000 runs see few."""
    item = two_rooms(20)
    rows = [simulate_moves([item], 3, seed=seed).astype(float) for seed in (0, 1)]
    shares = [counts / counts.sum(axis=1, keepdims=True) for counts in rows]
    assert rows[0].sum() == 100_000
    assert np.abs(shares[0] - shares[1]).max() < 0.02
