import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pgm_places import LabelGraph, OccupancyGrid, Sensor
from pgm_places.errors import InputError
from pgm_places.kernels.threads import thread_limit
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN
from pgm_places.sensing.ray_casting import cast_cells, cast_poses
from tests.reference import casting as reference
from tests.refusals import refused

MILLICELL = 1e-3


def random_grid(
    seed: int, shape: tuple[int, int], *, occupied: float = 0.1, unknown: float = 0.05
) -> OccupancyGrid:
    kinds = np.random.default_rng(seed).random(shape)
    cells = np.where(kinds < occupied, OCCUPIED, np.where(kinds > 1 - unknown, UNKNOWN, FREE))
    return OccupancyGrid(cells, resolution_m=1.0)


def assert_same_ranges(got: NDArray[Any], expected: NDArray[Any], resolution_m: float) -> None:
    assert got.dtype == np.float32
    assert got.shape == expected.shape
    np.testing.assert_allclose(got, expected, rtol=1e-6, atol=MILLICELL * resolution_m)


@given(
    height=st.integers(1, 9),
    width=st.integers(1, 9),
    n_beams=st.integers(3, 24),
    occupied=st.floats(0, 0.9),
    stop_at_unknown=st.booleans(),
    max_range_m=st.floats(0.3, 12.0),
    seed=st.integers(0, 2**32 - 1),
)
@settings(max_examples=60, deadline=None)
def test_small_maps_of_all_kinds(
    height: int,
    width: int,
    n_beams: int,
    occupied: float,
    stop_at_unknown: bool,
    max_range_m: float,
    seed: int,
) -> None:
    grid = random_grid(seed, (height, width), occupied=occupied, unknown=0.1)
    sensor = Sensor(n_beams, max_range_m, stop_at_unknown)
    expected = reference.cast_cells(
        grid, n_beams, max_range_m=max_range_m, stop_at_unknown=stop_at_unknown
    )
    assert_same_ranges(cast_cells(grid, sensor), expected, 1.0)


def test_rays_through_a_corner_step_along_x_first() -> None:
    cells = np.zeros((3, 3), np.int8)
    cells[1, 2] = OCCUPIED  # to the right of the centre; the diagonal beam enters it first
    beside_x = cast_cells(OccupancyGrid(cells, 1.0), Sensor(n_beams=8), mask=_only(1, 1, (3, 3)))
    beside_y = cast_cells(OccupancyGrid(cells.T, 1.0), Sensor(n_beams=8), mask=_only(1, 1, (3, 3)))
    assert beside_x[0, 1] == pytest.approx(np.sqrt(0.5), rel=1e-6)
    assert beside_y[0, 1] == pytest.approx(3 * np.sqrt(0.5), rel=1e-6)


def _only(row: int, column: int, shape: tuple[int, int]) -> NDArray[np.bool_]:
    mask = np.zeros(shape, np.bool_)
    mask[row, column] = True
    return mask


def test_rows_are_in_the_graph_s_order_and_the_mask_chooses_among_them() -> None:
    grid = random_grid(7, (20, 30))
    mask = np.random.default_rng(8).random(grid.shape) < 0.3
    everywhere = cast_cells(grid, Sensor(n_beams=16))
    chosen = cast_cells(grid, Sensor(n_beams=16), mask=mask)
    np.testing.assert_array_equal(chosen, everywhere[mask[grid.free]])
    graph = LabelGraph.from_grid(grid, mask=mask)
    assert len(chosen) == graph.n_nodes


@pytest.mark.parametrize("n_threads", [2, 3, 16])
@pytest.mark.parametrize("occupied", [0.01, 0.3])
def test_any_number_of_threads_gives_the_same_bits(n_threads: int, occupied: float) -> None:
    grid = random_grid(9, (60, 70), occupied=occupied)
    poses = np.random.default_rng(5).uniform(0, 60, (700, 3))

    def ranges(count: int) -> tuple[NDArray[Any], NDArray[Any]]:
        with thread_limit(count):
            cells = cast_cells(grid, Sensor(n_beams=90))
            return cells, cast_poses(grid, poses, np.linspace(-1, 1, 9), max_range_m=9.0)

    for one, many in zip(ranges(1), ranges(n_threads), strict=True):
        np.testing.assert_array_equal(many, one)


def test_the_map_is_left_alone_and_a_map_without_free_cells_has_no_scans() -> None:
    grid = OccupancyGrid(np.full((4, 5), OCCUPIED, np.int8), resolution_m=0.1)
    assert cast_cells(grid, Sensor(n_beams=5)).shape == (0, 5)


@pytest.mark.parametrize(
    ("mask", "message"),
    [
        (
            np.ones((2, 3), np.bool_),
            r"the map's shape \(3, 2\), got \(2, 3\); transpose it: mask.T",
        ),
        (np.ones((3, 2)), "mask must be boolean, got dtype float64"),
    ],
)
def test_a_wrong_mask_is_refused(mask: NDArray[Any], message: str) -> None:
    grid = OccupancyGrid(np.zeros((3, 2), np.int8), resolution_m=1.0)
    refused(InputError, message, cast_cells, grid, Sensor(n_beams=4), mask=mask)


# ------------------------------------------------------------------ poses


@given(
    seed=st.integers(0, 2**32 - 1),
    yaw_rad=st.floats(-4, 4),
    heading_rad=st.floats(-7, 7),
    stop_at_unknown=st.booleans(),
)
@settings(max_examples=40, deadline=None)
def test_poses_read_what_following_the_ray_reads(
    seed: int, yaw_rad: float, heading_rad: float, stop_at_unknown: bool
) -> None:
    rng = np.random.default_rng(seed)
    cells = random_grid(seed, (8, 9), occupied=0.2).cells
    grid = OccupancyGrid(cells, 0.25, (3.0, -1.0), yaw_rad)
    local = rng.uniform((-1, -1), (10, 9), (5, 2))  # some lie outside the map
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    xy = 0.25 * local @ np.array([[cos, sin], [-sin, cos]]) + (3.0, -1.0)
    poses, angles = np.column_stack((xy, np.full(5, heading_rad))), np.linspace(-2, 2, 7)
    options: dict[str, Any] = {"max_range_m": 1.5, "stop_at_unknown": stop_at_unknown}
    ways = [(np.cos(a), np.sin(a)) for a in heading_rad + angles - yaw_rad]
    wanted = [[reference.cast_ray(grid, x, y, way, **options) for way in ways] for x, y in local]
    assert_same_ranges(cast_poses(grid, poses, angles, **options), np.array(wanted), 0.25)


@pytest.mark.parametrize("yaw", [0.0, 0.3])
@pytest.mark.parametrize("far", [5.0, 1e9, 1e18, -1e19, 1e300, 1e308])
def test_a_pose_in_a_wall_or_off_the_map_reads_nothing(yaw: float, far: float) -> None:
    grid = OccupancyGrid(np.array([[FREE, OCCUPIED]], np.int8), 1.0, (0.0, 0.0), yaw)
    poses = [[1.5, 0.5, 0.0], [far, far, 0.0], [far, 0.5, far], [0.5, far, 0.0], [far, -far, 0.0]]
    poses[0][:2] = grid.cell_centres_m([[0, 1]])[0].tolist()
    assert not cast_poses(grid, poses, [0.0, 1.0], max_range_m=5.0).any()


@pytest.mark.parametrize(
    ("poses", "angles", "max_range_m", "message"),
    [
        ([[0.0, 0.0]], [0.0], 1.0, "poses must have shape (P, 3), got (1, 2)"),
        ([[0.0, 0.0, np.nan]], [0.0], 1.0, "poses must hold finite numbers, got nan"),
        ([[0.0, 0.0, 0.0]], [[0.0]], 1.0, "angles_rad must have shape (M,), got (1, 1)"),
        ([[0.0, 0.0, 0.0]], [0.0], 0.0, "max_range_m must be a number above 0, got 0"),
    ],
)
def test_wrong_poses_are_refused(
    poses: list[Any], angles: list[Any], max_range_m: float, message: str
) -> None:
    grid = OccupancyGrid(np.array([[FREE]], np.int8), 1.0)
    options = {"max_range_m": max_range_m}
    refused(InputError, re.escape(message), cast_poses, grid, poses, angles, **options)
