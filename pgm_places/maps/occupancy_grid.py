"""The occupancy grid: free, occupied and unknown cells, with resolution, origin and yaw."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places import plotting
from pgm_places._arguments import public_raising
from pgm_places._checks import freeze, number_array, set_frozen
from pgm_places.errors import InputError, MapError
from pgm_places.plotting import Plotted, axes_or_new

if TYPE_CHECKING:
    from matplotlib.axes import Axes


from typing import TypeVar

_RESOLUTIONS_M = (1e-6, 1e3)
_FARTHEST = 1e9
FREE = 0
OCCUPIED = 100
UNKNOWN = -1


def check_resolution(resolution_m: float) -> None:
    """Refuse a cell size that is not between a micrometre and a kilometre."""
    low, high = _RESOLUTIONS_M
    if not low <= resolution_m <= high:
        raise MapError(
            f"resolution_m must be positive metres per cell, from {low:g} to {high:g}, got "
            f"{resolution_m:g}"
        )


@public_raising(MapError)
@dataclass(frozen=True, eq=False)
class OccupancyGrid(Plotted):
    """A 2-D map of cells.

    Parameters
    ----------
    cells : (H, W) int8
        ``FREE`` (0), ``OCCUPIED`` (100) or ``UNKNOWN`` (-1). Row 0 is the bottom of the map (the
        smallest y), column 0 its left: the order of ROS, which is upside down as an image.
    resolution_m : float
        Side of a cell in metres.
    origin_xy_m : (float, float)
        Position of the lower-left corner of cell (0, 0) in the map frame.
    yaw_rad : float
        Rotation of the grid about its origin, counter-clockwise.

    Examples
    --------
    >>> grid = OccupancyGrid([[0, 0], [100, -1]], resolution_m=0.5)
    >>> grid.shape, int(grid.free.sum())
    ((2, 2), 2)
    >>> grid.cell_centres_m([[1, 0]]).tolist()
    [[0.25, 0.75]]
    """

    cells: NDArray[np.int8]
    resolution_m: float
    origin_xy_m: tuple[float, float] = (0.0, 0.0)
    yaw_rad: float = 0.0

    def __post_init__(self) -> None:
        cells = np.asarray(self.cells)
        if cells.ndim != 2 or cells.size == 0:
            raise MapError(f"cells must be a 2-D array with at least one cell, got {cells.shape}")
        known = (cells == FREE) | (cells == OCCUPIED) | (cells == UNKNOWN)
        if not known.all():
            row, column = np.argwhere(~known)[0]
            raise MapError(
                f"cells must be {FREE} (free), {OCCUPIED} (occupied) or {UNKNOWN} (unknown), got "
                f"{cells[row, column]} at row {row}, column {column}"
            )
        check_resolution(self.resolution_m)
        pose = (*self.origin_xy_m, self.yaw_rad)
        if len(pose) != 3 or not (np.abs(pose) <= _FARTHEST).all():
            raise MapError(
                f"origin_xy_m and yaw_rad must be three finite numbers up to {_FARTHEST:g}, got "
                f"{pose}"
            )
        x, y, yaw = map(float, pose)
        set_frozen(self, resolution_m=float(self.resolution_m), origin_xy_m=(x, y), yaw_rad=yaw)
        set_frozen(self, cells=cells.astype(np.int8, copy=False))

    def __repr__(self) -> str:
        height, width = self.shape
        return (
            f"OccupancyGrid({height} x {width} cells of {self.resolution_m:g} m, "
            f"{100 * self.free.mean():.1f} % free)"
        )

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return (self.cells.shape[0], self.cells.shape[1])

    @cached_property
    def free(self) -> NDArray[np.bool_]:
        """(H, W) mask of the free cells."""
        return freeze(self.cells == FREE)

    @property
    def occupied(self) -> NDArray[np.bool_]:
        """(H, W) mask of the occupied cells, not cached, to save memory."""
        return freeze(self.cells == OCCUPIED)

    @cached_property
    def unknown(self) -> NDArray[np.bool_]:
        """(H, W) mask of the unknown cells."""
        return freeze(self.cells == UNKNOWN)

    @property
    def corners_m(self) -> NDArray[np.float64]:
        """(4, 2) map-frame positions of the corners of the map."""
        return self.cell_centres_m(np.indices((2, 2)).reshape(2, 4).T * self.shape - 0.5)

    def cell_centres_m(self, cells_rc: ArrayLike) -> NDArray[np.float64]:
        """(N, 2) map-frame positions of the centres of cells given as (row, column)."""
        cells = _pairs("cells_rc", cells_rc)
        local = (cells[:, ::-1] + 0.5) * self.resolution_m
        return local @ self._rotation.T + np.asarray(self.origin_xy_m)

    def cells_at_m(self, positions_m: ArrayLike) -> NDArray[np.int64]:
        """(N, 2) row and column of the cells that hold map-frame positions; may lie outside."""
        rows_columns = self.points_at_m(positions_m)[:, ::-1]
        farthest = 2.0**40  # cells, beyond every map
        return np.floor(rows_columns).clip(-farthest, farthest).astype(np.int64)

    def points_at_m(self, positions_m: ArrayLike) -> NDArray[np.float64]:
        """(N, 2) map-frame positions, x before y, in cells from the corner of the raster."""
        offset = _pairs("positions_m", positions_m) - np.asarray(self.origin_xy_m)
        return np.asarray(offset @ self._rotation / self.resolution_m)

    @property
    def _rotation(self) -> NDArray[np.float64]:
        cos, sin = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        return np.array([[cos, -sin], [sin, cos]])

    @property
    def frame(self) -> plotting.Frame:
        """The position of the raster in the map frame."""
        return plotting.Frame(self.resolution_m, self.origin_xy_m, self.yaw_rad)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw walls, unknown and free cells, in metres of the map frame, on ``ax`` or new axes."""
        ax = axes_or_new(ax)
        plotting.draw_ground(ax, self.cells, self.frame)
        return ax

    def with_cells(self, cells: ArrayLike) -> Self:
        """A grid with other cells (H, W) in the same frame."""
        return type(self)(np.asarray(cells), self.resolution_m, self.origin_xy_m, self.yaw_rad)


def _pairs(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """(N, 2) numbers; a single pair may have shape (2,)."""
    array = number_array(name, values)
    if not array.size:
        return np.zeros((0, 2))
    if array.ndim not in (1, 2) or array.shape[-1] != 2:
        raise InputError(f"{name} must have shape (N, 2), got {array.shape}")
    return array.reshape(-1, 2)


def at_cells(raster: NDArray[Any], cells_rc: NDArray[np.int64], outside: Any) -> NDArray[Any]:
    """(N,) the values of a raster (H, W) at cells (N, 2); ``outside`` beyond the raster.

    Examples
    --------
    >>> at_cells(np.array([[1, 2]]), np.array([[0, 1], [1, 1]]), 0).tolist()
    [2, 0]
    """
    inside = ((cells_rc >= 0) & (cells_rc < raster.shape)).all(axis=1)
    values = np.full(len(cells_rc), outside, raster.dtype)
    values[inside] = raster[tuple(cells_rc[inside].T)]
    return values


T = TypeVar("T", bound=np.generic)
Window = tuple[slice, ...]
Shift = tuple[int, int] | NDArray[np.int64]
"""Offset in rows and columns from a cell in one raster to the same cell in the other."""

_SAME_CELL = 1e-3
"""Tolerance, in cells, of origins that differ by a whole number of cells."""


def raster_shift(old: OccupancyGrid, new: OccupancyGrid) -> NDArray[np.int64] | None:
    """(2,) shift in rows and columns from the old map to the new; None if not whole cells."""
    if old.resolution_m != new.resolution_m or old.yaw_rad != new.yaw_rad:
        return None
    [columns_rows] = new.points_at_m([old.origin_xy_m])
    rounded = np.rint(columns_rows)
    if np.abs(columns_rows - rounded).max() > _SAME_CELL:
        return None
    return rounded[::-1].astype(np.int64)


def overlap(shift: Shift, before: tuple[int, ...], after: tuple[int, ...]) -> tuple[Window, Window]:
    """The overlap of two charts, as a window of the old and a window of the new."""
    low = np.maximum(shift, 0)
    high = np.maximum(np.minimum(np.add(shift, before), after), low)
    there = tuple(map(slice, low.tolist(), high.tolist()))
    here = tuple(map(slice, (low - shift).tolist(), (high - shift).tolist()))
    return here, there


def shifted(raster: NDArray[T], shift: Shift, shape: tuple[int, ...], fill: int) -> NDArray[T]:
    """(H, W) a raster shifted onto another shape, with ``fill`` outside its old extent."""
    moved = np.full(shape, fill, raster.dtype)
    here, there = overlap(shift, raster.shape, shape)
    moved[there] = raster[here]
    return moved
