"""Gates: chords against small steps, rectangles, features, and the doors of labelled floors."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pgm_places import OccupancyGrid, load_labels, load_map
from pgm_places._core import narrowest_chords, width_profiles
from pgm_places.errors import InputError
from pgm_places.maps.occupancy_grid import FREE
from pgm_places.spaces.doorways import DoorScores, match_doors, match_painted
from pgm_places.spaces.gates import Gate, Gates, gate_candidates, gate_features
from pgm_places.spaces.segmentation import Segmentation
from pgm_places.spaces.space_spec import GATE_FEATURES
from tests.real_data import real_data_folder
from tests.refusals import refused
from tests.spaces.floors import TURNS, corridor_with_rooms, grid_of, two_rooms

LABELS = ("corridor", "room", "doorway")


def gates_of(free: np.ndarray, resolution_m: float = 0.1) -> Gates:
    return gate_candidates(Segmentation.of(grid_of(free, resolution_m)))


def features_of(gates: Gates) -> dict[str, np.ndarray]:
    names = [spec.id for spec in GATE_FEATURES]
    return dict(zip(names, gate_features(gates).T, strict=True))


# ------------------------------------------------------------------ chords


def stepped_run(free: np.ndarray, point: np.ndarray, way: np.ndarray, longest: float) -> float:
    """Length of the free ray, found in steps of a thousandth of a cell."""
    lengths = np.arange(0.0005, longest, 0.001)
    at = np.floor(point + 0.5 + lengths[:, None] * way).astype(int)
    inside = ((at >= 0) & (at < free.shape)).all(axis=1)
    clear = np.zeros(len(at), np.bool_)
    clear[inside] = free[tuple(at[inside].T)]
    return longest if clear.all() else float(lengths[np.argmin(clear)])


@given(
    free=arrays(np.bool_, st.tuples(st.integers(3, 9), st.integers(3, 9)), fill=st.just(True)),
    at=st.tuples(st.floats(0, 1), st.floats(0, 1)),
)
@settings(max_examples=60)
def test_chords_and_widths_are_those_of_small_steps(
    free: np.ndarray, at: tuple[float, float]
) -> None:
    cells, longest = np.where(free, FREE, 100).astype(np.int8), 6.0
    point = np.array(at) * 0.98 * (np.array(free.shape) - 1) + 0.0137
    angle = np.arange(5) * np.pi / 5 + 0.111
    ways = np.stack([np.sin(angle), np.cos(angle)], axis=1)
    halves = [[stepped_run(free, point, sign * way, longest) for sign in (1, -1)] for way in ways]
    chord = np.zeros((1, 4))
    narrowest_chords(cells, FREE, point[None], ways, longest, chord)
    assert chord[0, 3] == pytest.approx(min(map(sum, halves)), abs=0.005)
    k = int(chord[0, 2])
    middle = point + ways[k] * (halves[k][0] - halves[k][1]) / 2
    assert chord[0, :2] == pytest.approx(middle, abs=0.005)
    profile = np.zeros((1, 2))
    width_profiles(cells, FREE, point[None], ways[:1], np.array([0.0, 1.0]), longest, profile)
    moved = point + np.array([ways[0, 1], -ways[0, 0]])
    wanted = [sum(halves[0]), sum(stepped_run(free, moved, s * ways[0], longest) for s in (1, -1))]
    assert profile[0] == pytest.approx(wanted, abs=0.005)


# ------------------------------------------------------------------ rectangles


@pytest.mark.parametrize("wall", [2, 4, 6])
@pytest.mark.parametrize("door", [8, 9])
def test_a_door_is_a_rectangle(wall: int, door: int) -> None:
    gates = gates_of(two_rooms(door=door, wall=wall))
    assert len(gates) == 1
    gate = gates[0]
    assert gate.width_m == pytest.approx(door / 10)
    assert gate.depth_m == pytest.approx(wall / 10, abs=0.11)
    assert gate.heading_rad == pytest.approx(0.0)
    first = 21 - door // 2
    assert gate.centre_m == pytest.approx((4.1 + wall / 20, (first + door / 2) / 10), abs=0.06)


def test_a_turned_grid_turns_the_gate() -> None:
    grid = grid_of(two_rooms(wall=3))
    turned = OccupancyGrid(grid.cells, 0.1, (5.0, -2.0), yaw_rad=0.7)
    gate, other = (gate_candidates(Segmentation.of(g))[0] for g in (grid, turned))
    assert other.heading_rad == pytest.approx(gate.heading_rad + 0.7)
    assert (gate.cells(grid) == other.cells(turned)).all()
    assert len(gate.cells(grid)) > 0
    tilt = [features_of(gate_candidates(Segmentation.of(g)))["tilt"] for g in (grid, turned)]
    assert tilt[0] == pytest.approx(tilt[1], abs=1e-12)


def test_the_cells_of_a_gate_are_those_inside() -> None:
    grid = grid_of(np.ones((30, 30), np.bool_))
    gate = Gate((1.5, 1.5), 0.4, width_m=0.9, depth_m=0.3)
    for margin in (0.0, 0.1):
        found = gate.cells(grid, wider_m=margin, deeper_m=margin)
        every = np.argwhere(grid.free)
        inside = gate.contains(grid.cell_centres_m(every), wider_m=margin, deeper_m=margin)
        assert (found == every[inside]).all()
        area = (0.9 + 2 * margin) * (0.3 + 2 * margin)
        assert len(found) * 0.01 == pytest.approx(area, abs=0.06)
    assert gate.contains(gate.corners_m, wider_m=1e-9, deeper_m=1e-9).all()
    assert Gate((-9.0, 0.0), 0.0, width_m=1.0, depth_m=0.2).cells(grid).shape == (0, 2)


def test_a_pillar_parts_a_double_door_into_two_gates() -> None:
    """The pillar is small enough to be taken for furniture by segments."""
    free = two_rooms(wall=2, door=24)
    free[20:23, 41:43] = False
    gates = gates_of(free)
    assert [round(gate.width_m, 2) for gate in gates] == [1.1, 1.0]
    assert features_of(gates)["gaps"].tolist() == [2, 2]
    assert features_of(gates)["gates_near"].tolist() == [1, 1]


def two_doors(thick: int, *, between: int = 52) -> np.ndarray:
    """Two rooms 5 m wide in cells of 5 cm, a wall with two doors of 1 m, and wall between them."""
    free = np.zeros((208 + thick, 120), np.bool_)
    free[8:103, 10:110] = free[103 + thick : 198 + thick, 10:110] = True
    for first in (60 - between // 2 - 20, 60 + between // 2):
        free[103 : 103 + thick, first : first + 20] = True
    return free


@pytest.mark.parametrize("thick", [1, 2, 3])
def test_a_thin_wall_between_two_doors_is_no_furniture(thick: int) -> None:
    """2.6 m of it have an area of 0.13 to 0.39 m2."""
    for free in (two_doors(thick), two_doors(thick).T):
        gates = gates_of(free, 0.05)
        assert gates.width_m == pytest.approx([1.0, 1.0], abs=1e-3)
        assert gates.segments.tolist() == [[0, 1], [0, 1]]


def test_a_bench_of_that_area_is_furniture() -> None:
    free = np.ones((100, 100), np.bool_)
    free[40:52, 40:50] = False  # 0.6 m x 0.5 m
    assert Segmentation.of(grid_of(free, 0.05)).scales[0].count == 1


@pytest.mark.parametrize("shape", [(1, 1), (20, 20)])
def test_maps_without_open_space_have_no_gates(shape: tuple[int, int]) -> None:
    gates = gates_of(np.zeros(shape, np.bool_))
    assert len(gates) == 0 and gate_features(gates).shape == (0, 75)
    assert list(gates) == []


# ------------------------------------------------------------------ features


def test_features_of_doors_along_a_corridor() -> None:
    gates = gates_of(corridor_with_rooms())
    assert len(gates) == 3
    found = features_of(gates)
    assert found["half_width"] == pytest.approx([0.45] * 3, abs=0.03)
    assert found["width"] == pytest.approx([0.9] * 3)
    assert found["depth"] == pytest.approx([0.5] * 3, abs=0.11)
    assert found["border"] == pytest.approx([0.9] * 3, abs=0.11)
    assert found["small_area"] == pytest.approx([26.5] * 3, abs=1)  # the corridor is narrower
    assert found["large_area"] == pytest.approx([17] * 3, abs=1)
    assert found["saddle_to_small"] == pytest.approx([0.45] * 3, abs=0.03)
    assert found["width_to_large"] == pytest.approx([0.9 / 4.1] * 3, rel=0.05)
    assert found["tilt"] == pytest.approx([0.0] * 3, abs=1e-12)
    assert found["nearest_gate"] == pytest.approx([4.4] * 3, abs=0.05)
    assert found["parted_0.75"].tolist() == found["parted_0.6"].tolist() == [1, 1, 1]
    assert found["width[0]"] == pytest.approx([0.9] * 3)
    before = np.stack([found[f"width[{-k / 10:g}]"] for k in range(1, 16)]).sum(axis=0)
    behind = np.stack([found[f"width[{k / 10:g}]"] for k in range(1, 16)]).sum(axis=0)
    assert (before <= behind).all()


@pytest.mark.parametrize("finer", [2, 4])
def test_finer_cells_change_little(finer: int) -> None:
    free = corridor_with_rooms()
    fine = free.repeat(finer, axis=0).repeat(finer, axis=1)
    one, two = gate_features(gates_of(free)), gate_features(gates_of(fine, 0.1 / finer))
    assert one[:, :44] == pytest.approx(two[:, :44], rel=0.12, abs=0.11)


@pytest.mark.real_data
@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("name", ["freiburg079", "floors/office_village"])
def test_turned_maps_have_the_same_gates(name: str, turn: str) -> None:
    grid = load_map(real_data_folder(name) / "map.yaml").grid
    turned = grid.with_cells(np.ascontiguousarray(TURNS[turn](grid.cells)))
    one, two = (features_of(gate_candidates(Segmentation.of(g))) for g in (grid, turned))
    for column in one:
        assert np.sort(one[column]) == pytest.approx(np.sort(two[column]), abs=1e-9), column


# ------------------------------------------------------------------ doors


def labelled(free: np.ndarray) -> np.ndarray:
    """Corridor below row 25, doorway to row 30, rooms above."""
    labels = np.full(free.shape, -1, np.int16)
    labels[:25], labels[25:30], labels[30:] = 0, 2, 1
    return np.where(free, labels, -1).astype(np.int16)


def test_gates_match_the_doors_that_they_lie_in() -> None:
    free = corridor_with_rooms()
    match = match_doors(gates_of(free), labelled(free), 2)
    assert match.door.tolist() == [0, 1, 2]
    assert match.door_m2 == pytest.approx([0.45] * 3)
    some = match.scores(np.array([True, True, False]))
    assert (some.doors, some.found, some.accepted, some.right) == (3, 2, 2, 2)
    assert some.precision == 1.0 and some.recall == pytest.approx(2 / 3)
    refused(InputError, "one per gate", match.scores, np.array([True]))


def test_a_gate_that_is_no_door_is_invented() -> None:
    free = corridor_with_rooms()
    labels = labelled(free)
    labels[:, :46][labels[:, :46] == 2] = 1  # the first one is a mere gap
    labels[:, 90:] = -1  # the last one nobody labelled
    match = match_doors(gates_of(free), labels, 2)
    assert match.is_doorway.tolist() == [False, True, False]
    assert match.known.tolist() == [True, True, False]
    scores = match.scores(np.ones(3, np.bool_))
    assert (scores.doors, scores.found, scores.accepted, scores.right) == (1, 1, 2, 1)
    nothing = match.scores(np.zeros(3, np.bool_))
    assert (nothing.precision, nothing.recall) == (None, 0.0)


def test_painted_doorways_are_pieces_that_match_doors_too() -> None:
    free = corridor_with_rooms()
    truth, painted = labelled(free), labelled(free)
    painted[:, :46][painted[:, :46] == 2] = 1  # the first door is missed
    painted[40:44, 100:104] = 2  # and one is invented in the last room
    painted[50:53, 100:103] = 2  # 0.09 m2: too small to count
    match = match_painted(painted, grid_of(free), truth, 2)
    assert match.door.tolist() == [1, 2, -1]
    scores = match.scores(np.ones(3, np.bool_))
    assert scores == DoorScores(doors=3, found=2, accepted=3, right=2)
    assert (scores.missed, scores.invented) == (1, 1)
    unknown = np.where(painted == 2, truth, -1)
    assert match_painted(painted, grid_of(free), unknown, 2).known.tolist() == [True] * 3


def test_a_map_without_painted_doorways_misses_every_door() -> None:
    free = corridor_with_rooms()
    painted = np.where(free, np.int16(1), np.int16(-1))
    match = match_painted(painted, grid_of(free), labelled(free), 2)
    assert match.scores(np.zeros(0, np.bool_)) == DoorScores(3, 0, 0, 0)
    both = DoorScores.total([DoorScores(3, 0, 0, 0), DoorScores(5, 4, 6, 3)])
    assert both == DoorScores(8, 4, 6, 3)
    assert DoorScores.total([]) == DoorScores(0, 0, 0, 0)


def coverage(folders: list[Path]) -> float:
    """Share of the doors of some maps that a candidate matches."""
    doors = found = 0
    for folder in folders:
        grid = load_map(folder / "map.yaml").grid
        gates = gate_candidates(Segmentation.of(grid))
        labels = load_labels(folder / "labels.png", LABELS, grid=grid)
        scores = match_doors(gates, labels, 2).scores(np.ones(len(gates), np.bool_))
        doors, found = doors + scores.doors, found + scores.found
    return found / doors


@pytest.mark.real_data
@pytest.mark.parametrize("kind", ["office", "school"])
def test_candidates_cover_the_doors_of_drawn_floors(kind: str) -> None:
    folders = sorted(real_data_folder("floors").glob(f"{kind}*"))
    assert len(folders) >= 13
    assert coverage(folders) >= 0.96


@pytest.mark.real_data
@pytest.mark.parametrize("name", ["freiburg079", "freiburg052", "freiburg079_drawn"])
def test_candidates_cover_every_door_of_real_maps(name: str) -> None:
    assert coverage([real_data_folder(name)]) == 1.0
