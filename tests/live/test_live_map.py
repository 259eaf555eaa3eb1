"""A map labelled as it grows: the labels of the final map, and places that keep their ids."""

import numpy as np
import pytest

from pgm_places import trained_labeler
from pgm_places.errors import MapError
from pgm_places.labelers.place_labeler import PlaceLabeler, PlaceMethod
from pgm_places.labelling.label import label_map
from pgm_places.labelling.model import LoadedModel
from pgm_places.live.live_map import LiveLabels, LiveMap
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.simulation import generate_building
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.rules import TopologyOptions
from pgm_places.unary.options import SpaceOptions
from tests import drives
from tests.live.loop_closure import bent
from tests.quick_labeler import places


@pytest.fixture(scope="module")
def building() -> OccupancyGrid:
    return generate_building(1, size="small", resolution_m=0.1).grid


@pytest.fixture(scope="module")
def labeler() -> PlaceLabeler:
    made = generate_building(0, size="small", resolution_m=0.1)
    return PlaceLabeler(
        made.label_names,
        {
            "list": PlaceMethod("independent", "laser"),
            "nearby": PlaceMethod("relaxation", "context"),
            "places": PlaceMethod("potts", "space"),
        },
        classifier=DecisionListClassifier(n_rounds=20),
        context_m=(0.3, 1.5),
        space=SpaceOptions(n_rounds=10),
        n_folds=2,
    ).fit([LabelledMap(made.grid, made.labels)])


def steps(grid: OccupancyGrid) -> list[OccupancyGrid]:
    """The left half of a building, all of it, and with a chair that comes and goes."""
    half, chair = grid.cells.copy(), grid.cells.copy()
    half[:, grid.shape[1] // 2 :] = UNKNOWN
    row, column = np.argwhere(grid.free)[len(np.argwhere(grid.free)) // 3]
    chair[row : row + 4, column : column + 4] = OCCUPIED
    return [grid.with_cells(half), grid, grid.with_cells(chair), grid]


@pytest.mark.parametrize("method", ["list", "nearby", "places"])
def test_labels_are_those_of_each_map_by_itself(
    labeler: PlaceLabeler, building: OccupancyGrid, method: str
) -> None:
    live = LiveMap(LoadedModel(labeler, method), few_cells=1)
    for number, grid in enumerate(steps(building), 1):
        found, alone = live.on_map(grid), label_map(labeler, grid, method=method)
        np.testing.assert_array_equal(found.labels.labels, alone.labels)
        np.testing.assert_array_equal(found.labels.labeling.beliefs, alone.labeling.beliefs)
        places = topological_map(
            grid,
            alone.labels,
            alone.label_names,
            beliefs=alone.labeling.beliefs,
            layout=alone.layout,
            doorways=alone.doorways,
        )
        np.testing.assert_array_equal(found.topology.region > 0, places.region > 0)
        assert len(found.topology.regions) == len(places.regions)
        assert found.map_seq == number
        assert found.update is not None
        assert number == 1 or found.update.n_cast < found.update.n_cells


def test_rules_and_names_of_places_are_those_that_were_given(
    labeler: PlaceLabeler, building: OccupancyGrid
) -> None:
    rules = TopologyOptions(min_width_m=100.0, correct=False, doorways="labels")
    live = LiveMap(LoadedModel(labeler, "list", rules), own_names={1: "Reception"})
    found = live.on_map(building).topology
    assert (found.connections, found.corrections) == ((), ())
    assert all(region.gate is None for region in found.regions)
    assert found.place(1).name == "Reception"


def test_ids_and_anchors_stay_where_chairs_are_moved(
    labeler: PlaceLabeler, building: OccupancyGrid
) -> None:
    live = LiveMap(LoadedModel(labeler, "places"))
    _, whole, chair, again = (live.on_map(grid) for grid in steps(building))
    ids = {item.id for item in whole.topology.regions}
    for found in (chair, again):
        kept = ids & {item.id for item in found.topology.regions}
        assert len(kept) >= 0.95 * len(ids)
        assert sum(moved > 0.5 for moved in found.moved.values()) <= 0.05 * len(ids)
    assert names(again) == names(whole)


def noisy(grid: OccupancyGrid, seed: int, share: float = 0.02) -> OccupancyGrid:
    """Some of the free cells, at random, are occupied."""
    hit = grid.free & (np.random.default_rng(seed).random(grid.shape) < share)
    return grid.with_cells(np.where(hit, OCCUPIED, grid.cells))


def test_noise_that_comes_and_goes_changes_no_place(
    labeler: PlaceLabeler, building: OccupancyGrid
) -> None:
    live = LiveMap(LoadedModel(labeler, "places"))
    first = live.on_map(building)
    ids = {item.id for item in first.topology.regions}
    for seed in range(3):
        found = live.on_map(noisy(building, seed))
        kept = ids & {item.id for item in found.topology.regions}
        assert len(kept) >= 0.95 * len(ids)
        assert sum(moved > 0.5 for moved in found.moved.values()) <= 0.05 * len(ids)
        assert found.update is not None
        assert found.update.n_changed < 0.1 * np.sum(noisy(building, seed).cells != building.cells)


def test_ids_and_anchors_stay_where_a_loop_is_closed() -> None:
    shipped, n_kept, n_near, n_all = trained_labeler(), 0, 0, 0
    for seed in (0, 5):
        grid = generate_building(seed, size="small", resolution_m=0.05).grid
        live = LiveMap(shipped)
        before = live.on_map(grid)
        cells = bent(grid.cells, 10, UNKNOWN)  # half a metre
        found = live.on_map(OccupancyGrid(cells, grid.resolution_m, grid.origin_xy_m))
        kept = names(before).keys() & names(found).keys()
        n_all, n_kept = n_all + len(names(before)), n_kept + len(kept)
        n_near += sum(found.moved.get(place, 0.0) <= 0.5 for place in kept)
        assert all(names(before)[place] == names(found)[place] for place in kept)
    assert n_near >= 0.95 * n_all
    assert n_kept >= 0.95 * n_all


def test_a_map_that_comes_again_and_again_is_taken_as_it_is(
    labeler: PlaceLabeler, building: OccupancyGrid
) -> None:
    live, sent = LiveMap(LoadedModel(labeler, "list"), few_maps=2), noisy(building, 7)
    live.on_map(building)
    live.on_map(sent)
    found = live.on_map(sent)
    np.testing.assert_array_equal(found.labels.grid.cells, sent.cells)
    alone = label_map(labeler, sent, method="list")
    np.testing.assert_array_equal(found.labels.labels, alone.labels)
    again = live.on_map(sent)
    assert again.update is not None
    assert (again.map_seq, again.update.n_cast, again.moved) == (4, 0, {})
    assert again.labels is found.labels


def names(found: LiveLabels) -> dict[int, str]:
    return {item.id: item.name for item in found.topology.regions}


def test_a_place_that_was_gone_gets_its_id_and_name_back(
    labeler: PlaceLabeler, building: OccupancyGrid
) -> None:
    live = LiveMap(LoadedModel(labeler, "places"))
    whole = live.on_map(building)
    room = max(whole.topology.regions, key=lambda item: (item.label == "room", item.area_m2))
    cells = building.cells.copy()
    cells[whole.topology.region == room.id] = UNKNOWN
    without = live.on_map(building.with_cells(cells))
    assert room.id in without.vanished
    back = live.on_map(building)
    assert names(back)[room.id] == room.name
    assert room.id in back.appeared


def test_a_bad_map_leaves_the_one_before_current(
    labeler: PlaceLabeler, building: OccupancyGrid
) -> None:
    live = LiveMap(LoadedModel(labeler, "list"))
    assert live.current is None
    found = live.on_map(building)
    with pytest.raises(MapError, match="no free cell"):
        live.on_map(building.with_cells(np.where(building.free, UNKNOWN, building.cells)))
    assert live.current is found
    assert (building.cells == FREE).any()
    assert live.on_map(building).map_seq == 2


def test_a_map_that_grows_on_a_canvas_is_labelled_as_by_itself() -> None:
    """The part that is known grows, and with it the part that is labelled."""
    grid = drives.building()[0].grid
    height, width = grid.shape
    live = LiveMap(places(), few_cells=1)
    for columns in (100, 140, width):
        cells = np.full((height + 400, width + 500), UNKNOWN, np.int8)
        cells[200 : 200 + height, 250 : 250 + columns] = grid.cells[:, :columns]
        canvas = OccupancyGrid(cells, grid.resolution_m, (-3.0, 5.0), 0.2)
        found, alone = live.on_map(canvas), label_map(places(), canvas)
        assert (found.labels.labels == alone.labels).all()
        assert found.topology.region.shape == canvas.shape
    assert found.update is not None
    assert found.update.n_cast < found.update.n_cells


def test_a_session_whose_map_has_another_origin_keeps_its_ids_and_says_so(
    building: OccupancyGrid,
) -> None:
    first = LiveMap(places())
    before = first.on_map(building)
    assert before.warnings == ()
    moved = OccupancyGrid(building.cells, building.resolution_m, (200.0, -30.0), building.yaw_rad)
    after = LiveMap(places(), memory=first.memory).on_map(moved)
    np.testing.assert_array_equal(after.topology.region, before.topology.region)
    [warning] = after.warnings
    assert "(200, -30) m" in warning and warning.endswith("they keep their ids")
