"""Passages: where one region leads to another, and how wide the way through is."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places.topology.borders import contacts

__all__ = ["Passages", "find_passages"]


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
    touching = contacts(piece, count)
    keys, rooms, rows, columns = [], [], [], []
    for dr, dc in ((0, 1), (1, 0), (1, 1), (1, -1)):
        first, second, corner = _shifted(piece, dr, dc)
        where = np.nonzero((first >= 0) & (second >= 0) & (first != second))
        a, b = first[where].astype(np.int64), second[where].astype(np.int64)
        keys.append(np.minimum(a, b) * count + np.maximum(a, b))
        room_first, room_second, _ = _shifted(clearance, dr, dc)
        rooms.append(np.minimum(room_first[where], room_second[where]))
        rows.append(where[0] + dr / 2)
        columns.append(where[1] + corner + dc / 2)
    key, room = np.concatenate(keys), np.concatenate(rooms)
    place = np.stack([np.concatenate(rows), np.concatenate(columns)], axis=1)
    # The most clearance first; ties go to the point nearest to the middle of the border.
    off = _from_the_middle(key, place)
    order = np.lexsort((off, -room, key))
    _, best = np.unique(key[order], return_index=True)
    chosen = order[best]
    width = np.maximum(2 * np.sqrt(room[chosen].astype(np.float64)) - 1, 0.0)
    return Passages(touching.pairs, touching.sides, place[chosen], width)


def _shifted(
    raster: NDArray[np.int32], dr: int, dc: int
) -> tuple[NDArray[np.int32], NDArray[np.int32], int]:
    """The cells and their neighbours at an offset, and the first cell's first column."""
    height, width = raster.shape
    corner = max(0, -dc)
    columns = slice(corner, width - max(0, dc))
    first = raster[: height - dr, columns]
    second = raster[dr:, columns.start + dc : columns.stop + dc]
    return first, second, corner


def _from_the_middle(key: NDArray[np.int64], place: NDArray[np.float64]) -> NDArray[np.float64]:
    """Squared distance of each position from the mean position of its key."""
    _, group, counts = np.unique(key, return_inverse=True, return_counts=True)
    mean = np.stack([np.bincount(group, axis, len(counts)) / counts for axis in place.T], axis=1)
    return np.asarray(((place - mean[group]) ** 2).sum(axis=1))
