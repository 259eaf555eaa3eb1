"""Topological maps whose doorways are gates: rooms and corridors end there, whatever the labels."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places.graph.bands import band_limit
from pgm_places.graph.layout import GridLayout
from pgm_places.maps.coarsening import coarsen
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.spaces.doorways import Doorways
from pgm_places.spaces.gates import Gate, gate_candidates
from pgm_places.spaces.segmentation import Segmentation
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.gate_pieces import grow
from pgm_places.topology.rules import CorrectionRules
from pgm_places.topology.topological_map import TopologicalMap
from tests.spaces.floors import TURNS, corridor_with_rooms, grid_of, two_rooms
from tests.topology.floors import NAMES, gates_of, rasters

CORRIDOR, ROOM, DOORWAY = range(3)


def ring_of_offices() -> np.ndarray:
    """Four offices of 4 m x 4 m around a core, each joined to the next two by doors of 0.9 m."""
    free = np.zeros((84, 84), np.bool_)
    for r in (1, 43):
        for c in (1, 43):
            free[r : r + 40, c : c + 40] = True
    for middle in (20, 62):
        free[middle - 4 : middle + 5, 41:43] = True
        free[41:43, middle - 4 : middle + 5] = True
    return free


def floor() -> tuple[OccupancyGrid, np.ndarray]:
    """A corridor along three rooms, the middle one's doorway not painted."""
    free = corridor_with_rooms()
    labels = np.where(free, np.int16(ROOM), np.int16(-1))
    labels[:25][free[:25]] = CORRIDOR
    labels[25:30][free[25:30]] = DOORWAY
    labels[25:28, 50:80][free[25:28, 50:80]] = CORRIDOR
    labels[28:30, 50:80][free[28:30, 50:80]] = ROOM
    return grid_of(free), labels


def places(found: TopologicalMap) -> list[str]:
    return sorted(region.label for region in found.regions)


def test_a_doorway_that_labels_miss_is_found() -> None:
    grid, labels = floor()
    missed = ["corridor", *2 * ["doorway"], *3 * ["room"]]
    assert places(topological_map(grid, labels, NAMES)) == missed
    found = topological_map(grid, labels, NAMES, doorways=gates_of(grid))
    assert places(found) == ["corridor", *3 * ["doorway"], *3 * ["room"]]
    assert not found.corrections
    for door in (region for region in found.regions if region.label == "doorway"):
        assert {other.label for other in found.neighbours(door.id)} == {"corridor", "room"}
        assert door.gate is not None
        assert door.gate.contains([door.anchor_m])[0]
        assert door.gate.width_m == pytest.approx(0.9)
        assert door.confidence == pytest.approx(0.9)


@pytest.mark.parametrize("label", [CORRIDOR, ROOM])
def test_offices_in_a_ring_are_places_of_their_own(label: int) -> None:
    free = ring_of_offices()
    grid, labels = grid_of(free), np.where(free, np.int16(label), np.int16(-1))
    assert places(topological_map(grid, labels, NAMES)) == [NAMES[label]]
    found = topological_map(grid, labels, NAMES, doorways=gates_of(grid))
    assert places(found) == sorted([*4 * ["doorway"], *4 * [NAMES[label]]])
    assert len(found.connections) == 8
    assert all(values["doorway"] for _, _, values in found.place_graph.edges(data=True))
    assert found.place_graph.number_of_edges() == 4


@pytest.mark.parametrize("turn", TURNS.values(), ids=TURNS.keys())
def test_turned_maps_have_the_same_places(turn: object) -> None:
    free = ring_of_offices()
    free[1:9, 1:9] = free[75:, :5] = False  # so that no two offices are alike
    grid, labels = grid_of(free), np.where(free, np.int16(ROOM), np.int16(-1))
    straight = topological_map(grid, labels, NAMES, doorways=gates_of(grid))
    turned = np.ascontiguousarray(turn(free))  # type: ignore[operator]
    grid, labels = grid_of(turned), np.where(turned, np.int16(ROOM), np.int16(-1))
    found = topological_map(grid, labels, NAMES, doorways=gates_of(grid))
    assert sorted((r.label, round(r.area_m2, 6)) for r in found.regions) == sorted(
        (r.label, round(r.area_m2, 6)) for r in straight.regions
    )


@pytest.mark.parametrize("door", [5, 9, 14])
@pytest.mark.parametrize("wall", [1, 2, 5])
def test_the_labels_of_a_doorway_reach_no_further_than_its_gate(door: int, wall: int) -> None:
    free = two_rooms(door=door, wall=wall)
    grid, labels = grid_of(free), np.where(free, np.int16(ROOM), np.int16(-1))
    labels[:, 35 : 46 + wall][free[:, 35 : 46 + wall]] = DOORWAY  # 0.5 m into both rooms
    found = topological_map(grid, labels, NAMES, doorways=gates_of(grid))
    assert places(found) == ["doorway", "room", "room"]
    [gate] = [region.gate for region in found.regions if region.gate is not None]
    r, c = np.nonzero(found.labels == DOORWAY)
    assert (c.min() - 41 >= -2) and (c.max() - 40 - wall <= 2)
    assert len(c) >= door * wall
    assert gate.contains(
        grid.cell_centres_m(np.stack([r, c], axis=1)), wider_m=0.1, deeper_m=0.1
    ).all()
    assert (found.labels[free] >= 0).all()


@given(
    values=rasters,
    seed=st.integers(0, 99),
    groups=st.integers(1, 3),
)
def test_values_grow_ring_by_ring_within_their_group(
    values: np.ndarray, seed: int, groups: int
) -> None:
    rng = np.random.default_rng(seed)
    open_cells = (values < 0) & (rng.random(values.shape) < 0.8)
    group = rng.integers(0, groups, values.shape).astype(np.int32)
    expected = values.copy()
    while True:
        before = expected.copy()
        for r, c in np.argwhere(open_cells & (before < 0)):
            part = np.s_[max(r - 1, 0) : r + 2, max(c - 1, 0) : c + 2]
            near = before[part][(group[part] == group[r, c]) & (before[part] >= 0)]
            expected[r, c] = near.min(initial=99) if near.size else -1
        if (expected == before).all():
            break
    grow(values, open_cells, group)
    assert values.tolist() == expected.tolist()


def test_a_painted_doorway_without_a_gate_becomes_what_is_around_it() -> None:
    free = two_rooms()
    grid, labels = grid_of(free), np.where(free, np.int16(ROOM), np.int16(-1))
    labels[5:12, 5:12] = DOORWAY
    found = topological_map(grid, labels, NAMES, doorways=gates_of(grid))
    assert places(found) == ["doorway", "room", "room"]
    [item] = found.corrections
    assert (item.reason, item.was, item.became, item.cell_rc) == ("no gate", "doorway", "", (5, 5))
    assert item.area_m2 == pytest.approx(0.49)


def test_a_place_that_is_nothing_but_doorway_takes_the_commonest_label() -> None:
    free = two_rooms(right=20)
    grid, labels = grid_of(free), np.where(free, np.int16(ROOM), np.int16(-1))
    labels[:, 41:][free[:, 41:]] = DOORWAY
    found = topological_map(grid, labels, NAMES, doorways=gates_of(grid))
    assert places(found) == ["doorway", "room", "room"]


def test_specks_join_places_rather_than_gates() -> None:
    free = two_rooms()
    grid, labels = grid_of(free), np.where(free, np.int16(ROOM), np.int16(-1))
    labels[:, 36:41] = -1
    labels[17:26, 39:41] = CORRIDOR  # 0.18 m2 along the whole doorway
    labels[20:22, 36:39] = ROOM  # and a narrow border to the room
    found = topological_map(grid, labels, NAMES, doorways=gates_of(grid))
    assert places(found) == ["doorway", "room", "room"]
    assert [item.became for item in found.corrections] == ["room"]
    left = topological_map(grid, labels, NAMES, doorways=gates_of(grid), correct=False)
    assert places(left) == ["corridor", "doorway", "room", "room"]


def test_painted_cells_beside_a_gate_take_the_nearest_label() -> None:
    grid, labels = floor()
    painted = labels.copy()
    painted[19:25, 18:27] = DOORWAY  # far into the corridor, which is not the commonest label
    found = topological_map(grid, painted, NAMES, doorways=gates_of(grid), correct=False)
    assert (found.labels[19:24, 18:27] == CORRIDOR).all()
    assert not found.corrections


def test_no_diagonal_step_leads_past_a_thin_gate() -> None:
    r, c = np.mgrid[:60, :60]
    door = np.abs(r + c - 59) < 8
    free = ((np.abs(r - c) > 1) | door) & (np.minimum(r, c) > 0) & (np.maximum(r, c) < 59)
    grid, labels = grid_of(free), np.where(free, np.int16(ROOM), np.int16(-1))
    gate = Gate((3.0, 3.0), -np.pi / 4, width_m=1.2, depth_m=0.02)
    one_place = np.where(free, np.int32(0), np.int32(-1))
    doorways = Doorways(grid, (gate,), np.array([0.8]), one_place)
    assert places(topological_map(grid, labels, NAMES)) == ["room"]
    found = topological_map(grid, labels, NAMES, doorways=doorways)
    assert places(found) == ["doorway", "room", "room"]
    assert len(found.connections) == 2


def test_cells_along_walls_that_a_coarser_map_blurs_lie_in_their_own_place() -> None:
    free = two_rooms(door=18, left=81, right=60)
    free[35:39, 82] = True  # a gap that is no doorway joins both rooms beside the gate
    grid, labels = grid_of(free, 0.05), np.where(free, np.int16(ROOM), np.int16(-1))
    coarse = coarsen(grid, 0.1)
    candidates = gate_candidates(Segmentation.of(coarse))
    doorways = gates_of(coarse, [0.9 if gate.width_m > 0.6 else 0.1 for gate in candidates])
    assert len(doorways) == 1
    assert ((doorways.place_on(grid) < 0) & free).sum() > 100
    found = topological_map(grid, labels, NAMES, doorways=doorways, correct=False)
    assert places(found) == ["doorway", "room", "room"]
    assert len(np.unique(found.region[1:10, 83:140])) == 1  # from the wall at column 82 on
    assert len(np.unique(found.region[1:10, 2:82])) == 1


def test_a_closet_too_small_for_a_place_belongs_to_its_doorway() -> None:
    free = two_rooms(right=3, door=7)
    free[:17, 42:] = free[26:, 42:] = False  # 0.3 m x 0.9 m
    grid, labels = grid_of(free), np.where(free, np.int16(ROOM), np.int16(-1))
    gates = gates_of(grid_of(two_rooms(door=7)))
    grown = np.full(grid.shape, -1, np.int32)
    grown[free] = 0
    found = topological_map(
        grid, labels, NAMES, doorways=Doorways(grid, gates.gates, gates.probability, grown)
    )
    assert places(found) == ["room"]  # and a doorway to nothing is none
    kept = topological_map(
        grid,
        labels,
        NAMES,
        doorways=Doorways(grid, gates.gates, gates.probability, grown),
        rules=CorrectionRules(doorways_join_two=False),
    )
    assert places(kept) == ["doorway", "room"]


def test_places_end_at_gates_though_a_gap_beside_one_is_not_accepted() -> None:
    free = two_rooms()
    free[34:39, 41] = True  # a second gap, which is no doorway
    grid, labels = grid_of(free), np.where(free, np.int16(ROOM), np.int16(-1))
    candidates = gate_candidates(Segmentation.of(grid))
    assert len(candidates) == 2
    chosen = [0.9 if gate.width_m > 0.7 else 0.1 for gate in candidates]
    doorways = gates_of(grid, chosen)
    assert len(doorways) == 1
    found = topological_map(grid, labels, NAMES, doorways=doorways)
    assert places(found) == ["doorway", "room", "room"]
    assert len(found.connections) == 3  # through the doorway, and directly through the gap


def test_where_gates_overlap_the_more_probable_one_is_the_doorway() -> None:
    free = two_rooms(wall=6)
    grid, labels = grid_of(free), np.where(free, np.int16(ROOM), np.int16(-1))
    one = gates_of(grid)
    [gate] = one.gates
    both = (replace(gate, depth_m=gate.depth_m / 2), gate)
    for chance in ([0.6, 0.9], [0.9, 0.6]):
        doorways = Doorways(grid, both, np.array(chance), one.place)
        found = topological_map(grid, labels, NAMES, doorways=doorways, correct=False)
        doors = [region for region in found.regions if region.gate is not None]
        strongest = max(doors, key=lambda region: region.confidence or 0.0)
        assert strongest.gate == both[int(np.argmax(chance))]
        assert (len(doors) == 1) == (chance[1] > chance[0])


def test_without_gates_doorways_are_those_of_the_labels() -> None:
    grid, labels = floor()
    plain = topological_map(grid, labels, NAMES)
    none = topological_map(grid, labels, NAMES, doorways=gates_of(grid, 0.1))
    np.testing.assert_array_equal(none.region, plain.region)
    unnamed = topological_map(grid, labels, ("corridor", "room", "hatch"), doorways=gates_of(grid))
    assert [region.gate for region in unnamed.regions] == [None] * 4


@pytest.mark.parametrize("with_gates", [False, True])
def test_memory_stays_small_on_a_huge_map(with_gates: bool) -> None:
    grid = grid_of(np.tile(ring_of_offices(), (12, 12)))
    labels = np.where(grid.free, np.int16(ROOM), np.int16(-1))
    layout = GridLayout.of_map(grid)
    beliefs = np.full((len(layout.cells_rc), 3), 1 / 3, np.float32)
    with band_limit(20_000):
        doorways = gates_of(grid) if with_gates else None
        tracemalloc.start()
        found = topological_map(
            grid, labels, NAMES, beliefs=beliefs, layout=layout, doorways=doorways
        )
    assert found.labels.shape == labels.shape
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 17 * labels.size  # bytes: four rasters of 32 bits
