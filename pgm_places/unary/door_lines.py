"""Door lines: lines from wall to wall at doorways that networks detect without a gate candidate."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from pgm_places.floor.architecture import LABELS
from pgm_places.floor.raster import CELL_M
from pgm_places.floor.view import FloorScores
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.spaces.components import components, neighbour_lists
from pgm_places.spaces.gates import Gates, chord_directions

_DOORWAY = LABELS.index("doorway")

_LIKELY = 0.5
"""Adjacent cells with a higher probability of a doorway form a blob."""

_SURE = 0.9
"""The least mean probability along a line; chosen on buildings held out (docs/notes/tried.md)."""

_LEAST_M2 = 0.06
"""Smaller blobs are specks."""

_LEAST_WIDTH_M, _MOST_WIDTH_M = 0.4, 2.5
"""Shortest and longest line (m): shorter ones cannot be passed, longer ones are rarely doorways."""

_MARGIN_M, _THROUGH = 0.1, 0.3
"""A line is dropped if a larger share of it lies in the enlarged rectangle of a gate."""

_POINTS = 12
"""Number of the most probable cells of a blob through which lines are tried."""

_PER_WIDTH_M = 0.02
"""Penalty per metre, so that of equally probable lines the shortest wins."""

_NEXT = np.array([[0, 1], [1, -1], [1, 0], [1, 1]])


def door_lines(gates: Gates, seen: FloorScores) -> NDArray[np.int64]:
    """(n, 2) row and column of cells on lines at doorways without a gate candidate.

    Adjacent cells of 0.1 m with a doorway probability above one half form a blob. In each blob, the
    line from wall to wall with the highest mean probability is selected if the mean is at least
    0.9, if it is 0.4 to 2.5 m long, and if no candidate is there. Consecutive cells of a line share
    sides, as :meth:`Segmentation.of` requires.

    Parameters
    ----------
    gates : Gates
        The candidates where passages narrow.
    seen : FloorScores
        The networks' scores of the map.
    """
    grid = gates.segmentation.watershed.grid
    pairs = [np.empty((0, 2), np.int64)]
    for points, probability in _blobs(grid, seen):
        middle = probability @ points / probability.sum()
        inside = _covered(gates, grid.cell_centres_m(middle[np.newaxis])) > 0
        if inside or probability.max() < _SURE:
            continue
        away = np.hypot(*(points - middle).T)
        line = _line(grid, seen, points[np.lexsort((away, -probability))[:_POINTS]])
        if line is not None and _covered(gates, grid.cell_centres_m(line)) < _THROUGH:
            pairs.append(_cells_on(line, grid.shape))
    return np.concatenate(pairs)


def _blobs(
    grid: OccupancyGrid, seen: FloorScores
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """The points (n, 2) of each blob, as rows and columns of the map, and their probabilities."""
    cells = np.argwhere(seen.log_p[..., _DOORWAY] > np.log(_LIKELY))
    points = (cells + 0.5) * (CELL_M / grid.resolution_m) - 0.5
    on_map = np.minimum(np.rint(points).astype(np.int64), np.array(grid.shape) - 1)
    free = grid.free[on_map[:, 0], on_map[:, 1]]
    cells, points = cells[free], points[free]
    blob = components(*neighbour_lists(_touching(cells), len(cells)))
    probability = np.exp(seen.log_p[cells[:, 0], cells[:, 1], _DOORWAY].astype(np.float64))
    order = np.argsort(blob, kind="stable")
    ends = np.cumsum(np.bincount(blob))
    for some in np.split(order, ends[:-1]):
        if len(some) * CELL_M**2 >= _LEAST_M2:
            yield points[some], probability[some]


def _touching(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """(E, 2) the pairs of cells, given in row-major order, that share a side or a corner."""
    if not len(cells):
        return np.empty((0, 2), np.int64)
    width = int(cells[:, 1].max()) + 3
    key = (cells + 1) @ np.array([width, 1])
    other = key[:, np.newaxis] + _NEXT @ np.array([width, 1])
    place = np.minimum(np.searchsorted(key, other), len(key) - 1)
    one, step = np.nonzero(key[place] == other)
    return np.stack([one, place[one, step]], axis=1)


def _covered(gates: Gates, points_m: NDArray[np.float64]) -> float:
    """The largest share of some points that lies in the rectangle of one gate."""
    reach = np.hypot(gates.width_m, gates.depth_m) / 2 + _MOST_WIDTH_M
    away = np.hypot(*(gates.centre_m - points_m.mean(axis=0)).T)
    margin = {"wider_m": _MARGIN_M, "deeper_m": _MARGIN_M}
    return max(
        (
            float(gates[int(g)].contains(points_m, **margin).mean())
            for g in np.flatnonzero(away < reach)
        ),
        default=0.0,
    )


def _line(
    grid: OccupancyGrid, seen: FloorScores, points: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """(m, 2) places every half cell along the surest line through one of the points."""
    directions = chord_directions()
    n_steps = int(np.ceil(2 * _MOST_WIDTH_M / grid.resolution_m))
    there = _Rays.of(grid, seen, points, directions, n_steps)
    back = _Rays.of(grid, seen, points, -directions, n_steps)
    n = there.length + back.length - 1
    sure = (there.total + back.total - there.first) / n
    width_m = n * grid.resolution_m / 2
    passable = width_m.min(axis=1, keepdims=True) >= _LEAST_WIDTH_M
    allowed = passable & (width_m < _MOST_WIDTH_M) & (sure >= _SURE)
    if not allowed.any():
        return None
    score = np.where(allowed, sure - _PER_WIDTH_M * width_m, -np.inf)
    point, way = np.unravel_index(int(score.argmax()), score.shape)
    steps = np.arange(1 - back.length[point, way], there.length[point, way])
    return np.asarray(points[point] + steps[:, np.newaxis] / 2 * directions[way])


class _Rays:
    """Free rays from points in all directions, sampled every half cell, the point itself first.

    Attributes
    ----------
    length : (n, D) int
        How many samples are free before the first that is not.
    total, first : (n, D) float
        The probability of a doorway, summed over these samples, and of the first.
    """

    def __init__(self, free: NDArray[np.bool_], probability: NDArray[np.float32]) -> None:
        run = np.logical_and.accumulate(free, axis=2)
        self.length = run.sum(axis=2)
        self.total = (probability * run).sum(axis=2)
        self.first = probability[:, :, 0]

    @classmethod
    def of(
        cls,
        grid: OccupancyGrid,
        seen: FloorScores,
        points: NDArray[np.float64],
        directions: NDArray[np.float64],
        n_steps: int,
    ) -> "_Rays":
        """The rays from points (n, 2) in directions (D, 2), as rows and columns of the map."""
        steps = np.arange(n_steps)[:, np.newaxis] / 2
        at = points[:, np.newaxis, np.newaxis] + steps * directions[:, np.newaxis]
        cells = np.rint(at).astype(np.int64)
        last = np.array(grid.shape) - 1
        inside = ((cells >= 0) & (cells <= last)).all(axis=-1)
        on_map = np.clip(cells, 0, last)
        free = inside & grid.free[on_map[..., 0], on_map[..., 1]]
        log_p = seen.of(on_map.reshape(-1, 2))[:, _DOORWAY]
        return cls(free, np.exp(log_p).reshape(free.shape))


def _cells_on(line: NDArray[np.float64], shape: tuple[int, int]) -> NDArray[np.int64]:
    """(n, 2) the cells of a line and one beyond each end; consecutive cells share sides."""
    step = (line[-1] - line[0]) / (len(line) - 1)
    steps = np.arange(-3 * 4, (len(line) + 2) * 4 + 1)[:, np.newaxis] / 4
    cells = np.rint(line[0] + steps * step).astype(np.int64)
    cells = cells[np.append(True, (cells[1:] != cells[:-1]).any(axis=1))]
    oblique = np.flatnonzero((cells[1:] != cells[:-1]).all(axis=1))
    corners = np.stack([cells[oblique + 1, 0], cells[oblique, 1]], axis=1)
    cells = np.concatenate([cells, corners])
    return np.asarray(cells[((cells >= 0) & (cells < shape)).all(axis=1)])
