"""A building on a large canvas of unknown cells has the labels of the same map cropped by hand."""

from functools import cache

import numpy as np
import pytest

from pgm_places import OccupancyGrid
from pgm_places.labelers.labelled_places import LabelledPlaces
from pgm_places.labelling.label import label_map
from pgm_places.maps.coarsening import coarsen, refine
from pgm_places.maps.occupancy_grid import FREE, UNKNOWN
from pgm_places.maps.windows import MARGIN_M
from pgm_places.simulation import generate_building
from pgm_places.studio.relabelling import quick_labels
from pgm_places.teaching.explanation import explain_cell, explain_region
from pgm_places.teaching.interactive_labeler import InteractiveLabeler
from pgm_places.teaching.paint import Paint
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.topological_map import TopologicalMap
from pgm_places.trained import trained_labeler

RESOLUTIONS = (0.05, 0.1, 0.02)
AROUND = ((140, 260), (200, 100))
"""Multiples of the cells of 2 cm in which blocks of 5 cm begin anew."""


@cache
def by_hand(resolution_m: float) -> OccupancyGrid:
    """A corner of a building, with the margin that is left."""
    grid = generate_building(9, size="small", resolution_m=0.05).grid
    corner = OccupancyGrid(grid.cells[:100, :160], 0.05)
    if resolution_m != 0.05:
        corner = (refine if resolution_m < 0.05 else coarsen)(corner, resolution_m)
    r, c = np.nonzero(corner.cells != UNKNOWN)
    known = corner.cells[r.min() : r.max() + 1, c.min() : c.max() + 1]
    cells = np.pad(known, round(MARGIN_M / resolution_m), constant_values=UNKNOWN)
    return OccupancyGrid(cells, resolution_m, (1.0, 2.0), 0.3)


def on_canvas(grid: OccupancyGrid) -> OccupancyGrid:
    cells = np.pad(grid.cells, AROUND, constant_values=UNKNOWN)
    x, y = grid.cell_centres_m([[-AROUND[0][0] - 0.5, -AROUND[1][0] - 0.5]])[0]
    return OccupancyGrid(cells, grid.resolution_m, (float(x), float(y)), grid.yaw_rad)


def within(raster: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    (top, _), (left, _) = AROUND
    inner = raster[top : top + shape[0], left : left + shape[1]]
    return np.asarray(inner)


def known_of(grid: OccupancyGrid) -> np.ndarray:
    """A few free cells that are known to be a room."""
    known = np.full(grid.shape, -1)
    free = np.argwhere(grid.cells == FREE)
    known[tuple(free[len(free) // 2 : len(free) // 2 + 40].T)] = 1
    return known


@cache
def labelled(resolution_m: float, *, is_large: bool) -> LabelledPlaces:
    small = by_hand(resolution_m)
    known = known_of(small)
    if not is_large:
        return label_map(trained_labeler("generated"), small, known=known)
    whole = np.pad(known, AROUND, constant_values=-1)
    return label_map(trained_labeler("generated"), on_canvas(small), known=whole)


def places_of(found: LabelledPlaces) -> TopologicalMap:
    return topological_map(
        found.grid,
        found.labels,
        found.label_names,
        beliefs=found.labeling.beliefs,
        layout=found.layout,
        doorways=found.doorways,
    )


@pytest.mark.parametrize("resolution_m", RESOLUTIONS)
def test_labels_and_probabilities_are_those_of_the_map_cropped_by_hand(resolution_m: float) -> None:
    small = labelled(resolution_m, is_large=False)
    large = labelled(resolution_m, is_large=True)
    assert large.grid.shape == large.labels.shape != small.grid.shape
    assert (within(large.labels, small.labels.shape) == small.labels).all()
    assert np.count_nonzero(large.labels >= 0) == np.count_nonzero(small.labels >= 0)
    assert small.labeling.beliefs is not None and large.labeling.beliefs is not None
    assert (large.labeling.beliefs == small.labeling.beliefs).all()
    room = [found.on_map(found.labeling.beliefs[:, 1], np.nan) for found in (small, large)]  # type: ignore[index]
    np.testing.assert_array_equal(within(room[1], room[0].shape), room[0])
    assert small.doorways is not None and large.doorways is not None
    place = small.doorways.place_on(small.grid)
    assert (within(large.doorways.place_on(large.grid), place.shape) == place).all()
    assert large.shares() == small.shares()
    assert bool(large.unentered) == bool(small.unentered)


@pytest.mark.parametrize("resolution_m", RESOLUTIONS)
def test_places_are_those_of_the_map_cropped_by_hand(resolution_m: float) -> None:
    small, large = (
        places_of(labelled(resolution_m, is_large=is_large)) for is_large in (False, True)
    )
    assert large.region.shape == large.grid.shape
    assert (within(large.region, small.region.shape) == small.region).all()
    assert large.next_id == small.next_id
    for one, other in zip(small.regions, large.regions, strict=True):
        assert (one.id, one.name, one.label, one.area_m2) == (
            *(other.id, other.name, other.label),
            other.area_m2,
        )
        np.testing.assert_allclose(one.anchor_m, other.anchor_m, rtol=0, atol=1e-9)
        assert one.confidence == pytest.approx(other.confidence, rel=1e-12)
    assert len(large.connections) == len(small.connections)
    for before, after in zip(small.corrections, large.corrections, strict=True):
        assert np.subtract(after.cell_rc, before.cell_rc).tolist() == [AROUND[0][0], AROUND[1][0]]


def test_only_what_is_known_is_split() -> None:
    """A canvas of 4 million cells of 10 cm would be 16 million of 5 cm."""
    small = by_hand(0.1)
    cells = np.pad(small.cells, ((900, 1000), (900, 1000)), constant_values=UNKNOWN)
    found = label_map(
        trained_labeler("generated"), OccupancyGrid(cells, 0.1), max_cells=8 * small.cells.size
    )
    assert found.labels.shape == cells.shape
    assert (found.labels[900:-1000, 900:-1000] >= 0).any()


def test_a_teacher_answers_and_explains_as_on_the_map_cropped_by_hand() -> None:
    small = by_hand(0.1)
    known, large = known_of(small), on_canvas(small)
    answers = []
    for grid, labels in ((small, known), (large, np.pad(known, AROUND, constant_values=-1))):
        teacher = InteractiveLabeler(grid, trained_labeler("generated"))
        paint = Paint(labels.astype(np.int16), teacher.classes)
        answers.append((teacher.label(paint), teacher.teach(paint)))
    for one, other in zip(*answers, strict=True):
        assert other.labels.shape == large.shape
        assert (within(other.labels, small.shape) == one.labels).all()
        assert (within(other.unary_labels, small.shape) == one.unary_labels).all()
        x, y = small.cell_centres_m(np.argwhere(one.labels >= 0))[30]
        first, second = explain_cell(one, x, y), explain_cell(other, x, y)
        assert (first.label, first.questions) == (second.label, second.questions)
        assert first.probabilities == second.probabilities
        place = one.topology.regions[0].id
        assert explain_region(one, place).features == explain_region(other, place).features
    for name, labelled in answers[0][0].by_method.items():
        whole = answers[1][0].by_method[name]().labels
        assert (within(whole, small.shape) == labelled().labels).all()


def test_a_glance_is_that_of_the_map_cropped_by_hand() -> None:
    small = by_hand(0.1)
    labeler = trained_labeler("default")
    found, whole = quick_labels(labeler, small), quick_labels(labeler, on_canvas(small))
    assert found is not None and whole is not None
    assert (within(whole, small.shape) == found).all()
    assert np.count_nonzero(whole >= 0) == np.count_nonzero(found >= 0) > 0
