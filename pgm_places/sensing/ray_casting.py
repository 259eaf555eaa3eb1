"""Ray casting: simulated ranges from every free cell of a map, or from poses.

Ranges are exact: the distance to the point where the ray enters the first blocked cell. Blocked are
occupied cells, unknown cells if the sensor stops at them, and everything outside the map.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array, require_shape
from pgm_places._core import dda_from_poses
from pgm_places.errors import InputError
from pgm_places.kernels.threads import run_parts
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.sensing._cell_caster import Box, CellCaster, NodeNumbers, blocked_window, tiles
from pgm_places.sensing.sensor import Sensor

_POSES_PER_TASK = 256
_WORKING_BYTES = 256 * 2**20
_BYTES_OF_CELL = 48  # lists of a block's cells


@dataclass(frozen=True, eq=False)
class ScanBlock:
    """Scans of some of a map's cells."""

    # (n,) node numbers of the cells, as in ``LabelGraph.from_grid`` with the same mask; increasing
    nodes: NDArray[np.int64]
    ranges: NDArray[np.float32]  # (n, n_beams) ranges in metres


def cast_cells(
    grid: OccupancyGrid, sensor: Sensor, *, mask: ArrayLike | None = None
) -> NDArray[np.float32]:
    """(N, n_beams) ranges in metres from the centres of the N free cells.

    ``grid``: beam angles are in the grid's own frame; its yaw does not matter. ``sensor``: beams,
    reach and noise. ``mask`` (H, W): cast only from the free cells inside it.

    Examples
    --------
    >>> grid = OccupancyGrid([[0, 0, 0, 100]], resolution_m=0.1)
    >>> cast_cells(grid, Sensor(n_beams=4)).round(2)
    array([[0.25, 0.05, 0.05, 0.05],
           [0.15, 0.05, 0.15, 0.05],
           [0.05, 0.05, 0.25, 0.05]], dtype=float32)
    """
    caster = CellCaster(grid, sensor)
    wanted = _wanted(grid, mask)
    numbers = NodeNumbers(wanted)
    ranges = np.empty((numbers.total, sensor.n_beams), np.float32)

    def capacity(box: Box) -> int:
        return (_WORKING_BYTES - caster.bytes_beside_scans(box)) // _BYTES_OF_CELL

    for box in tiles(wanted, capacity):
        nodes, rows, columns = numbers.of(box)
        caster.cast(box, rows, columns, nodes.astype(np.int32), ranges)
    return ranges


def iter_cast(
    grid: OccupancyGrid,
    sensor: Sensor,
    *,
    mask: ArrayLike | None = None,
    memory_bytes: int = _WORKING_BYTES,
) -> Iterator[ScanBlock]:
    """Scans of all cells in blocks, with the same bits as :func:`cast_cells`.

    ``grid``, ``sensor``, ``mask``: as in :func:`cast_cells`. ``memory_bytes``: maximum memory,
    besides the map and the mask, for a block and its computation. Larger blocks are faster: the
    surroundings within reach are processed again for each block.

    Yields ScanBlock: blocks of rectangles of the map, in no particular order; each node is in one
    block. The next block overwrites a block's ranges: use or copy them before.

    InputError: the memory does not suffice for a single cell and the region within its reach.

    Examples
    --------
    >>> grid = OccupancyGrid([[0, 0, 0, 100]], resolution_m=0.1)
    >>> for block in iter_cast(grid, Sensor(n_beams=4)):
    ...     print(block.nodes, block.ranges[:, 0].round(2))
    [0 1 2] [0.25 0.15 0.05]
    """
    caster = CellCaster(grid, sensor)
    wanted = _wanted(grid, mask)
    return _blocks(caster, wanted, sensor.n_beams, int(memory_bytes))


def _blocks(
    caster: CellCaster, wanted: NDArray[np.bool_], n_beams: int, memory_bytes: int
) -> Iterator[ScanBlock]:
    bytes_of_scan = 4 * n_beams + _BYTES_OF_CELL

    def capacity(box: Box) -> int:
        return (memory_bytes - caster.bytes_beside_scans(box)) // bytes_of_scan

    numbers = NodeNumbers(wanted)
    boxes = list(tiles(wanted, capacity))
    most = 0
    for box in boxes:
        most = max(most, int(np.count_nonzero(wanted[box.slices])))
        if capacity(box) < 1:
            least = caster.bytes_beside_scans(box) + bytes_of_scan
            raise InputError(
                f"memory_bytes must be at least {least} for this map, reach and number of threads, "
                f"got {memory_bytes}"
            )
    buffer = np.empty(most * n_beams, np.float32)
    for box in boxes:
        nodes, rows, columns = numbers.of(box)
        ranges = buffer[: len(nodes) * n_beams].reshape(len(nodes), n_beams)
        caster.cast(box, rows, columns, np.arange(len(nodes), dtype=np.int32), ranges)
        yield ScanBlock(nodes, ranges)


class _CellPoses(NamedTuple):
    """Poses of scans, in cells."""

    x: NDArray[np.float64]  # (P,); the cell that holds (x, y) is [floor y, floor x]
    y: NDArray[np.float64]  # (P,)
    headings_rad: NDArray[np.float64]  # (P,)


def cast_poses(
    grid: OccupancyGrid,
    poses: ArrayLike,
    angles_rad: ArrayLike,
    *,
    max_range_m: float,
    stop_at_unknown: bool = True,
) -> NDArray[np.float32]:
    """(P, M) ranges in metres from P poses along M angles.

    Parameters
    ----------
    grid : OccupancyGrid
        The map, positioned in the map frame by its origin and yaw.
    poses : (P, 3) float
        x, y in metres and heading in radians, in the map frame.
    angles_rad : (M,) float
        Beam angles against the heading, counter-clockwise.
    max_range_m : float
        Longest distance reported.
    stop_at_unknown : bool
        Whether a ray ends where it enters unknown space.

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
    caster = PoseCaster(grid, stop_at_unknown=stop_at_unknown)
    return caster.cast(poses, angles_rad, max_range_m=max_range_m)


class PoseCaster:
    """Casts from poses in a map that is prepared once, for repeated calls.

    ``grid``, ``stop_at_unknown``: as in :func:`cast_poses`.
    """

    def __init__(self, grid: OccupancyGrid, *, stop_at_unknown: bool = True) -> None:
        height, width = grid.shape
        self._grid = grid
        self._blocked = blocked_window(grid, Box(0, height, 0, width), stop_at_unknown)

    def cast(
        self, poses: ArrayLike, angles_rad: ArrayLike, *, max_range_m: float
    ) -> NDArray[np.float32]:
        """(P, M) ranges in metres; arguments as in :func:`cast_poses`."""
        grid = self._grid
        poses = finite_array("poses", poses, ("P", 3))
        angles = np.ascontiguousarray(finite_array("angles_rad", angles_rad, ("M",)))
        reach = Sensor(max_range_m=max_range_m).max_range_m
        height, width = grid.shape
        cos, sin = np.cos(grid.yaw_rad), np.sin(grid.yaw_rad)
        # A position so far away along x or y is off the map for any yaw.
        far = 2.0 * (height + width)
        with np.errstate(over="ignore"):
            offset = (poses[:, :2] - np.asarray(grid.origin_xy_m)) / grid.resolution_m
        offset = np.clip(offset, -far, far)
        cells = offset @ np.array([[cos, -sin], [sin, cos]])  # turned back by the grid's yaw
        # Positions off the map are moved to the blocked rim, where ranges are 0.
        x = np.clip(cells[:, 0], -1.0, width) + 1.0
        y = np.clip(cells[:, 1], -1.0, height) + 1.0
        headings = poses[:, 2] - grid.yaw_rad
        ranges = np.empty((len(poses), len(angles)), np.float32)

        def cast(part: slice) -> None:
            dda_from_poses(
                self._blocked,
                _CellPoses(x[part], y[part], headings[part]),
                angles,
                grid.resolution_m,
                reach / grid.resolution_m,
                np.float32(reach),
                ranges[part],
            )

        run_parts(cast, len(poses), _POSES_PER_TASK)
        return ranges


def _wanted(grid: OccupancyGrid, mask: ArrayLike | None) -> NDArray[np.bool_]:
    if mask is None or mask is grid.free:
        return grid.free
    chosen = np.asarray(mask)
    if chosen.dtype != np.bool_:
        raise InputError(f"mask must be boolean, got dtype {chosen.dtype}")
    require_shape("mask", chosen.shape, grid.shape, of="the map's")
    return grid.free & chosen
