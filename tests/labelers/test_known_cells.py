"""Cells of known label: every method keeps them, on the map's own raster, and gates follow."""

from functools import cache, partial
from typing import Any

import numpy as np
import pytest

from pgm_places import LabelledMap, OccupancyGrid, PlaceLabeler, topological_map
from pgm_places.errors import LabelError
from pgm_places.inference.backends import BACKENDS, METHODS, build, traits_of
from pgm_places.labelers.known_cells import KnownCells
from pgm_places.labelers.labelled_places import LabelledPlaces
from pgm_places.labelling import label as labelling
from pgm_places.maps.coarsening import coarsen, refine
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.simulation import LabelledBuilding, generate_building
from pgm_places.spaces.entered_options import EnteredOptions
from pgm_places.topology.topological_map import TopologicalMap
from pgm_places.trained import trained_labeler
from pgm_places.unary.options import SpaceOptions

label_map = partial(labelling.label_map, entered=EnteredOptions(unentered=True))

NAMES = ("corridor", "room", "doorway")
MAP_METHODS = [name for name in BACKENDS if not traits_of(METHODS.find(name)).chains_only]
QUICK: dict[str, dict[str, Any]] = {"crf": {"learner": "piecewise"}, "amn": {"max_cuts": 5}}
"""Options of methods that learn for long."""


@cache
def building() -> LabelledBuilding:
    return generate_building(9, size="small", resolution_m=0.1)


@cache
def labeler() -> PlaceLabeler:
    unfitted = PlaceLabeler(
        NAMES,
        {name: build(name, QUICK.get(name)) for name in MAP_METHODS},
        classifier=DecisionListClassifier(n_rounds=10, order="rarest-first"),
        space=SpaceOptions(n_rounds=5),
        n_folds=2,
        max_examples_per_map=1000,
    )
    return unfitted.fit([LabelledMap(building().grid, building().labels)])


def wrong(grid: OccupancyGrid, share: float = 0.05) -> np.ndarray:
    """Some cells, each with a label that is not its true one."""
    chosen = grid.free & (np.random.default_rng(3).random(grid.shape) < share)
    return np.where(chosen, (building().labels + 1) % 3, -1).astype(np.int16)


@pytest.mark.filterwarnings("ignore:better weights may exist")  # learned in a few cuts
@pytest.mark.parametrize("method", MAP_METHODS)
def test_every_method_keeps_every_painted_cell(method: str) -> None:
    grid = building().grid
    known = wrong(grid)
    plain = label_map(labeler(), grid, method=method)
    assert (plain.labels != known)[known >= 0].mean() > 0.5
    found = label_map(labeler(), grid, method=method, known=known)
    np.testing.assert_array_equal(found.labels[known >= 0], known[known >= 0])
    if found.labeling.beliefs is not None:
        sure = found.on_map(found.labeling.beliefs, 0.0)[known >= 0]
        np.testing.assert_array_equal(sure, np.eye(3)[known[known >= 0]])


@pytest.mark.parametrize("resolution_m", [0.05, 0.04, 0.15])
def test_known_cells_are_kept_on_maps_of_other_resolutions(resolution_m: float) -> None:
    grid = building().grid
    other = refine(grid, resolution_m) if resolution_m < 0.1 else coarsen(grid, resolution_m)
    known = np.full(other.shape, -1)
    chosen = np.argwhere(other.free)[::7]
    known[chosen[:, 0], chosen[:, 1]] = np.arange(len(chosen)) % 3
    found = label_map(labeler(), other, known=known)
    np.testing.assert_array_equal(found.labels[known >= 0], known[known >= 0])
    assert ((found.labels >= 0) == other.free).all()


def test_a_coarser_cell_takes_the_label_of_most_of_its_known_parts() -> None:
    grid = OccupancyGrid(np.array([[0] * 6, [0, 0, 0, 100, 0, 0]], np.int8), 0.05)
    coarse = coarsen(grid, 0.1, occupied_share=0.9)
    known = [[1, -1, -1, -1, -1, -1], [1, 0, -1, 2, -1, 0]]  # the cell labelled 2 is a wall
    found = KnownCells.of(known, grid, coarse, NAMES, NAMES)
    assert found.on_cells.tolist() == [[1, -1, 0]]
    assert found.on_map.tolist() == [known[0], [1, 0, -1, -1, -1, 0]]


def test_halls_are_corridors_to_the_methods_and_halls_in_the_result() -> None:
    halls = trained_labeler().with_options(halls="hall")
    assert halls.label_names_ == (*NAMES, "hall")
    whole = generate_building(9, size="small", resolution_m=0.05).grid
    grid = whole.with_cells(whole.cells[:100, :160])
    known = np.full(grid.shape, -1)
    cells = np.argwhere(grid.free)
    known[cells[:, 0], cells[:, 1]] = np.maximum(np.arange(len(cells)) % 9 - 5, -1)
    for method in halls.methods_:
        found = label_map(halls, grid, method=method, known=known)
        np.testing.assert_array_equal(found.labels[known >= 0], known[known >= 0])


def test_a_painted_doorway_is_a_gate_and_a_gate_painted_over_is_none() -> None:
    grid = building().grid
    plain = label_map(labeler(), grid)
    assert plain.doorways is not None and len(plain.doorways)
    gate = plain.doorways.gates[0]
    known = np.full(grid.shape, -1)
    r, c = gate.cells(grid, wider_m=0.15, deeper_m=0.15).T
    known[r, c] = NAMES.index("room")
    without = label_map(labeler(), grid, known=known).doorways
    assert without is not None and gate not in without.gates
    assert len(without) == len(plain.doorways) - 1
    assert without.removed == (gate,)
    places = topological_map(grid, plain.labels, NAMES, doorways=without)
    assert places.removed_openings == (gate.line_m,)
    near = gate.cells(grid, wider_m=2.0, deeper_m=2.0)
    broad = np.full(grid.shape, -1)
    broad[tuple(near.T)] = NAMES.index("room")
    assert len(near) * grid.resolution_m**2 > 4
    rooms = label_map(labeler(), grid, known=broad).doorways
    assert rooms is not None and gate not in rooms.gates and gate not in rooms.removed
    known[r, c] = NAMES.index("doorway")
    again = label_map(labeler(), grid, known=known).doorways
    assert again is not None and again.probability[again.gates.index(gate)] == 1


@pytest.mark.parametrize("name", ["room", "doorway"])
def test_a_doorway_that_paint_covers_partly_stays_with_a_warning(name: str) -> None:
    grid = building().grid
    plain = label_map(labeler(), grid)
    assert plain.doorways is not None
    gate = plain.doorways.gates[0]
    cells = gate.cells(grid, wider_m=0.1, deeper_m=0.1)
    across = gate.in_frame_m(grid.cell_centres_m(cells))[1]
    part = cells[np.argsort(across, kind="stable")[: len(cells) * 2 // 5]]
    known = np.full(grid.shape, -1)
    known[tuple(part.T)] = NAMES.index(name)
    found = label_map(labeler(), grid, known=known)
    assert found.doorways is not None and gate in found.doorways.gates
    messages = [message for message in found.warnings if message.startswith("the corrections")]
    if name == "doorway":
        assert messages == []
        return
    [message] = messages
    x, y = gate.centre_m
    share = 100 * len(part) / len(cells)
    assert f"only {share:.0f} % of the doorway at ({x:.2f}, {y:.2f})" in message
    assert "paint at least 50 % of it" in message


def test_a_doorway_painted_where_there_is_no_gate_parts_a_room_in_two() -> None:
    """A line across the middle of the largest room, from wall to wall."""
    grid = building().grid
    plain = label_map(labeler(), grid)

    def places(found: LabelledPlaces) -> TopologicalMap:
        return topological_map(grid, found.labels, NAMES, doorways=found.doorways)

    before = places(plain)
    room = max((r for r in before.regions if r.label == "room"), key=lambda r: r.area_m2)
    cells = before.cells(room.id)
    column = int(np.median(cells[:, 1]))
    line = cells[cells[:, 1] == column]
    known = np.full(grid.shape, -1)
    known[line[:, 0], line[:, 1]] = NAMES.index("doorway")
    after = places(label_map(labeler(), grid, known=known))
    left, right = ([int(line[0, 0]), column + side] for side in (-3, 3))
    ids = [after.region[r, c] for r, c in (left, right)]
    assert ids[0] != ids[1]
    runs = np.split(line, np.flatnonzero(np.diff(line[:, 0]) > 1) + 1)  # between furniture
    run = max(runs, key=len)
    door = after.region_at(*grid.cell_centres_m([run[len(run) // 2]])[0])
    assert door is not None and door.label == "doorway" and door.confidence == 1
    assert door.gate is not None
    assert door.gate.width_m == pytest.approx(0.1 * len(run), abs=1e-9)
    assert {region.id for region in after.neighbours(door.id)} & set(ids)


def test_labels_that_do_not_fit_are_refused_in_one_line() -> None:
    grid = building().grid
    with pytest.raises(LabelError, match=r"known must have shape .*, got \(2, 2\)"):
        label_map(labeler(), grid, known=np.zeros((2, 2), int))
    with pytest.raises(LabelError, match="known must hold labels from 0 to 2"):
        label_map(labeler(), grid, known=np.full(grid.shape, 3))
