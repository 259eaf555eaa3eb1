"""Ranges that a laser would read, from every free cell of a map or from poses of a robot.

Ranges are exact: the distance to the point where the ray enters the first blocked cell. Blocked are
occupied cells, unknown cells where the sensor stops at them, and everything outside the map.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array
from pgm_places._threads import run_tasks
from pgm_places.errors import InputError
from pgm_places.grid import OccupancyGrid
from pgm_places.sensing._beams import Beams
from pgm_places.sensing.sensor import Sensor

__all__ = ["ScanBlock", "cast_cells", "cast_poses", "iter_cast"]

OnProgress = Callable[[float], object]
"""Called with the fraction that is done, 0 to 1."""

_POSES_PER_TASK = 256


@dataclass(frozen=True, eq=False)
class ScanBlock:
    """Scans of some of a map's cells.

    Parameters
    ----------
    nodes : (n,) int64
        Node numbers of the cells, as in ``LabelGraph.from_grid`` with the same mask; increasing.
    ranges : (n, n_beams) float32
        Ranges in metres.
    """

    nodes: NDArray[np.int64]
    ranges: NDArray[np.float32]


def cast_cells(
    grid: OccupancyGrid,
    sensor: Sensor,
    *,
    mask: ArrayLike | None = None,
    n_threads: int | None = None,
    on_progress: OnProgress | None = None,
) -> NDArray[np.float32]:
    """(N, n_beams) ranges in metres from the centres of the N free cells.

    Parameters
    ----------
    grid : OccupancyGrid
        Beam angles are in the grid's own frame; its yaw does not matter.
    sensor : Sensor
        Beams, reach and noise.
    mask : (H, W) bool, optional
        Cast only from the free cells inside it.
    n_threads : int, optional
        Any number gives the same bits.
    on_progress : callable, optional
        Called with the fraction done, from 0 to 1.

    Rows are in the node order of ``LabelGraph.from_grid(grid, mask=mask)``: row-major from the
    bottom row. The result takes ``4 * N * n_beams`` bytes; :func:`iter_cast` bounds that.

    Examples
    --------
    >>> grid = OccupancyGrid([[0, 0, 0, 100]], resolution_m=0.1)
    >>> cast_cells(grid, Sensor(n_beams=4)).round(2)
    array([[0.25, 0.05, 0.05, 0.05],
           [0.15, 0.05, 0.15, 0.05],
           [0.05, 0.05, 0.25, 0.05]], dtype=float32)
    """
    wanted = _wanted(grid, mask)
    total = int(wanted.sum())
    ranges = np.empty((total, sensor.n_beams), np.float32)
    for block in iter_cast(grid, sensor, mask=mask, n_threads=n_threads, on_progress=on_progress):
        ranges[block.nodes] = block.ranges
    return ranges


def iter_cast(
    grid: OccupancyGrid,
    sensor: Sensor,
    *,
    mask: ArrayLike | None = None,
    memory_bytes: int = 256 * 2**20,
    n_threads: int | None = None,
    on_progress: OnProgress | None = None,
) -> Iterator[ScanBlock]:
    """The same ranges as :func:`cast_cells`, block by block, in bounded memory.

    A block's arrays are reused for the next block: use or copy them before going on.
    """
    wanted = _wanted(grid, mask)
    rows, columns = np.nonzero(wanted)
    blocked = _blocked(grid, sensor.stop_at_unknown)
    size = max(1, memory_bytes // (4 * sensor.n_beams))
    for start in range(0, len(rows), size):
        nodes = np.arange(start, min(start + size, len(rows)))
        ranges = np.empty((len(nodes), sensor.n_beams), np.float32)
        _cast_block(
            blocked, rows[nodes], columns[nodes], grid.resolution_m, sensor, ranges, n_threads
        )
        if on_progress is not None:
            on_progress((int(nodes[-1]) + 1) / len(rows))
        yield ScanBlock(nodes, ranges)


def _cast_block(
    blocked: NDArray[np.uint8],
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    resolution_m: float,
    sensor: Sensor,
    ranges: NDArray[np.float32],
    n_threads: int | None,
) -> None:
    from pgm_places.sensing._dda_kernels import dda_from_centres
    from pgm_places.sensing._noise_kernels import add_noise

    beams = Beams.full_circle(sensor.n_beams)
    with np.errstate(divide="ignore"):
        per_x, per_y = 1 / beams.along_x, 1 / beams.along_y
    metres_x = (resolution_m * per_x).astype(np.float32)
    metres_y = (resolution_m * per_y).astype(np.float32)
    reach = np.float32(sensor.max_range_m)
    noise = sensor.noise

    def cast(task: int) -> None:
        part = slice(task * _POSES_PER_TASK, (task + 1) * _POSES_PER_TASK)
        dda_from_centres(
            blocked, rows[part] + 1, columns[part] + 1, beams.step_x, beams.step_y, per_x, per_y,
            metres_x, metres_y, sensor.max_range_m / resolution_m, reach, ranges[part],
        )  # fmt: skip
        if noise is not None and not noise.is_silent:
            add_noise(
                ranges[part], rows[part], columns[part], noise.seed & 0xFFFFFFFF, noise.seed >> 32,
                float(noise.sigma_m), float(noise.p_random), float(noise.p_max), float(reach),
            )  # fmt: skip

    run_tasks(cast, -(-len(rows) // _POSES_PER_TASK), n_threads=n_threads)


def cast_poses(
    grid: OccupancyGrid,
    poses: ArrayLike,
    angles_rad: ArrayLike,
    *,
    max_range_m: float,
    stop_at_unknown: bool = True,
    n_threads: int | None = None,
) -> NDArray[np.float32]:
    """(P, M) ranges in metres from P poses along M angles.

    Parameters
    ----------
    grid : OccupancyGrid
        Its origin and yaw place it in the map frame.
    poses : (P, 3) float
        x, y in metres and heading in radians, in the map frame.
    angles_rad : (M,) float
        Beam angles against the heading, counter-clockwise.
    max_range_m : float
        Longest distance reported.
    stop_at_unknown : bool
        Whether a ray ends where it enters unknown space.
    n_threads : int, optional
        Any number gives the same bits.

    A pose inside a blocked cell or outside the map reads 0 along every beam.

    Raises
    ------
    InputError
        Poses or angles have the wrong shape or are not finite, or the range is not positive.

    Examples
    --------
    >>> grid = OccupancyGrid([[0, 0, 0, 100]], resolution_m=0.1)
    >>> cast_poses(grid, [[0.12, 0.05, 0.0]], [0.0, 3.141592653589793], max_range_m=5.0).round(2)
    array([[0.18, 0.12]], dtype=float32)
    """
    from pgm_places.sensing._dda_kernels import dda_from_poses

    poses = finite_array("poses", poses, ("P", 3))
    angles = np.ascontiguousarray(finite_array("angles_rad", angles_rad, ("M",)))
    reach = Sensor(1, max_range_m, stop_at_unknown).max_range_m
    blocked = _blocked(grid, stop_at_unknown)
    height, width = grid.shape
    cos, sin = np.cos(grid.yaw_rad), np.sin(grid.yaw_rad)
    offset = (poses[:, :2] - np.asarray(grid.origin_xy_m)) / grid.resolution_m
    cells = offset @ np.array([[cos, -sin], [sin, cos]])  # turned back by the grid's yaw
    # Positions off the map are put on the blocked rim, where they read 0.
    x = np.clip(cells[:, 0], -1.0, width) + 1.0
    y = np.clip(cells[:, 1], -1.0, height) + 1.0
    headings = poses[:, 2] - grid.yaw_rad
    ranges = np.empty((len(poses), len(angles)), np.float32)

    def cast(task: int) -> None:
        part = slice(task * _POSES_PER_TASK, (task + 1) * _POSES_PER_TASK)
        dda_from_poses(
            blocked,
            x[part],
            y[part],
            headings[part],
            angles,
            grid.resolution_m,
            reach / grid.resolution_m,
            np.float32(reach),
            ranges[part],
        )

    run_tasks(cast, -(-len(poses) // _POSES_PER_TASK), n_threads=n_threads)
    return ranges


def _wanted(grid: OccupancyGrid, mask: ArrayLike | None) -> NDArray[np.bool_]:
    if mask is None:
        return grid.free
    chosen = np.asarray(mask)
    if chosen.dtype != np.bool_:
        raise InputError(f"mask must be boolean, got dtype {chosen.dtype}")
    if chosen.shape != grid.shape:
        raise InputError(f"mask must have the map's shape {grid.shape}, got {chosen.shape}")
    return grid.free & chosen


def _blocked(grid: OccupancyGrid, stop_at_unknown: bool) -> NDArray[np.uint8]:
    """(H + 2, W + 2) ones where rays end, with a blocked rim for the map's edge."""
    blocked = np.ones((grid.shape[0] + 2, grid.shape[1] + 2), np.uint8)
    blocked[1:-1, 1:-1] = ~grid.free if stop_at_unknown else grid.occupied
    return blocked
