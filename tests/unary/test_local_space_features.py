"""The spaces around a robot: squares of the map divided on its way, as features of its scans."""

from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import pgm_places
from pgm_places import LabelledMap, OccupancyGrid, ScanGeometry, Trajectory, TrajectoryLabeler
from pgm_places.errors import ConfigError, InputError
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN
from pgm_places.sensing.local_map import LocalMap
from pgm_places.simulation import generate_building
from pgm_places.simulation.simulated_robot import SimulatedRobot
from pgm_places.spaces.cell_features import CellFeatures
from pgm_places.spaces.segmentation import Segmentation
from pgm_places.unary.local_features import N_LOCAL_SPACE_FEATURES, LocalSpaceFeatures
from pgm_places.unary.scan_model import BeamOptions

REACH_M = 4.0


@lru_cache
def drive(seed: int) -> tuple[LabelledMap, Trajectory]:
    building = generate_building(seed, size="small", resolution_m=0.05)
    known = LabelledMap(building.grid, building.labels)
    robot = SimulatedRobot(ScanGeometry.half_circle(60, range_max_m=8.0), speed_m_s=0.8)
    path = robot.explore(known.grid, max_length_m=15.0, seed=seed)
    return known, path.labelled_by(known, building.label_names)


@lru_cache
def fitted() -> TrajectoryLabeler:
    beams = BeamOptions(spaces_m=REACH_M, local_size_m=12.0)
    labeler = TrajectoryLabeler(("corridor", "room", "doorway"), beams=beams, n_folds=2)
    return labeler.fit([], [drive(1)[1], drive(3)[1]])


def plainly(grid: OccupancyGrid, position: NDArray[np.float64]) -> NDArray[np.float32]:
    """The row of a position on a map of 5 cm: four cells in one, occupied if any of them is."""
    row, column = grid.cells_at_m(position)[0]
    n = round(REACH_M / 0.05)
    rows, columns = max(row - n, 0), max(column - n, 0)
    part = grid.cells[rows : row + n, columns : column + n]
    coarse = np.full((-(-part.shape[0] // 2), -(-part.shape[1] // 2)), UNKNOWN, np.int8)
    for r, c in np.ndindex(*coarse.shape):
        block = part[2 * r : 2 * r + 2, 2 * c : 2 * c + 2]
        if (block == OCCUPIED).any():
            coarse[r, c] = OCCUPIED
        elif (block == FREE).any():
            coarse[r, c] = FREE
    features = CellFeatures.of(Segmentation.of(OccupancyGrid(coarse, 0.1)))
    return features.lookup([[(row - rows) // 2, (column - columns) // 2]])[0]


def test_a_row_is_that_of_the_square_around_the_robot() -> None:
    known, path = drive(1)
    assert path.labels is not None
    for step in range(0, len(path), 40):
        position = path.poses[step, :2]
        found = LocalSpaceFeatures(known.grid, REACH_M).at(position)
        np.testing.assert_allclose(found, plainly(known.grid, position), rtol=1e-4, atol=1e-4)


def test_the_map_is_divided_anew_after_a_quarter_of_a_metre() -> None:
    local = LocalMap(12.0)
    angles = np.arange(360) * np.pi / 180
    local.update([0.0, 0.0, 0.0], np.full(360, 2.0), angles, max_range_m=9.0)
    around = LocalSpaceFeatures(local, REACH_M)
    first = around.at([0.0, 0.0])
    local.update([0.0, 0.0, 0.0], np.full(360, 1.0), angles, max_range_m=9.0)
    np.testing.assert_array_equal(around.at([0.0, 0.0]), first)
    later = around.at([0.3, 0.0])
    np.testing.assert_array_equal(later, LocalSpaceFeatures(local, REACH_M).at([0.3, 0.0]))
    assert (later != first).any()


def test_off_the_map_there_is_nothing() -> None:
    known, _ = drive(1)
    for far in ([-500.0, 0.0], [500.0, 500.0]):
        found = LocalSpaceFeatures(known.grid, REACH_M).at(far)
        np.testing.assert_array_equal(found, np.zeros(N_LOCAL_SPACE_FEATURES, np.float32))


def test_step_by_step_it_sees_what_it_sees_of_a_whole_drive() -> None:
    labeler, (_, path) = fitted(), drive(2)
    assert labeler.scan_model_.sees_spaces and path.geometry is not None
    beliefs = labeler.label(path).beliefs
    assert beliefs is not None
    online = labeler.online(path.geometry)
    for step in range(len(path)):
        np.testing.assert_array_equal(online.step(path.scan(step)), beliefs[step])


def test_it_looks_at_spaces() -> None:
    assert (fitted().scan_model_.needed >= 321).any()


def test_a_stored_model_still_looks_at_spaces(tmp_path: Path) -> None:
    labeler, (known, path) = fitted(), drive(2)
    pgm_places.save(labeler, tmp_path / "model")
    loaded = pgm_places.load(tmp_path / "model")
    assert loaded.beams == labeler.beams
    np.testing.assert_array_equal(loaded.label(path).beliefs, labeler.label(path).beliefs)
    in_map = loaded.with_options(beams__missing="known-map")
    bare = Trajectory(path.times_s, path.poses)
    assert in_map.label(bare, known_map=known.grid).beliefs.shape == (len(path), 3)


@pytest.mark.parametrize("missing", ["mirror", "max-range"])
def test_spaces_want_a_map(missing: str) -> None:
    with pytest.raises(ConfigError, match=r"builds no map, but spaces_m needs .* 'local-map'"):
        BeamOptions(missing, spaces_m=REACH_M)  # type: ignore[arg-type]


def test_what_a_model_looks_at_is_settled_in_training() -> None:
    labeler, (known, path) = fitted(), drive(2)
    with pytest.raises(InputError, match=r"looks at the spaces .* keep spaces_m of the beams"):
        labeler.with_options(beams__spaces_m=0.0).label(path)
    with pytest.raises(InputError, match=r"spaces_m: .* do not exist for cells of maps"):
        TrajectoryLabeler(labeler.label_names_, beams=labeler.beams).fit([known])
