"""Connections between the regions of a map, and their passages."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places.maps.components import Components
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.topology.regions import STEPS, contacts_at, meetings
from pgm_places.topology.topological_map import Connection


@dataclass(frozen=True, eq=False)
class Passages:
    """The passage between each pair of adjacent pieces.

    Parameters
    ----------
    pairs : (C, 2) int32
        Piece numbers, the smaller first, sorted.
    sides : (C,) int64
        Number of cell sides along their border; 0 if they touch only at corners.
    middle_rc : (C, 2) float64
        The point of the border with the most clearance: row and column; integers are cell centres.
    width : (C,) float64
        Diameter in cells of the largest disc that fits there: twice the distance to the wall.
    """

    pairs: NDArray[np.int32]
    sides: NDArray[np.int64]
    middle_rc: NDArray[np.float64]
    width: NDArray[np.float64]


def find_passages(piece: NDArray[np.int32], count: int, clearance: NDArray[np.int32]) -> Passages:
    """The passage between every pair of adjacent pieces.

    Parameters
    ----------
    piece : (H, W) int32
        Number of each cell's piece, -1 for none.
    count : int
    clearance : (H, W) int32
        Squared distance in cells to the nearest cell that is not free.

    Examples
    --------
    >>> piece = np.array([[0, 0, 1, 1]] * 3, np.int32)
    >>> free = np.array([[1, 1, 1, 1], [4, 4, 4, 4], [1, 1, 1, 1]], np.int32)
    >>> found = find_passages(piece, 2, free)
    >>> found.middle_rc.tolist(), found.width.tolist()
    ([[1.0, 1.5]], [3.0])
    """
    met = meetings(piece, count)
    touching = contacts_at(met, count)
    parts = []
    for (down, right), item in zip(STEPS, met, strict=True):
        r, c = item.cells_rc
        room = np.minimum(clearance[r, c], clearance[r + down, c + right])
        parts.append((item.keys, room, np.stack([r + down / 2, c + right / 2], axis=1)))
    key, room, place = (np.concatenate(part) for part in zip(*parts, strict=True))
    # The most clearance first; ties go to the point nearest to the middle of the border.
    off = _from_the_middle(key, place)
    order = np.lexsort((off, -room, key))
    _, best = np.unique(key[order], return_index=True)
    chosen = order[best]
    width = np.maximum(2 * np.sqrt(room[chosen].astype(np.float64)) - 1, 0.0)
    return Passages(touching.pairs, touching.sides, place[chosen], width)


def _from_the_middle(key: NDArray[np.int64], place: NDArray[np.float64]) -> NDArray[np.float64]:
    """Squared distance of each position from the mean position of its key."""
    _, group, counts = np.unique(key, return_inverse=True, return_counts=True)
    mean = np.stack([np.bincount(group, axis, len(counts)) / counts for axis in place.T], axis=1)
    return np.asarray(((place - mean[group]) ** 2).sum(axis=1))


def connections_of(
    pieces: Components,
    grid: OccupancyGrid,
    ids: Sequence[int],
    clearance: NDArray[np.int32],
    min_width_m: float = 0.0,
) -> tuple[Connection, ...]:
    """The connections of pieces, by ids; those narrower than ``min_width_m`` are left out.

    Parameters
    ----------
    pieces : Components
    grid : OccupancyGrid
        The map of the pieces; only its frame is used.
    ids : sequence of int
        One per piece.
    clearance : (H, W) int32
        Squared distance in cells to the nearest cell that is not free.
    min_width_m : float
    """
    passages = find_passages(pieces.piece, pieces.count, clearance)
    middles = grid.cell_centres_m(passages.middle_rc)
    connections = []
    for k, (i, j) in enumerate(passages.pairs.tolist()):
        width_m = float(passages.width[k]) * grid.resolution_m
        if width_m < min_width_m:
            continue
        first, second = sorted((ids[i], ids[j]))
        point_m = (float(middles[k, 0]), float(middles[k, 1]))
        border_m = float(passages.sides[k]) * grid.resolution_m
        connections.append(Connection(first, second, point_m, width_m, border_m))
    return tuple(sorted(connections, key=lambda item: (item.first, item.second)))
