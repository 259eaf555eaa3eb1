"""Outlines enclose exactly their cells, stay valid when simplified, and fit their neighbours."""

import itertools
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pgm_places.maps.components import connected_components
from pgm_places.simulation import generate_building
from pgm_places.topology.outlines import Outline, outlines
from tests.strategies import varied_arrays

rasters = varied_arrays(
    np.int16, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=st.integers(-1, 1)
)
Point = tuple[int, int]
Segment = tuple[Point, Point]


def ring_area(ring: np.ndarray) -> float:
    y, x = ring.astype(np.int64).T
    return float((x[:-1] * y[1:] - x[1:] * y[:-1]).sum() / 2)


def area(outline: Outline) -> float:
    return sum(ring_area(ring) for rings in outline.polygons for ring in rings)


def cells_inside(outline: Outline, shape: tuple[int, int]) -> np.ndarray:
    """Even-odd rule at the centres of cells."""
    inside = np.zeros(shape, np.bool_)
    for rings in outline.polygons:
        for ring in rings:
            for (y0, x0), (y1, x1) in itertools.pairwise(ring.tolist()):
                for r in range(shape[0]):
                    if (y0 > r + 0.5) != (y1 > r + 0.5):
                        x = x0 + Fraction(2 * r + 1 - 2 * y0, 2 * (y1 - y0)) * (x1 - x0)
                        inside[r, np.arange(shape[1]) + 0.5 < float(x)] ^= True
    return inside


def segments(outline: Outline) -> list[Segment]:
    return [
        (tuple(a), tuple(b))
        for rings in outline.polygons
        for ring in rings
        for a, b in itertools.pairwise(ring.tolist())
    ]


def side(a: Point, b: Point, p: Point) -> int:
    return (b[1] - a[1]) * (p[0] - a[0]) - (b[0] - a[0]) * (p[1] - a[1])


def on(a: Point, b: Point, p: Point) -> bool:
    return (
        side(a, b, p) == 0
        and min(a[0], b[0]) <= p[0] <= max(a[0], b[0])
        and min(a[1], b[1]) <= p[1] <= max(a[1], b[1])
    )


def clash(first: Segment, second: Segment) -> bool:
    """Whether two segments meet anywhere but in a common end."""
    a, b = first
    c, d = second
    if {a, b} == {c, d}:
        return True
    if np.sign(side(a, b, c)) * np.sign(side(a, b, d)) < 0 and (
        np.sign(side(c, d, a)) * np.sign(side(c, d, b)) < 0
    ):
        return True
    inner = [on(a, b, p) and p not in (a, b) for p in (c, d)]
    inner += [on(c, d, p) and p not in (c, d) for p in (a, b)]
    return any(inner)


@settings(deadline=None)
@given(raster=rasters)
def test_exact_outlines_hold_exactly_their_cells(raster: np.ndarray) -> None:
    pieces = connected_components(raster)
    found = outlines(pieces.piece, pieces.count, tolerance=0)
    assert len(found) == pieces.count
    for number, outline in enumerate(found):
        assert (cells_inside(outline, raster.shape) == (pieces.piece == number)).all()
        assert area(outline) == pieces.size[number]
        for rings in outline.polygons:
            assert ring_area(rings[0]) > 0
            assert all(ring_area(ring) < 0 for ring in rings[1:])


@pytest.mark.parametrize("tolerance", [0.0, 0.8, 1.5, 4.0])
@settings(deadline=None, max_examples=60)
@given(raster=rasters)
def test_rings_are_simple_and_never_cross(tolerance: float, raster: np.ndarray) -> None:
    pieces = connected_components(raster)
    found = outlines(pieces.piece, pieces.count, tolerance=tolerance)
    for outline in found:
        for rings in outline.polygons:
            for ring in rings:
                assert (ring[0] == ring[-1]).all()
                assert len(ring) >= 4
                assert len({tuple(point) for point in ring.tolist()}) == len(ring) - 1
            assert ring_area(rings[0]) > 0
            assert all(ring_area(ring) < 0 for ring in rings[1:])
            assert sum(ring_area(ring) for ring in rings) > 0
        # rings of one piece: no two of their segments meet but in common ends
        for first, second in itertools.combinations(segments(outline), 2):
            assert not clash(first, second)


@settings(deadline=None, max_examples=60)
@given(raster=rasters)
def test_neighbours_share_their_borders(raster: np.ndarray) -> None:
    pieces = connected_components(raster)
    found = outlines(pieces.piece, pieces.count, tolerance=1.5)
    everything = {(min(s), max(s)) for outline in found for s in segments(outline)}
    for first, second in itertools.combinations(sorted(everything), 2):
        assert not clash(first, second)


def test_a_diagonal_wall_becomes_one_line() -> None:
    cells = np.tri(30, 30, dtype=np.int32) - 1
    [outline] = outlines(cells, 1, tolerance=1.0)
    [[ring]] = outline.polygons
    assert len(ring) - 1 <= 5
    assert area(outline) == pytest.approx((cells == 0).sum(), rel=0.04, abs=0)


def test_a_building_needs_few_points_and_keeps_its_areas() -> None:
    building = generate_building(size="small")
    pieces = connected_components(building.labels)
    exact = outlines(pieces.piece, pieces.count, tolerance=0)
    found = outlines(pieces.piece, pieces.count)
    assert sum(len(segments(o)) for o in found) < sum(len(segments(o)) for o in exact)
    for outline, size in zip(found, pieces.size, strict=True):
        assert abs(area(outline) - size) <= 1.5 * outline.length


@pytest.mark.parametrize("number", [0, 1])
def test_a_hole_belongs_to_the_part_that_it_is_in(number: int) -> None:
    """One piece of two parts, the inner in a hole of the outer; each has a hole of its own."""
    nested = np.full((11, 11), number, np.int32)
    nested[1:10, 1:10] = -1
    nested[3:8, 3:8] = number
    nested[5, 5] = -1
    nested[0, 0] = 0
    outline = outlines(nested, number + 1, tolerance=0)[number]
    inner, outer = (
        [abs(ring_area(ring)) for ring in rings]
        for rings in sorted(outline.polygons, key=lambda rings: ring_area(rings[0]))
    )
    assert inner == [25, 1]
    assert outer == [121 - number, 81]
