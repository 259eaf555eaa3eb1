"""Spaces as wholes: where borders between corridor and room run after the scores are known."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.graph.layout import GridLayout, MaskCells
from pgm_places.labelers.place_problem import smooth_over_spaces
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.simulation import generate_building
from pgm_places.spaces.cell_features import CellFeatures, NodeFeatures, NodeSegments
from pgm_places.spaces.segmentation import Segmentation
from tests.quick_labeler import places
from tests.reference.whole_spaces import best_labels

NAMES = ("corridor", "room", "doorway")
CORRIDOR, ROOM, DOORWAY = range(3)
CELLS_M = 0.1


def layout_of(shape: tuple[int, int]) -> GridLayout:
    return GridLayout.of_map(OccupancyGrid(np.zeros(shape, np.int8), resolution_m=CELLS_M))


def scores(label: NDArray[np.int64], sure: Any = 0.7) -> NDArray[np.float64]:
    """(H W, 3) log-probabilities of cells that are as sure of their labels as they say."""
    right = np.broadcast_to(np.asarray(sure, float), label.shape).ravel()
    found = np.repeat(((1 - right) / 2)[:, None], 3, axis=1)
    found[np.arange(label.size), label.ravel()] = right
    return np.log(found)


def segments_of(segment: NDArray[np.int64], *ribbons: int) -> NodeSegments:
    """Those of the cells of a raster, some of which are ribbons."""
    is_ribbon = np.isin(np.arange(int(segment.max()) + 1), ribbons)
    return NodeSegments(segment.ravel().astype(np.int32), is_ribbon, ~is_ribbon)


def labels(
    given: NDArray[np.float64], segment: NDArray[np.int64], *ribbons: int, **more: Any
) -> NDArray[np.int64]:
    segments = segments_of(segment, *ribbons)
    found = smooth_over_spaces(given, segments, layout_of(segment.shape), NAMES, **more)
    return found.argmax(axis=1).reshape(segment.shape)


def test_a_border_in_the_open_goes_where_little_speaks_for_the_smaller_side() -> None:
    hall = np.zeros((40, 100), int)
    label = np.where(np.arange(100) < 80, ROOM, CORRIDOR) + hall
    assert (labels(scores(label, 0.6), hall) == ROOM).all()


def test_a_border_in_the_open_stays_where_much_speaks_for_both_sides() -> None:
    hall = np.zeros((40, 100), int)
    label = np.where(np.arange(100) < 50, ROOM, CORRIDOR) + hall
    given = scores(label, 0.99)
    found = smooth_over_spaces(given, segments_of(hall), layout_of(hall.shape), NAMES)
    assert found is given


def test_a_border_beside_an_opening_moves_to_it() -> None:
    segment = np.zeros((20, 100), int)
    segment[:, 50:] = 1
    label = np.where(np.arange(100) < 42, ROOM, CORRIDOR) + np.zeros_like(segment)
    found = labels(scores(label, 0.8), segment)
    assert (found == np.where(segment == 0, ROOM, CORRIDOR)).all()


def test_a_ribbon_that_continues_a_corridor_is_corridor_and_one_behind_a_door_is_not() -> None:
    segment = np.zeros((20, 160), int)
    segment[:, 80:] = 1
    label = np.where(segment == 0, CORRIDOR, ROOM)
    given = scores(label)
    assert (labels(given, segment) == label).all()
    assert (labels(given, segment, 1) == CORRIDOR).all()
    label[:, 79:81] = DOORWAY
    assert (labels(scores(label), segment, 1) == label).all()


def test_ribbons_are_long_and_narrow_segments() -> None:
    cells = np.full((120, 260), 100, np.int8)
    cells[50:70, 5:150], cells[20:100, 156:250], cells[55:65, 150:156] = 0, 0, 0
    grid = OccupancyGrid(cells, resolution_m=CELLS_M)
    features = CellFeatures.of(Segmentation.of(grid))
    found = NodeFeatures.of(features, MaskCells.of(grid.free)).segments
    assert (found.segment < len(found.is_ribbon)).all()
    columns = np.nonzero(grid.free)[1]
    inside = found.segment >= 0
    ribbon = found.is_ribbon[found.segment[inside]]
    in_passage = columns[inside] < 145
    assert ribbon[in_passage].all()
    assert not ribbon[(columns[inside] > 160)].any()


@pytest.mark.parametrize(("sure", "kept"), [(0.7, False), (0.95, True)])
def test_a_corridor_in_an_open_place_needs_the_place_to_be_a_sure_corridor(
    sure: float, kept: bool
) -> None:
    hall = np.zeros((40, 100), int)
    label = np.where(np.arange(100) < 40, ROOM, CORRIDOR) + hall
    given, place = scores(label, np.where(label == ROOM, 0.7, sure)), np.zeros(hall.size, int)
    assert (labels(given, hall, place=place) == label).all()
    weighed = labels(given, hall, place=place, weigh_wide=True)
    assert (weighed == (label if kept else ROOM)).all()
    assert (labels(given, hall, 0, place=place, weigh_wide=True) == CORRIDOR).all()  # not wide
    assert (labels(given, hall, place=place - 1, weigh_wide=True) == label).all()  # of no place


def test_doorways_stay_and_keep_their_probability() -> None:
    hall = np.zeros((20, 60), int)
    label = np.where(np.arange(60) < 45, ROOM, CORRIDOR) + hall
    label[8:12, 43:47] = DOORWAY
    given = scores(label, 0.6)
    found = smooth_over_spaces(given, segments_of(hall), layout_of(hall.shape), NAMES)
    moved = (label == CORRIDOR).ravel()
    assert (found.argmax(axis=1)[~moved] == label.ravel()[~moved]).all()
    assert (found.argmax(axis=1)[moved] == ROOM).all()
    np.testing.assert_array_equal(found[:, DOORWAY], given[:, DOORWAY])
    np.testing.assert_allclose(np.exp(found).sum(axis=1), 1.0, rtol=1e-12)
    share = np.exp(found[moved, ROOM]) / np.exp(found[moved][:, [CORRIDOR, ROOM]]).sum(axis=1)
    np.testing.assert_allclose(share, 0.65, rtol=1e-12)


def test_known_cells_keep_their_part_and_bring_over_what_is_doubtful() -> None:
    hall = np.zeros((20, 60), int)
    label = np.where(np.arange(60) < 45, ROOM, CORRIDOR) + hall
    known = np.full(label.shape, -1)
    known[5, 50:55] = CORRIDOR
    doubtful = scores(label, 0.4)
    assert (labels(doubtful, hall) == ROOM).all()
    assert (labels(doubtful, hall, known=known.ravel()) == CORRIDOR).all()
    sure = np.where(label == ROOM, 0.999, 0.6)
    assert (labels(scores(label, sure), hall, known=known.ravel()) == label).all()


def beside_paint(sure: float, width: int, place: NDArray[np.int64] | None = None) -> bool:
    """Whether the strip along a painted corridor, a segment of its own, is corridor, too."""
    segment = np.zeros((20 + width, 100), int)
    segment[20:] = 1
    label = np.where(segment == 0, CORRIDOR, ROOM)
    known = np.where(segment == 0, CORRIDOR, -1).ravel()
    more = {} if place is None else {"place": place[segment].ravel()}
    found = labels(scores(label, sure), segment, known=known, **more)
    assert (found[:20] == CORRIDOR).all()
    strip = np.unique(found[20:])
    assert strip.size == 1
    return bool(strip[0] == CORRIDOR)


def test_known_cells_pull_the_strip_along_them_but_no_room_and_nothing_behind_a_doorway() -> None:
    assert beside_paint(0.95, 15)
    assert not beside_paint(0.95, 60)  # as open to it, but much deeper: a room
    assert not beside_paint(0.95, 15, np.array([0, 1]))
    assert beside_paint(0.95, 15, np.array([3, 3]))


@pytest.mark.parametrize("seed", range(20))
def test_labels_are_the_best_of_all(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape = (int(rng.integers(2, 4)), int(rng.integers(3, 5)))
    segment = np.repeat(rng.integers(-1, 2, (1, shape[1])), shape[0], axis=0)
    label = rng.choice(3, shape, p=[0.45, 0.45, 0.1])
    given = scores(label, 0.99)
    odds = (rng.exponential(60.0, shape) * np.where(label == CORRIDOR, 1, -1)).ravel()
    other = np.where(label == DOORWAY, 0.0, -1e6).ravel()
    given[:, :2] = np.stack([odds / 2, -odds / 2], axis=1) - 1e4
    given[:, DOORWAY] = other
    expected = best_labels(odds.reshape(shape), label, segment, {1}, CELLS_M)
    np.testing.assert_array_equal(labels(given, segment, 1), expected)


def test_other_labels_are_left_alone() -> None:
    given = scores(np.zeros((4, 4), int))
    one = segments_of(np.zeros((4, 4), int))
    assert smooth_over_spaces(given, one, layout_of((4, 4)), ("office", "room", "door")) is given


def test_labelers_do_so_for_methods_that_see_segments_unless_told_otherwise() -> None:
    labeler, grid = places(), generate_building(4, size="small", resolution_m=0.05).grid
    graph, found = labeler.scores(grid)
    method, names = labeler.method(), labeler.learned_names
    assert method.unary == "space"
    specks = np.random.default_rng(0).integers(0, 2, graph.n_nodes)
    found = replace(found, space=scores(specks, 0.4))
    assert found.segments is not None
    assert isinstance(graph.layout, GridLayout)
    assert found.space is not None
    expected = smooth_over_spaces(found.space, found.segments, graph.layout, names)
    assert (expected != found.space).any()
    np.testing.assert_array_equal(labeler.problem_of(graph, found, method).unary, expected)
    plain = labeler.with_options(whole_spaces=False)
    np.testing.assert_array_equal(plain.problem_of(graph, found, method).unary, found.space)
