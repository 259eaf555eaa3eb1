"""Coarser maps: the stated rule, walls that stay, doorways that stay open, labels by majority."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places import OccupancyGrid
from pgm_places.errors import LabelError, MapError
from pgm_places.graph.bands import band_limit
from pgm_places.maps.coarsening import (
    Coarsening,
    coarsen,
    coarsen_labels,
    coarsening_factor,
    refine,
)
from tests.reference.coarse_blocks import coarse_cells, coarse_labels, passable_doors, source_cell

shapes = st.tuples(st.integers(1, 13), st.integers(1, 13))


def random_grid(shape: tuple[int, int], seed: int) -> OccupancyGrid:
    rng = np.random.default_rng(seed)
    cells = rng.choice(np.array([0, 0, 0, 100, -1], np.int8), shape)
    return OccupancyGrid(cells, 0.05, (1.0, -2.0), 0.5)


@given(
    shape=shapes,
    factor=st.builds(Fraction, st.integers(2, 10), st.integers(1, 4)).filter(lambda f: f > 1),
    shares=st.tuples(
        st.sampled_from([None, 0.1, 0.25, 0.5, 1.0]), st.sampled_from([0.2, 0.5, 1.0])
    ),
    seed=st.integers(0, 1000),
    chunk=st.sampled_from([1, 40, 1 << 22]),
)
def test_cells_and_labels_are_those_of_the_reference(
    shape: tuple[int, int],
    factor: Fraction,
    shares: tuple[float | None, float],
    seed: int,
    chunk: int,
) -> None:
    grid = random_grid(shape, seed)
    labels = np.random.default_rng(seed + 1).integers(-1, 3, shape).astype(np.int16)
    with band_limit(chunk):
        coarse = coarsen(grid, float(factor) * 0.05, occupied_share=shares[0], free_share=shares[1])
        found = coarsen_labels(labels, grid, coarse)
    default = 1 / (factor if factor.denominator == 1 else 2 * factor)
    expected = coarse_cells(grid.cells, factor, shares[0] or float(default), shares[1])
    assert (coarse.cells == expected).all()
    assert (found == coarse_labels(labels, grid.free, coarse.free, factor)).all()
    assert found.dtype == np.int16


def test_the_frame_is_kept() -> None:
    grid = random_grid((7, 9), 0)
    coarse = coarsen(grid, 0.1)
    assert coarse.shape == (4, 5)
    assert (coarse.origin_xy_m, coarse.yaw_rad) == (grid.origin_xy_m, grid.yaw_rad)
    corner = np.array([[-0.5, -0.5]])
    np.testing.assert_allclose(
        coarse.cell_centres_m(corner), grid.cell_centres_m(corner), rtol=0, atol=1e-12
    )
    assert coarsen(grid, 0.05) is grid


@given(
    factor=st.integers(2, 10).map(Fraction)
    | st.sampled_from([Fraction(3, 2), Fraction(5, 2), Fraction(7, 3), Fraction(9, 4)]),
    offset=st.integers(0, 9),
    thickness=st.integers(1, 3),
    upright=st.booleans(),
)
def test_a_straight_wall_of_one_cell_never_vanishes(
    factor: Fraction, offset: int, thickness: int, upright: bool
) -> None:
    cells = np.zeros((4 * factor.numerator, 40), np.int8)
    cells[factor.numerator + offset % factor.numerator :][:thickness] = 100
    grid = OccupancyGrid(cells.T if upright else cells, 0.02)
    coarse = coarsen(grid, float(factor) * 0.02)
    whole = int(40 / factor)  # blocks that lie inside the map along the wall
    along = np.any(coarse.occupied, axis=1 if upright else 0)
    assert along[:whole].all()


@given(factor=st.integers(2, 8), offset=st.integers(0, 7), extra=st.integers(0, 3))
def test_an_opening_of_two_coarse_cells_never_closes(factor: int, offset: int, extra: int) -> None:
    cells = np.zeros((6 * factor, 8 * factor), np.int8)
    cells[3 * factor - 1] = 100
    start = 2 * factor + offset % factor
    cells[3 * factor - 1, start : start + 2 * factor - 1 + extra] = 0
    coarse = coarsen(OccupancyGrid(cells, 0.05), factor * 0.05)
    assert coarse.free[2].any()
    assert not coarse.free[2].all()


def test_doorways_of_a_generated_corridor_stay_open_at_every_alignment() -> None:
    for offset in range(4):
        cells = np.full((60, 120), 0, np.int8)
        cells[28 + offset % 2 : 30 + offset % 2] = 100
        labels = np.where(cells == 0, 0, -1).astype(np.int16)
        labels[:28] = 1
        for door in (10, 45, 80):
            opening = np.s_[26:32, door + offset : door + offset + 16]  # 0.8 m
            cells[opening], labels[opening] = 0, 2
        grid = OccupancyGrid(cells, 0.05)
        free = np.kron(coarsen(grid, 0.2).free, np.ones((4, 4), np.bool_))
        doors = passable_doors(grid.free, free, labels, doorway=2, reach=6)
        assert doors == [True, True, True]


def test_labels_need_a_majority_and_ties_go_to_the_centre_then_to_the_rarer_label() -> None:
    grid = OccupancyGrid(np.zeros((2, 8), np.int8), 0.05)
    labels = [[2, 2, 1, 1, -1, -1, -1, -1], [2, 0, 2, 2, 1, 1, -1, 0]]
    # 2 | 1 and 2 in equal parts: 1 is the rarer | 1 against nothing | nothing but a quarter of 0
    assert coarsen_labels(labels, grid, coarsen(grid, 0.1)).tolist() == [[2, 1, 1, -1]]
    grid = OccupancyGrid(np.zeros((3, 3), np.int8), 0.05)
    ring = [[0, 1, 0], [1, 1, 2], [0, 2, 0]]
    assert coarsen_labels(ring, grid, coarsen(grid, 0.15)).tolist() == [[0]]
    ring[2][2] = -1  # now three of 0 and of 1, and 1 is at the centre
    assert coarsen_labels(ring, grid, coarsen(grid, 0.15)).tolist() == [[1]]
    grid = OccupancyGrid(np.zeros((2, 2), np.int8), 0.05)
    assert coarsen_labels([[1, 0], [0, 1]], grid, coarsen(grid, 0.1)).tolist() == [[1]]  # met first
    assert coarsen_labels([[-1, -1], [-1, -1]], grid, coarsen(grid, 0.1)).tolist() == [[-1]]


@given(
    shape=shapes,
    factor=st.builds(Fraction, st.integers(2, 10), st.integers(1, 4)).filter(lambda f: f > 1),
    order=st.permutations(range(4)),
    seed=st.integers(0, 1000),
)
def test_coarse_labels_do_not_depend_on_how_labels_are_numbered(
    shape: tuple[int, int], factor: Fraction, order: list[int], seed: int
) -> None:
    grid = random_grid(shape, seed)
    coarse = coarsen(grid, float(factor) * 0.05)
    labels = np.random.default_rng(seed).integers(-1, 4, shape).astype(np.int16)
    number = np.array([*order, -1], np.int16)
    found = coarsen_labels(labels, grid, coarse)
    assert (coarsen_labels(number[labels], grid, coarse) == number[found]).all()


@pytest.mark.parametrize("resolution_m", [0.02, 0.0, -0.1, float("nan"), float("inf")])
def test_smaller_cells_are_refused(resolution_m: float) -> None:
    with pytest.raises(MapError) as caught:
        coarsen(random_grid((4, 4), 0), resolution_m)
    assert f"cells of 0.05 m cannot be coarsened to {resolution_m:g} m" in str(caught.value)
    assert "give at least 0.05 m" in str(caught.value)


def test_the_simplest_fraction_near_the_ratio_is_taken() -> None:
    grid = OccupancyGrid(np.zeros((1, 1), np.int8), 0.02)
    assert coarsening_factor(grid, 0.05) == Fraction(5, 2)
    assert coarsening_factor(grid, 0.0500001) == Fraction(5, 2)
    assert coarsen(grid, 0.0500001).resolution_m == pytest.approx(0.05, rel=1e-12)


@pytest.mark.parametrize(
    ("fine", "coarse"), [(0.05, 0.2), (0.025, 0.2), (0.0500001, 0.2), (0.1, 0.3)]
)
def test_rounded_resolutions_are_whole_factors(fine: float, coarse: float) -> None:
    grid = OccupancyGrid(np.zeros((1, 1), np.int8), fine)
    assert coarsening_factor(grid, coarse) == round(coarse / fine)


def test_bad_shares_and_shapes_are_refused() -> None:
    grid = random_grid((4, 4), 0)
    with pytest.raises(MapError, match="occupied_share must be above 0 and at most 1, got 0"):
        coarsen(grid, 0.1, occupied_share=0.0)
    with pytest.raises(MapError, match=r"free_share must be above 0 and at most 1, got 1\.5"):
        coarsen(grid, 0.1, free_share=1.5)
    with pytest.raises(LabelError, match=r"labels must have shape \(4, 4\), got \(2, 2\)"):
        coarsen_labels(np.zeros((2, 2), np.int16), grid, coarsen(grid, 0.1))
    with pytest.raises(LabelError, match=r"coarsened by 2 does not have \(1, 1\) cells"):
        coarsen_labels(
            np.zeros((4, 4), np.int16), grid, OccupancyGrid(np.zeros((1, 1), np.int8), 0.1)
        )


FACTORS = (Fraction(5, 4), Fraction(3, 2), Fraction(2), Fraction(5, 2), Fraction(10, 3))


@given(
    shape=shapes,
    factor=st.sampled_from(FACTORS),
    seed=st.integers(0, 1000),
    cells_at_once=st.sampled_from([1, 40, 1 << 22]),
    free_share=st.sampled_from([None, 0.05, 0.2]),
)
def test_painted_values_are_those_of_the_reference(
    shape: tuple[int, int],
    factor: Fraction,
    seed: int,
    cells_at_once: int,
    free_share: float | None,
) -> None:
    grid = random_grid(shape, seed)
    coarse = coarsen(grid, float(factor) * grid.resolution_m)
    if free_share is not None:  # the nearest free cell may be far away
        draws = np.random.default_rng(seed + 1).random(coarse.shape)
        coarse = coarse.with_cells(np.where(draws < free_share, 0, 100))
    values = np.random.default_rng(seed).normal(size=(*coarse.shape, 2))
    with band_limit(cells_at_once):
        painted = Coarsening(grid, coarse).paint(values, -9.0)
    expected = np.full((*shape, 2), -9.0)
    if coarse.free.any():
        for r, c in np.argwhere(grid.free):
            expected[r, c] = values[source_cell((r, c), coarse.free, factor)]
    assert np.array_equal(painted, expected)


def test_values_do_not_leak_through_a_wall() -> None:
    cells = np.zeros((6, 9), np.int8)
    cells[:, 4] = 100  # in the middle of the second column of blocks, which is occupied throughout
    grid = OccupancyGrid(cells, 0.05)
    painted = Coarsening(grid, coarsen(grid, 0.15)).paint([[1, 0, 2]] * 2, -1)
    assert painted.tolist() == [[1, 1, 1, 1, -1, 2, 2, 2, 2]] * 6


def test_a_band_of_rows_is_that_part_of_the_whole() -> None:
    grid = random_grid((13, 11), 3)
    pair = Coarsening(grid, coarsen(grid, 0.125))
    values = np.arange(np.prod(pair.coarse.shape)).reshape(pair.coarse.shape)
    whole = pair.paint(values, -1)
    assert (pair.paint(values, -1, rows=slice(4, 9)) == whole[4:9]).all()
    same = Coarsening(grid, grid)
    assert (same.paint(whole, -1, rows=slice(4, 9)) == whole[4:9]).all()


@given(
    shape=shapes,
    factor=st.builds(Fraction, st.integers(1, 20), st.integers(1, 6)).filter(lambda f: f >= 1),
    seed=st.integers(0, 1000),
)
def test_a_refined_cell_is_as_the_cell_that_holds_its_centre(
    shape: tuple[int, int], factor: Fraction, seed: int
) -> None:
    grid = random_grid(shape, seed)
    fine = refine(grid, grid.resolution_m / float(factor))
    assert fine.resolution_m == pytest.approx(grid.resolution_m / float(factor), rel=1e-12)
    assert (fine.origin_xy_m, fine.yaw_rad) == (grid.origin_xy_m, grid.yaw_rad)
    held = np.zeros(shape, np.int64)
    cells = np.argwhere(np.ones(fine.shape))
    for cell, holder in zip(cells, Coarsening(fine, grid).holders(cells), strict=True):
        by_hand = tuple(int((index + Fraction(1, 2)) / factor) for index in cell.tolist())
        assert tuple(holder) == by_hand
        assert fine.cells[tuple(cell)] == grid.cells[by_hand]
        held[by_hand] += 1
    assert held.min() >= 1  # no cell of the map is lost
    last = [(Fraction(size) + Fraction(1, 2)) / factor for size in fine.shape]
    assert all(end >= size for end, size in zip(last, shape, strict=True))


@pytest.mark.parametrize("resolution_m", [0.06, 0.0, -0.1, float("nan")])
def test_larger_cells_are_no_refinement(resolution_m: float) -> None:
    with pytest.raises(MapError, match=r"cells of 0\.05 m cannot be refined to"):
        refine(random_grid((4, 4), 0), resolution_m)


def test_too_many_cells_are_refused() -> None:
    grid = OccupancyGrid(np.zeros((50, 50), np.int8), 1.0)
    with pytest.raises(MapError, match=r"would have 2,500,000,000 of 0\.001 m; crop it"):
        refine(grid, 0.001)


def test_maps_that_do_not_belong_together_are_refused() -> None:
    grid = random_grid((9, 9), 0)
    with pytest.raises(MapError, match=r"is not one of \(9, 9\) cells coarsened by 2"):
        Coarsening(grid, OccupancyGrid(grid.cells, 0.1))
    with pytest.raises(MapError, match=r"the coarse map's shape \(5, 5\), got \(9, 9\)"):
        Coarsening(grid, coarsen(grid, 0.1)).paint(grid.cells, 0)


@pytest.mark.parametrize("side_m", [1e4, 1e300])
def test_cells_larger_than_any_map_are_refused(side_m: float) -> None:
    with pytest.raises(MapError, match="resolution_m must be positive metres per cell"):
        coarsen(OccupancyGrid(np.zeros((1, 1), np.int8), 0.1), side_m)
