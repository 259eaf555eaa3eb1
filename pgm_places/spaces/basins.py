"""Watershed basins of open space: one around every summit of the relief."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places import _core
from pgm_places._core import open_cells, smoothed_roots
from pgm_places.maps.components import squared_clearance
from pgm_places.maps.occupancy_grid import FREE, UNKNOWN, OccupancyGrid

FURNITURE_M2 = 0.35
"""Smaller obstacles, whether occupied or unknown, are filled: table legs, chairs, specks."""

FURNITURE_M = 1.3
"""Small obstacles that are longer are parts of walls, such as a thin wall between two doors; chosen
on training buildings (docs/notes/tried.md)."""

SMALLEST_SPACE_M2 = 1.0
"""Smaller pieces of free space are dropped: glimpses through gaps."""


def open_space(grid: OccupancyGrid, smallest_m2: float = SMALLEST_SPACE_M2) -> NDArray[np.bool_]:
    """(H, W) which cells are open: free space with small obstacles filled, small pieces dropped.

    Small obstacles, connected by sides and corners, have an area under 0.35 m2 and a length, the
    diagonal of the box around them, under 1.3 m. Free space is connected by sides.

    Examples
    --------
    >>> cells = np.zeros((9, 9), np.int8)
    >>> cells[4, 4] = 100
    >>> int(open_space(OccupancyGrid(cells, resolution_m=0.5)).sum())
    81
    """
    is_open = np.empty(grid.shape, np.bool_)
    cell_m2 = grid.resolution_m**2
    furniture = (FURNITURE_M2 / cell_m2, FURNITURE_M / grid.resolution_m)
    open_cells(grid.cells, FREE, *furniture, smallest_m2 / cell_m2, is_open)
    return is_open


_ROOT_UNIT = 1024

UNIT = 9 * _ROOT_UNIT
"""The height of one cell; reliefs are integers."""

# The distance in cells by which smoothing lowers the middle line of a passage, to within a twelfth
# of a cell, for odd and even widths.
_OFFSET = UNIT / 4


def relief_of(is_open: NDArray[np.bool_]) -> NDArray[np.int32]:
    """(H + 2, W + 2) smoothed distance to the nearest cell that is not open, with a frame of 0.

    The mean over 3 x 3 cells of the Euclidean distance between cell centres (Meijster, Roerdink and
    Hesselink, 2000), in units of 1 / ``UNIT`` cells; 0 where a cell is not open.

    Examples
    --------
    >>> (relief_of(np.ones((3, 3), np.bool_))[1:-1, 1:-1] / UNIT).round(2).tolist()
    [[0.56, 0.78, 0.56], [0.78, 1.11, 0.78], [0.56, 0.78, 0.56]]
    """
    height, width = is_open.shape
    relief = np.empty((height + 2, width + 2), np.int32)
    smoothed_roots(squared_clearance(~is_open), _ROOT_UNIT, relief)
    return relief


def half_width_m(relief: ArrayLike, resolution_m: float) -> NDArray[np.float64]:
    """Half the width of the free space in metres at cells on its middle line, from their heights.

    ``(relief / UNIT + 1/4) resolution_m``: smoothing lowers the distance there by a quarter of a
    cell, to within a twelfth. For other cells see ``clearance_m``.
    """
    return np.asarray((np.asarray(relief, np.float64) + _OFFSET) * (resolution_m / UNIT))


def clearance_m(relief: ArrayLike, resolution_m: float) -> NDArray[np.float64]:
    """Distance in metres from cell centres to the edge of the nearest wall, from their heights.

    ``(relief / UNIT - 1/2) resolution_m``, at least 0; up to 3/4 of a cell less on middle lines.
    """
    cells = np.asarray(relief, np.float64) / UNIT - 0.5
    return np.asarray(np.maximum(cells, 0.0) * resolution_m)


N_RECTANGLES = 15
"""Rectangles are tried at steps of 6 degrees over a quarter turn."""

_N_SUMS = 9


@dataclass(frozen=True, eq=False)
class Basins:
    """The watershed of a relief."""

    # (H + 2, W + 2) basin of each cell, with a frame of one cell; -1 where it is not open. Numbers
    # from ``count`` on are lines: cells halfway between indistinguishable basins.
    raster: NDArray[np.int32]
    count: int  # B, the number of basins
    area: NDArray[np.int64]  # (B + n_lines,) cells of each basin and line
    summit: NDArray[np.int32]  # (B + n_lines,) the largest height in each basin, 0 for lines
    beside: NDArray[np.int64]  # (P, 2) each line with each adjacent basin, sorted
    n_lines: int  # number of lines

    def segment_of_line(self, segment_of: NDArray[np.int32]) -> NDArray[np.int32]:
        """(n_lines,) the common segment of all basins adjacent to a line, -1 if they differ."""
        low = np.full(self.n_lines, np.iinfo(np.int32).max, np.int32)
        high = np.full(self.n_lines, -1, np.int32)
        line, segment = self.beside[:, 0] - self.count, segment_of[self.beside[:, 1]]
        np.minimum.at(low, line, segment)
        np.maximum.at(high, line, segment)
        return np.where(low == high, low, np.int32(-1)).astype(np.int32)


@dataclass(frozen=True, eq=False)
class BasinSums:
    """Sums and extents of each basin and line (N = B + n_lines), in cells."""

    # (N, 9) summed heights, cells not free on the map, sides at walls, sides at unknown cells, and
    # the sums of r, c, rr, rc, cc over the cells (r, c)
    total: NDArray[np.int64]
    # low, high: (N, 30) minimum and maximum projections of the cells onto 30 directions over half a
    # turn; k and k + 15 are at right angles
    low: NDArray[np.float64]
    high: NDArray[np.float64]


def neighbour_steps(padded_width: int) -> NDArray[np.int64]:
    """(8,) steps to a cell's neighbours in a flat raster, sides first; odd ones lead forwards."""
    w = padded_width
    return np.array([-w, w, -1, 1, -w - 1, w + 1, -w + 1, w - 1], np.int64)


def find_basins(relief: NDArray[np.int32]) -> Basins:
    """The basins of a relief (H + 2, W + 2) with a frame of 0.

    Every cell goes to the summit reached by steepest ascent, across plateaus to the nearest
    ascending cells: to the highest of several summits, then the largest plateau, area, volume.
    Cells still tied form lines between basins, as any choice would depend on the map's orientation.
    """
    flat, steps = relief.reshape(-1), neighbour_steps(relief.shape[1])
    ways = np.zeros(flat.size, np.uint8)
    basin = np.full(flat.size, -1, np.int32)
    scratch = np.empty(flat.size, np.int32)  # the system allocates only the pages in use
    _core.steepest_ways(flat, steps, ways)
    _core.cross_plateaus(flat, steps, ways, basin, scratch)
    ranks = np.empty(flat.size // 4 + 1, np.int64)  # summits do not touch
    rank = ranks[: _core.number_summits(flat, steps, ways, basin, scratch, ranks)].copy()
    n_parted = _core.climb(flat, steps, ways, rank, basin, scratch)
    n_lines, beside = 0, np.empty((0, 2), np.int64)
    area, volume = _areas_and_volumes(basin, flat, len(rank))
    if n_parted:
        pairs = np.empty((8 * n_parted, 2), np.int64)
        n_lines, n_pairs = _core.number_lines(basin, steps, len(rank), scratch, pairs)
        line, beside_it = pairs[:n_pairs].T
        beside = np.stack(np.divmod(np.unique(line * len(rank) + beside_it), len(rank)), axis=1)
        number, n_lines, beside = _settled(len(rank), n_lines, beside, rank, area, volume)
        _core.renumber(basin, number)
        area = _areas_and_volumes(basin, flat, len(rank) + n_lines)[0]
    summit = np.concatenate([rank >> 32, np.zeros(n_lines, np.int64)]).astype(np.int32)
    return Basins(basin.reshape(relief.shape), len(rank), area, summit, beside, n_lines)


def _areas_and_volumes(
    basin: NDArray[np.int32], relief: NDArray[np.int32], count: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(count,) the number of cells of each basin, and their summed heights."""
    area, volume = np.zeros(count, np.int64), np.zeros(count, np.int64)
    _core.areas_and_volumes(basin, relief, area, volume)
    return area, volume


def _settled(
    count: int,
    n_lines: int,
    beside: NDArray[np.int64],
    rank: NDArray[np.int64],
    area: NDArray[np.int64],
    volume: NDArray[np.int64],
) -> tuple[NDArray[np.int32], int, NDArray[np.int64]]:
    """New numbers of basins and lines; a line with a single largest basin joins it."""
    line, basin = beside.T
    order = np.lexsort((volume[basin], area[basin], rank[basin], line))
    line, basin = line[order], basin[order]
    number = np.arange(count + n_lines, dtype=np.int32)
    last = np.flatnonzero(np.append(line[1:] != line[:-1], True))
    before = np.maximum(last - 1, 0)
    alone = (last == 0) | (line[before] != line[last])
    best, second = basin[last], basin[before]
    alone |= (
        (rank[best] != rank[second])
        | (area[best] != area[second])
        | (volume[best] != volume[second])
    )
    number[line[last[alone]]] = best[alone]
    remaining = line[last[~alone]]
    number[remaining] = count + np.arange(len(remaining))
    still = np.isin(beside[:, 0], remaining)
    left = np.column_stack([number[beside[still, 0]], beside[still, 1]]).astype(np.int64)
    return number, len(remaining), left


def sum_up(grid: OccupancyGrid, basins: Basins, relief: NDArray[np.int32]) -> BasinSums:
    """The sums of all basins and lines, in one pass over the map."""
    directions = _directions()
    n = len(basins.area)
    total = np.zeros((n, _N_SUMS), np.int64)
    low, high = np.full((n, len(directions)), np.inf), np.full((n, len(directions)), -np.inf)
    _core.sum_basins(basins.raster, relief, grid.cells, FREE, UNKNOWN, directions, total, low, high)
    return BasinSums(total, low, high)


def _directions() -> NDArray[np.float64]:
    """(30, 2) row and column steps."""
    angle = np.arange(N_RECTANGLES) * (np.pi / 2 / N_RECTANGLES)
    along = np.stack([np.sin(angle), np.cos(angle)], axis=1)
    across = np.stack([np.cos(angle), -np.sin(angle)], axis=1)
    return np.concatenate([along, across])
