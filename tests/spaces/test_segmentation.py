"""Segments against slow and obvious references, and on turned, mirrored and coarser maps."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pgm_places import OccupancyGrid, load_map
from pgm_places._core import highest_passes, merge_basins
from pgm_places.errors import InputError
from pgm_places.maps.coarsening import coarsen
from pgm_places.maps.occupancy_grid import UNKNOWN
from pgm_places.spaces.basins import (
    UNIT,
    find_basins,
    half_width_m,
    neighbour_steps,
    open_space,
    relief_of,
)
from pgm_places.spaces.segmentation import Segmentation, _require_numbers
from tests.real_data import real_data_folder
from tests.reference import spaces as reference
from tests.refusals import refused
from tests.spaces.floors import TURNS, grid_of, partition, two_rooms
from tests.strategies import varied_arrays

shapes = st.tuples(st.integers(1, 14), st.integers(1, 14))
masks = varied_arrays(np.bool_, shapes, elements=st.sampled_from([True, True, True, False]))
heights = varied_arrays(np.int32, shapes, elements=st.integers(0, 5))
REAL = ("freiburg079", "freiburg052", "intel", "floors/school_plans1", "floors/office_village")


def framed(relief: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(np.pad(relief, 1).astype(np.int32))


def inner(raster: np.ndarray, count: int) -> np.ndarray:
    """Without the frame, lines as -2."""
    part = raster[1:-1, 1:-1]
    return np.where(part >= count, -2, part)


# ------------------------------------------------------------------ step by step


@given(free=varied_arrays(np.bool_, shapes), resolution_m=st.sampled_from([0.2, 0.3, 0.5]))
def test_open_space_is_that_of_labelled_pieces(free: np.ndarray, resolution_m: float) -> None:
    found = open_space(grid_of(free, resolution_m))
    assert (found == reference.open_cells(free, resolution_m)).all()


def test_specks_of_the_unknown_are_filled_too() -> None:
    cells = np.zeros((12, 12), np.int8)
    cells[5, 5] = UNKNOWN
    assert open_space(OccupancyGrid(cells, 0.1)).all()


@given(is_open=masks)
def test_the_relief_is_the_smoothed_distance(is_open: np.ndarray) -> None:
    assert (relief_of(is_open)[1:-1, 1:-1] == reference.smoothed_distance(is_open)).all()


def test_cuts_divide_a_room_and_leave_its_clearance_as_it_is() -> None:
    grid = grid_of(np.pad(np.ones((40, 80), np.bool_), 1))
    cuts = np.array([[row, 40] for row in range(1, 41)])
    whole, cut = Segmentation.of(grid), Segmentation.of(grid, cuts=cuts)
    assert (whole.scales[-1].count, cut.scales[-1].count) == (1, 2)
    np.testing.assert_array_equal(cut.watershed.relief, whole.watershed.relief)


@pytest.mark.parametrize("cells", range(3, 30))
def test_a_passage_is_as_wide_as_it_is(cells: int) -> None:
    relief = relief_of(np.ones((cells, 200), np.bool_))
    assert half_width_m(relief.max(), 1.0) == pytest.approx(cells / 2, abs=1 / 12 + 1e-3)


@given(relief=heights)
def test_basins_are_those_of_the_definition(relief: np.ndarray) -> None:
    found = find_basins(framed(relief))
    assert (inner(found.raster, found.count) == reference.basins(relief)).all()


@given(is_open=masks)
def test_basins_of_distances_are_those_of_the_definition(is_open: np.ndarray) -> None:
    relief = relief_of(is_open)
    found = find_basins(relief)
    wanted = reference.basins(relief[1:-1, 1:-1])
    assert (inner(found.raster, found.count) == wanted).all()
    numbers = range(found.count + found.n_lines)
    assert found.area.tolist() == [(found.raster == k).sum() for k in numbers]
    tops = [relief[found.raster == k].max() for k in range(found.count)]
    assert found.summit[: found.count].tolist() == tops


@given(relief=heights)
def test_passes_are_those_of_a_search(relief: np.ndarray) -> None:
    flat = framed(relief)
    found = find_basins(flat)
    steps, raster = neighbour_steps(flat.shape[1]), found.raster.reshape(-1)
    passes, touching = highest_passes(raster, flat.reshape(-1), steps, found.count)
    got = {(a, b): height for a, b, height in passes.tolist()}
    assert len(got) == len(passes)
    assert got == reference.passes(inner(found.raster, found.count), relief)
    on_border = [
        i
        for i in np.flatnonzero(raster >= 0)
        if raster[i] >= found.count
        or any(0 <= b < found.count and b != raster[i] for b in raster[i + steps[1::2]])
    ]
    assert touching.tolist() == on_border


@st.composite
def basin_graphs(draw: st.DrawFn) -> tuple[list[tuple[int, int]], list[int], list[int], list[int]]:
    n = draw(st.integers(1, 7))
    every = [(a, b) for a in range(n) for b in range(a + 1, n)]
    pairs = draw(st.lists(st.sampled_from(every), unique=True)) if every else []
    width = draw(st.lists(st.integers(1, 6), min_size=len(pairs), max_size=len(pairs)))
    radius = draw(st.lists(st.integers(1, 8), min_size=n, max_size=n))
    area = draw(st.lists(st.integers(1, 3), min_size=n, max_size=n))
    return pairs, width, radius, area


@given(graph=basin_graphs(), shuffled=st.randoms(use_true_random=False))
@settings(max_examples=300)
def test_merging_is_that_of_sets_whatever_the_order(
    graph: tuple[list[tuple[int, int]], list[int], list[int], list[int]], shuffled: "object"
) -> None:
    pairs, width, radius, area = graph
    order = list(range(len(pairs)))
    shuffled.shuffle(order)  # type: ignore[attr-defined]
    order.sort(key=lambda e: -width[e])
    parent = np.empty(len(radius), np.int32)
    merge_basins(
        np.array([pairs[e] for e in order], np.int32).reshape(-1, 2),
        np.array([width[e] for e in order], float),
        np.array(radius, float),
        np.array(area, np.int64),
        0.75,
        2.0,
        parent,
    )
    found = {frozenset(np.flatnonzero(parent == root).tolist()) for root in set(parent.tolist())}
    widths = {pair: float(w) for pair, w in zip(pairs, width, strict=True)}
    assert found == reference.merged(
        len(radius), widths, [float(r) for r in radius], area, 0.75, 2.0
    )


@given(
    free=arrays(np.bool_, st.tuples(st.integers(10, 30), st.integers(10, 30)), fill=st.just(True))
)
@settings(max_examples=50)
def test_openings_are_the_pieces_of_the_borders(free: np.ndarray) -> None:
    found = Segmentation.of(grid_of(free, 1.0))
    if found.watershed.basins.n_lines:
        return  # the reference knows no lines
    relief = found.watershed.relief[1:-1, 1:-1]
    for scale in found.scales:
        wanted = reference.border_pieces(scale.raster(), relief)
        assert scale.openings.segments.tolist() == [list(piece[0]) for piece in wanted]
        got = sorted(
            zip(
                map(tuple, scale.openings.segments.tolist()),
                scale.openings.sides.tolist(),
                np.rint((scale.openings.half_width_m - 0.25) * UNIT).tolist(),
                scale.openings.saddle_rc.tolist(),
                scale.openings.centre_rc.tolist(),
                strict=True,
            )
        )
        for one, other in zip(got, wanted, strict=True):
            assert one[:3] == other[:3]
            np.testing.assert_allclose(one[3:], other[3:], rtol=1e-12)
        for (a, b), basins in zip(scale.openings.segments, scale.openings.basins, strict=True):
            assert scale.of_basins(basins).tolist() in ([a, b], [b, a])


# ------------------------------------------------------------------ the whole


def test_a_door_parts_two_rooms() -> None:
    found = Segmentation.of(grid_of(two_rooms(door=9)))
    for scale in found.scales:
        assert scale.count == 2
        assert len(scale.openings) == 1
        assert scale.openings.half_width_m[0] == pytest.approx(0.45, abs=0.03)
        assert scale.openings.saddle_rc[0] == pytest.approx([21, 41], abs=1.0)
        assert scale.graph.edges.tolist() == [[0, 1]]
    assert found.scales[0].radius_m == pytest.approx([2.05, 2.05], abs=0.06)


def test_two_doors_between_two_rooms_are_two_openings() -> None:
    free = two_rooms(wall=3)
    free[:, 41:44] = False
    free[4:13, 41:44] = free[30:39, 41:44] = True
    openings = Segmentation.of(grid_of(free)).scales[0].openings
    assert openings.segments.tolist() == [[0, 1], [0, 1]]
    assert openings.saddle_rc[:, 0] == pytest.approx([8, 34], abs=1.0)
    assert openings.length_m == pytest.approx([0.9, 0.9], abs=0.15)
    assert np.abs(openings.direction_rc) == pytest.approx(np.array([[1.0, 0.0]] * 2), abs=0.05)


def test_a_wide_passage_parts_nothing() -> None:
    assert [s.count for s in Segmentation.of(grid_of(two_rooms(door=39))).scales] == [1, 1, 1]


def test_coarser_scales_merge_more() -> None:
    found = Segmentation.of(grid_of(two_rooms(door=29)))
    assert [scale.count for scale in found.scales] == [2, 2, 1]


def test_cells_are_looked_up() -> None:
    found = Segmentation.of(grid_of(two_rooms())).scales[0]
    assert found.at([[21, 10], [21, 70], [0, 0]]).tolist() == [0, 1, -1]
    assert (found.at(np.argwhere(found.raster() >= -1)) == found.raster().ravel()).all()
    with pytest.raises(InputError, match=r"on the map of \(43, 83\) cells, got \(43, 0\) at ind"):
        found.at([[1, 1], [43, 0]])
    refused(InputError, "integers of shape", found.at, np.zeros((2, 2)))


@pytest.mark.parametrize("ratios", [(), (0.5, 0.9), (1.2,), (0.5, 0.0)])
def test_ratios_must_fall(ratios: tuple[float, ...]) -> None:
    refused(InputError, "decreasing numbers", Segmentation.of, grid_of(two_rooms()), ratios)


def test_maps_of_too_many_cells_are_refused() -> None:
    _require_numbers((46_000, 46_000))
    with pytest.raises(InputError, match="less than 2\\^31 cells, got 46400 x 46400; coarsen"):
        _require_numbers((46_400, 46_400))


@pytest.mark.parametrize("shape", [(1, 1), (1, 30), (30, 1), (20, 20)])
def test_maps_without_open_space_have_no_segments(shape: tuple[int, int]) -> None:
    found = Segmentation.of(grid_of(np.zeros(shape, np.bool_)))
    for scale in found.scales:
        assert scale.count == 0 and len(scale.openings) == 0 and scale.graph.n_nodes == 0
        assert (scale.raster() == -1).all()


def test_threads_at_once_give_the_same_bits() -> None:
    """Kernels release the interpreter lock and share nothing."""
    from concurrent.futures import ThreadPoolExecutor

    generator = np.random.default_rng(11)
    grids = [grid_of(generator.random((120, 150)) > 0.03) for _ in range(4)]
    alone = [Segmentation.of(grid).scales[0].raster() for grid in grids]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda grid: Segmentation.of(grid).scales[0].raster(), grids))
    assert all((a == b).all() for a, b in zip(alone, together, strict=True))


# ------------------------------------------------------------------ turned and mirrored: exactly


def assert_turned_alike(grid: OccupancyGrid, turn: str) -> None:
    turned = TURNS[turn]
    before, after = (
        Segmentation.of(g)
        for g in (grid, grid.with_cells(np.ascontiguousarray(turned(grid.cells))))
    )
    for one, other in zip(before.scales, after.scales, strict=True):
        assert (partition(turned(one.raster())) == partition(other.raster())).all()
        assert sorted(one.openings.half_width_m) == sorted(other.openings.half_width_m)
        assert sorted(one.openings.sides) == sorted(other.openings.sides)
        assert sorted(one.area_m2) == sorted(other.area_m2)


@pytest.mark.parametrize("turn", TURNS)
@given(free=arrays(np.bool_, st.tuples(st.integers(2, 24), st.integers(2, 24)), fill=st.just(True)))
@settings(max_examples=60)
def test_a_turned_map_has_the_same_segments(turn: str, free: np.ndarray) -> None:
    assert_turned_alike(grid_of(free, 0.6), turn)


def test_cells_between_equal_rooms_belong_to_neither() -> None:
    """Any choice would depend on how the map is turned."""
    found = Segmentation.of(grid_of(two_rooms(wall=5)))
    raster = found.scales[0].raster()
    assert (raster[18:25, 43] == -1).all() and (raster[18:25, [42, 44]] >= 0).all()
    assert len(found.scales[0].openings) == 1
    unequal = Segmentation.of(grid_of(two_rooms(wall=5, right=44))).scales[0].raster()
    assert (unequal[18:25, 43] == unequal[21, 60]).all()


@pytest.mark.real_data
@pytest.mark.parametrize("name", REAL)
@pytest.mark.parametrize("turn", TURNS)
def test_turned_real_maps_have_the_same_segments(name: str, turn: str) -> None:
    assert_turned_alike(load_map(real_data_folder(name) / "map.yaml").grid, turn)


# ------------------------------------------------------------------ tilted and coarser: nearly


def area_matched(one: np.ndarray, other: np.ndarray) -> float:
    """Share of cells whose segments in the two divisions overlap most with each other."""
    kept = (one >= 0) & (other >= 0)
    table = np.zeros((one.max() + 1, other.max() + 1), np.int64)
    np.add.at(table, (one[kept], other[kept]), 1)
    rows, columns = table.argmax(axis=1), table.argmax(axis=0)
    mutual = columns[rows] == np.arange(len(rows))
    return float(table[np.flatnonzero(mutual), rows[mutual]].sum() / kept.sum())


@pytest.mark.real_data
@pytest.mark.parametrize("name", REAL)
@pytest.mark.parametrize(("resolution_m", "share"), [(0.1, 0.9), (0.2, 0.83)])
def test_coarser_maps_have_nearly_the_same_segments(
    name: str, resolution_m: float, share: float
) -> None:
    grid = load_map(real_data_folder(name) / "map.yaml").grid
    coarse = coarsen(grid, resolution_m)
    cells = np.argwhere(grid.free)
    there = cells // round(resolution_m / grid.resolution_m)
    before, after = Segmentation.of(grid).scales, Segmentation.of(coarse).scales
    matched = [area_matched(a.at(cells), b.at(there)) for a, b in zip(before, after, strict=True)]
    assert min(matched) > share
