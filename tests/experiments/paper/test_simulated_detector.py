"""Simulated detection: what is seen, how often it is missed, and that chances are fixed."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.paper.placement import place_objects
from experiments.paper.simulated_detector import PlacedObjects, SimulatedDetector
from pgm_places.errors import InputError
from pgm_places.features.object_counts import Detector, count_objects
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.simulation import generate_building


def hall(yaw_rad: float = 0.0) -> OccupancyGrid:
    """20 x 20 m of free space with a wall at x = 12 m."""
    cells = np.zeros((200, 200), np.int8)
    cells[:, 120] = 100
    return OccupancyGrid(cells, 0.1, (0.0, 0.0), yaw_rad)


def at(*positions: tuple[float, float]) -> PlacedObjects:
    return PlacedObjects(np.array(positions), np.zeros(len(positions), int), ("cup",))


def seen(
    pose: tuple[float, float, float], *positions: tuple[float, float], **options: float
) -> int:
    detector = SimulatedDetector(hall(), at(*positions), **options)  # type: ignore[arg-type]
    return int(detector.count(pose)[0])


def test_range_and_walls_limit_what_is_seen() -> None:
    assert seen((5.0, 5.0, 0.0), (9.0, 5.0)) == 1
    assert seen((5.0, 5.0, 0.0), (9.0, 5.0), range_m=3.9) == 0
    assert seen((10.0, 5.0, 0.0), (13.0, 5.0)) == 0  # behind the wall
    assert seen((10.0, 5.0, 0.0), (12.1, 5.0)) == 1  # an object on the wall


@given(st.floats(-10, 10), st.floats(-np.pi, np.pi))
def test_a_panorama_sees_each_object_once(heading: float, direction: float) -> None:
    position = (6.0 + 2 * np.cos(direction), 6.0 + 2 * np.sin(direction))
    assert seen((6.0, 6.0, heading), position) == 1


def test_one_image_sees_its_own_field_of_view() -> None:
    options = {"n_images": 1, "image_width_rad": np.pi / 2}
    ahead, aside = (8.0, 6.0), (6.0, 8.0)
    assert seen((6.0, 6.0, 0.0), ahead, aside, **options) == 1
    assert seen((6.0, 6.0, np.pi / 4 - 0.01), ahead, **options) == 1
    assert seen((6.0, 6.0, np.pi / 4 + 0.01), ahead, **options) == 0


def test_what_lies_in_two_images_counts_twice() -> None:
    # Images 90 degrees wide every 45 degrees: every direction lies in two of them.
    for direction in np.linspace(0.1, 6.0, 9):
        position = (6.0 + np.cos(direction), 6.0 + np.sin(direction))
        assert seen((6.0, 6.0, 0.0), position, image_width_rad=np.pi / 2) == 2


def test_positions_are_those_of_the_map_frame() -> None:
    grid = hall(yaw_rad=0.7)
    [[x, y], [behind_x, behind_y]] = grid.cell_centres_m([[100, 100], [100, 130]]).tolist()
    objects = at((behind_x, behind_y))
    assert SimulatedDetector(grid, objects).count([x, y, 0.0]).tolist() == [0]
    assert SimulatedDetector(grid, objects).count([behind_x, behind_y, 0.0]).tolist() == [1]


def test_misses_and_false_alarms_have_their_rates() -> None:
    rng = np.random.default_rng(5)
    poses = np.column_stack([rng.uniform(5, 6, (3000, 2)), rng.uniform(0, 6, 3000)])
    detector = SimulatedDetector(hall(), at((7.0, 5.0), (5.0, 7.0)), p_miss=0.3)
    assert detector.count_along(poses).mean() == pytest.approx(1.4, abs=0.06)
    noisy = SimulatedDetector(hall(), at((7.0, 5.0)), p_miss=1.0, false_alarms=0.05)
    assert noisy.count_along(poses).mean() == pytest.approx(0.4, abs=0.06)


def test_chances_depend_on_the_seed_and_the_pose_alone() -> None:
    rng = np.random.default_rng(6)
    poses = np.column_stack([rng.uniform(2, 11, (40, 2)), rng.uniform(0, 6, 40)])
    objects = at(*[(float(x), float(y)) for x, y in rng.uniform(2, 11, (30, 2))])
    detector = SimulatedDetector(hall(), objects, p_miss=0.4, false_alarms=0.1, seed=3)
    assert isinstance(detector, Detector)
    together = detector.count_along(poses)
    assert (together == count_objects(detector, poses)).all()
    assert (together[::-1] == detector.count_along(poses[::-1])).all()
    other = SimulatedDetector(hall(), objects, p_miss=0.4, false_alarms=0.1, seed=4)
    assert (other.count_along(poses) != together).any()


def test_no_poses_and_no_objects() -> None:
    nothing = PlacedObjects(np.zeros((0, 2)), np.zeros(0, int), ("cup", "chair"))
    detector = SimulatedDetector(hall(), nothing)
    assert detector.count([5.0, 5.0, 0.0]).tolist() == [0, 0]
    assert detector.count_along(np.zeros((0, 3))).shape == (0, 2)


@pytest.mark.parametrize(
    "options",
    [
        {"range_m": 0.0},
        {"n_images": 0},
        {"image_width_rad": 7.0},
        {"p_miss": 1.5},
        {"false_alarms": -1.0},
        {"seed": -1},
    ],
)
def test_options_out_of_range_are_refused(options: dict[str, float]) -> None:
    with pytest.raises(InputError, match=f"{next(iter(options))} must be"):
        SimulatedDetector(hall(), at((1.0, 1.0)), **options)  # type: ignore[arg-type]


def test_objects_stand_in_the_places_they_belong_to() -> None:
    building = generate_building(size="small")
    wanted = {
        "room": {"monitor on": (1, 3), "office cupboard": (1, 1)},
        "corridor": {"plant": (2, 2)},
    }
    placed = place_objects(building.grid, building.labels, building.label_names, wanted, seed=2)
    assert placed.object_names == ("monitor on", "office cupboard", "plant")
    rows, columns = building.grid.cells_at_m(placed.positions_m).T
    assert building.grid.free[rows, columns].all()
    labels = [building.label_names[k] for k in building.labels[rows, columns]]
    expected = ["corridor" if kind == 2 else "room" for kind in placed.kinds]
    assert labels == expected
    again = place_objects(building.grid, building.labels, building.label_names, wanted, seed=2)
    assert (again.positions_m == placed.positions_m).all()


def test_unknown_places_and_numbers_that_are_no_range() -> None:
    grid, labels = hall(), np.zeros((200, 200), int)
    with pytest.raises(InputError, match=r"no label is called 'kichen'\. Did you mean 'kitchen'"):
        place_objects(grid, labels, ["kitchen"], {"kichen": {"cup": (1, 1)}})
    with pytest.raises(InputError, match="kitchen, cup: how many"):
        place_objects(grid, labels, ["kitchen"], {"kitchen": {"cup": (2, 1)}})
