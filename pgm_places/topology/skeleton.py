"""Skeleton of free space: the middle lines of passages, and their junctions."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places._core import thin
from pgm_places.maps.components import connected_components

_AROUND = [(dr, dc) for dr in (-1, 0, 1) for dc in (-1, 0, 1) if dr or dc]
Cell = tuple[int, int]


class Skeleton(NamedTuple):
    """Points at which ways begin, end or meet, and the ways between them.

    Parameters
    ----------
    points : list of (int, int)
        Cells; the targets come first, in their order.
    ways : list of (n, 2) int64
        Cells from one point to another, both included; consecutive cells are neighbours, except
        at the first and the last step, which may be a few cells long.
    """

    points: list[Cell]
    ways: list[NDArray[np.int64]]


def skeleton_of(
    inside: NDArray[np.bool_], clearance: NDArray[np.int32], targets: NDArray[np.int64]
) -> Skeleton:
    """The skeleton that connects all targets, surrounds every obstacle, and has no other ends.

    Parameters
    ----------
    inside : (H, W) bool
        The space; False along the edges of the raster.
    clearance : (H, W) int32
        Squared distance to the nearest obstacle; ways follow its maxima.
    targets : (T, 2) int64
        Cells inside, all different.

    Examples
    --------
    >>> inside = np.zeros((5, 9), bool)
    >>> inside[1:4, 1:8] = True
    >>> from pgm_places.maps.clearance import squared_clearance
    >>> found = skeleton_of(inside, squared_clearance(~inside), np.array([[2, 1], [2, 7]]))
    >>> found.points, found.ways[0].tolist()
    ([(2, 1), (2, 7)], [[2, 1], [2, 2], [2, 3], [2, 4], [2, 5], [2, 6], [2, 7]])
    """
    clearance = np.ascontiguousarray(clearance, np.int32)
    thinned, kept = inside.copy(), np.zeros(inside.shape, np.bool_)
    kept[targets[:, 0], targets[:, 1]] = True
    thin(thinned, clearance, kept)
    cells = {(int(r), int(c)) for r, c in np.argwhere(thinned)}
    near = {cell: [other for other in _neighbours(cell) if other in cells] for cell in cells}
    points = [(int(r), int(c)) for r, c in targets]
    point_of = {cell: k for k, cell in enumerate(points)}
    meets = np.zeros(inside.shape, np.bool_)
    for cell, others in near.items():
        meets[cell] = len(others) > 2 and cell not in point_of
    groups = connected_components(meets)
    rows, columns = np.nonzero(meets)
    middle: dict[int, Cell] = {}
    for r, c in zip(rows.tolist(), columns.tolist(), strict=True):
        group = int(groups.piece[r, c])
        if group not in middle or clearance[r, c] > clearance[middle[group]]:
            middle[group] = (r, c)
    for r, c in zip(rows.tolist(), columns.tolist(), strict=True):
        point_of[r, c] = len(targets) + int(groups.piece[r, c])
    points += [middle[group] for group in range(groups.count)]
    return Skeleton(points, _ways(points, point_of, near))


def _neighbours(cell: Cell) -> list[Cell]:
    return [(cell[0] + dr, cell[1] + dc) for dr, dc in _AROUND]


def _ways(
    points: list[Cell], point_of: dict[Cell, int], near: dict[Cell, list[Cell]]
) -> list[NDArray[np.int64]]:
    """The ways between points, each once, traced from each point along its branches."""
    found, walked = [], set()
    for start, first in point_of.items():
        for step in near[start]:
            if point_of.get(step) == first or (start, step) in walked:
                continue
            way = [start, step]
            while way[-1] not in point_of:
                ahead = [cell for cell in near[way[-1]] if cell != way[-2]]
                if not ahead:
                    break
                way.append(ahead[0])
            if way[-1] in point_of:
                walked.add((way[-1], way[-2]))
                last = point_of[way[-1]]
                found.append(np.array([points[first], *way[1:-1], points[last]], np.int64))
    return found
