"""LocalMap: a rolling occupancy map around the robot, from its recent scans."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array, pose_array
from pgm_places._core import cast_rays, coarse_cells, write_disc, write_scan
from pgm_places.errors import InputError
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, check_resolution
from pgm_places.options import AtLeastZero, AtLeastZeroOrInfinite, Positive, check_options

__all__ = ["LocalMap"]

HIT, MISS = 2, -1
"""Evidence of a beam's end and of a crossing, in log-odds steps of 0.4: the odds of being occupied
change by e^0.8 and e^-0.4 (probabilities 0.69 and 0.40 of an inverse sensor model)."""

LOWEST, HIGHEST = -5, 9
"""Bounds of a cell's evidence (log-odds -2 and 3.6): a door that opens is free after ten scans."""

SCAN_NUMBERS = 255
"""Scans between two resets of the numbers of scans that changed cells, which fit a byte."""

MOST_CELLS = 20_000
"""Longest side of the window in cells; larger ones are mistakes, such as a size in mm."""


# Distance in cells beyond every window, at which longer beams and radii are cut.
_FARTHEST = 2.0**40

_MOST_WHOLE = 2**31  # largest half side of a square, and largest factor, in cells


class Window(NamedTuple):
    """A rolling map's cells, each at its row and column modulo ``n``."""

    # (n, n) log-odds in steps; above 0 occupied, below 0 free, 0 unknown.
    evidence: NDArray[np.int8]
    seen: NDArray[np.uint8]  # (n, n) number of the scan that changed a cell last
    wrap_row: int  # storage index of the window's first row
    wrap_column: int  # storage index of the window's first column


class Pose(NamedTuple):
    """The pose of a scan, in cells from the window's corner."""

    x: float
    y: float
    heading_rad: float


@dataclass(eq=False)
class LocalMap:
    """Occupancy evidence in a square window that moves along with the robot.

    Every scan increases the log-odds of the cells in which its beams end and decreases those of
    the cells that they cross, once per cell and scan. The window moves without copying and drops
    the cells outside it, so that memory stays ``2 (size / resolution)^2`` bytes. For a robot with a
    forward laser, the map supplies the beams behind it (paper, section 4, Fig. 4).

    Examples
    --------
    >>> from math import pi
    >>> local = LocalMap(size_m=10.0, resolution_m=0.1)
    >>> ahead = np.linspace(-pi / 2, pi / 2, 181)
    >>> local.update([0.0, 0.0, 0.0], np.full(181, 2.0), ahead, max_range_m=30.0)
    >>> turned = [0.0, 0.0, pi]  # what lay ahead lies behind now
    >>> ranges, met = local.cast(turned, [pi], max_range_m=30.0)
    >>> bool(abs(ranges[0] - 2.0) <= 0.1), met.tolist()
    (True, [True])
    """

    size_m: Positive = 40.0  # side of the window in metres
    resolution_m: Positive = 0.05  # side of a cell in metres
    # cells within this distance of the laser are free, as the robot is there. 0 for none.
    robot_radius_m: AtLeastZero = 0.25
    # distance that a simulated ray may continue through unknown space; beyond it, the ray ends at
    # the start of that space. Distant beams are farther apart than cells, which leaves holes;
    # ``inf`` makes unknown space free.
    through_unknown_m: AtLeastZeroOrInfinite = 0.3
    _evidence: NDArray[np.int8] = field(init=False, repr=False)
    _seen: NDArray[np.uint8] = field(init=False, repr=False)
    _corner: NDArray[np.int64] | None = field(init=False, repr=False, default=None)
    _scan: int = field(init=False, repr=False, default=0)

    def __post_init__(self) -> None:
        check_options(self)
        check_resolution(self.resolution_m)
        n = round(self.size_m / self.resolution_m)
        if not 8 <= n <= MOST_CELLS:
            raise InputError(
                f"size_m / resolution_m must give 8 to {MOST_CELLS} cells, got "
                f"{self.size_m:g} / {self.resolution_m:g} = {n}"
            )
        self._evidence = np.zeros((n, n), np.int8)
        self._seen = np.zeros((n, n), np.uint8)

    @property
    def n_cells(self) -> int:
        """Cells along a side of the window."""
        return len(self._evidence)

    @property
    def n_bytes(self) -> int:
        """Memory of the window, which is constant."""
        return self._evidence.nbytes + self._seen.nbytes

    def clear(self) -> None:
        """Reset all cells to unknown."""
        self._evidence.fill(0)
        self._seen.fill(0)
        self._corner, self._scan = None, 0

    def update(
        self, pose: ArrayLike, ranges_m: ArrayLike, angles_rad: ArrayLike, *, max_range_m: float
    ) -> None:
        """Add a scan at a pose, after moving the window there.

        ``pose`` (3,): x, y in metres and heading in radians of the laser, in any fixed frame.
        ``ranges_m`` (M,): beam lengths. NaN, infinite, not positive, or at least ``max_range_m``:
        no return, which does not change the map. ``angles_rad`` (M,): beam angles against the
        heading, counter-clockwise. ``max_range_m``: the sensor's maximum range.

        InputError: pose or angles are not finite, the pose is more than 10^7 m away, shapes do not
        fit, or the range is not a positive number.
        """
        where = pose_array("pose", pose, (3,))
        self._move_to(where)
        self.write(where, ranges_m, angles_rad, max_range_m=max_range_m)

    def write(
        self, pose: ArrayLike, ranges_m: ArrayLike, angles_rad: ArrayLike, *, max_range_m: float
    ) -> None:
        """Add a scan without moving the window: for a fixed map, not around the robot.

        Arguments as in :meth:`update`, whose first call sets the window's position. Cells outside
        are ignored, and so are scans from outside.
        """
        where = pose_array("pose", pose, (3,))
        _check_reach(max_range_m, or_infinite=True)
        angles = np.ascontiguousarray(finite_array("angles_rad", angles_rad, ("M",)))
        ranges = np.asarray(ranges_m, np.float64)
        if ranges.shape != angles.shape:
            raise InputError(
                f"ranges_m must have one value per angle ({len(angles)}), got {ranges.shape}"
            )
        with np.errstate(invalid="ignore", over="ignore"):
            returned = (ranges > 0) & (ranges < max_range_m)
            lengths = np.minimum(np.where(returned, ranges / self.resolution_m, 0.0), _FARTHEST)
        x, y, window = self._place(where)
        steps = HIT, MISS, LOWEST, HIGHEST
        write_scan(window, Pose(x, y, float(where[2])), lengths, angles, steps, self._next_scan())
        if self.robot_radius_m > 0:
            radius = min(self.robot_radius_m / self.resolution_m, _FARTHEST)
            write_disc(window, x, y, radius, MISS)

    def cast(
        self, pose: ArrayLike, angles_rad: ArrayLike, *, max_range_m: float
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """(M,) simulated ranges in metres at a pose, and whether beams end at obstacles.

        ``pose`` (3,): as in :meth:`update`. ``angles_rad`` (M,): beam angles against the heading,
        counter-clockwise. ``max_range_m``: longest range returned, also where a ray meets nothing.
        """
        where = pose_array("pose", pose, (3,))
        _check_reach(max_range_m)
        angles = np.ascontiguousarray(finite_array("angles_rad", angles_rad, ("M",)))
        ranges, met = np.empty(len(angles)), np.empty(len(angles), np.bool_)
        x, y, window = self._place(where)
        limit = max_range_m / self.resolution_m
        through = self.through_unknown_m / self.resolution_m
        cast_rays(window, Pose(x, y, float(where[2])), angles, limit, through, ranges, met)
        return np.minimum(ranges * self.resolution_m, max_range_m), met

    def to_grid(self) -> OccupancyGrid:
        """The window as a map: evidence above 0 is occupied, below 0 free, 0 unknown."""
        return self._cut(np.zeros(2, np.int64), np.full(2, self.n_cells), 1)

    def square(self, centre_m: ArrayLike, n_cells: int, factor: int) -> OccupancyGrid | None:
        """A coarsened square of the window as a map; None outside the window.

        A coarse cell is occupied if any of its cells is, else free if any is, else unknown. This
        equals :meth:`to_grid`, cropped and coarsened, without a copy of the window.

        ``centre_m`` (2,): x and y of the middle, in the frame of the poses. ``n_cells``: half the
        side of the square, in cells of the window; clipped to the window. ``factor``: cells of the
        window along the side of a coarse cell.

        InputError: the position is not finite or more than 10^7 m away, or a number is not an
        integer.
        """
        _check_whole("n_cells", n_cells, 0)
        _check_whole("factor", factor, 1)
        offset = pose_array("centre_m", centre_m, (2,)) - self._origin_m
        middle = np.floor(offset / self.resolution_m).astype(np.int64)
        low = np.maximum(middle - n_cells, 0)
        high = np.minimum(middle + n_cells, self.n_cells)
        return self._cut(low, high, factor) if (low < high).all() else None

    def _cut(self, low: NDArray[np.int64], high: NDArray[np.int64], factor: int) -> OccupancyGrid:
        """The window's cells from one corner to before another, coarsened by a factor."""
        cells = np.empty(-(-(high - low)[::-1] // factor), np.int8)
        window = self._place(self._origin_m)[2]
        begin, end = (low[1], low[0]), (high[1], high[0])
        coarse_cells(window, begin, end, factor, (OCCUPIED, FREE, UNKNOWN), cells)
        x, y = low * self.resolution_m + self._origin_m
        return OccupancyGrid(cells, factor * self.resolution_m, (float(x), float(y)))

    @property
    def _origin_m(self) -> NDArray[np.float64]:
        """(2,) the window's corner; set by the first scan."""
        corner = np.zeros(2) if self._corner is None else self._corner
        return np.asarray(corner * self.resolution_m, np.float64)

    def _next_scan(self) -> int:
        self._scan += 1
        if self._scan > SCAN_NUMBERS:
            self._seen.fill(0)
            self._scan = 1
        return self._scan

    def _place(self, where: NDArray[np.float64]) -> tuple[float, float, Window]:
        """Arguments of kernels: the pose in cells from the window's corner, and the window."""
        n = self.n_cells
        corner = self._corner
        if corner is None:
            corner = np.floor(where[:2] / self.resolution_m).astype(np.int64) - n // 2
        x, y = where[:2] / self.resolution_m - corner
        wrap_row, wrap_column = int(corner[1] % n), int(corner[0] % n)
        return float(x), float(y), Window(self._evidence, self._seen, wrap_row, wrap_column)

    def _move_to(self, where: NDArray[np.float64]) -> None:
        """Centre the window on the robot's cell; new cells are unknown."""
        n = self.n_cells
        wanted = np.floor(where[:2] / self.resolution_m).astype(np.int64) - n // 2
        if self._corner is not None:
            column, row = wanted - self._corner
            if max(abs(column), abs(row)) >= n:
                self._evidence.fill(0)
            elif column or row:
                self._evidence[_entered(self._corner[1], row, n)] = 0
                self._evidence[:, _entered(self._corner[0], column, n)] = 0
        self._corner = wanted


def _check_reach(max_range_m: float, *, or_infinite: bool = False) -> None:
    if not (0 < max_range_m < np.inf or (or_infinite and max_range_m == np.inf)):
        raise InputError(f"max_range_m must be a positive number of metres, got {max_range_m}")


def _check_whole(name: str, value: int, low: int) -> None:
    """Limit positions, because larger numbers would overflow in kernels."""
    if not isinstance(value, (int, np.integer)) or not low <= value <= _MOST_WHOLE:
        raise InputError(f"{name} must be a whole number from {low} to {_MOST_WHOLE}, got {value}")


def _entered(corner: int, step: int, n: int) -> NDArray[np.int64]:
    """Storage slices of the rows (or columns) that enter when the corner moves by ``step``."""
    if step >= 0:
        return np.arange(corner + n, corner + n + step) % n
    return np.arange(corner + step, corner) % n
