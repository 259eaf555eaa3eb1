"""Borders between pieces: the border length of every adjacent pair."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places.graph.bands import bands_of_rows

STEPS = ((0, 1), (1, 0), (1, 1), (1, -1))
"""Steps to half of a cell's neighbours; the other half would repeat the pairs."""


@dataclass(frozen=True, eq=False)
class Contacts:
    """Pairs of pieces that share a border.

    Parameters
    ----------
    pairs : (C, 2) int32
        Piece numbers, the smaller first, sorted.
    sides : (C,) int64
        Number of cell sides along the border of each pair; 0 if they touch only at corners.
    corners : (C,) int64
        Number of cell corners at which they touch diagonally.
    """

    pairs: NDArray[np.int32]
    sides: NDArray[np.int64]
    corners: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Meetings:
    """Adjacent cells of different pieces along one of ``STEPS``, row by row.

    Parameters
    ----------
    cells_rc : tuple of two (M,) int64
        Rows and columns of the first cells; each second cell is one step further.
    keys : (M,) int64
        ``first R + second``, the smaller piece first.
    """

    cells_rc: tuple[NDArray[np.int64], NDArray[np.int64]]
    keys: NDArray[np.int64]


def meetings(piece: NDArray[np.int32], count: int) -> list[Meetings]:
    """For each step, the meetings of pieces in a raster (H, W) with -1 for cells without one."""
    return [_along(piece, count, down, right) for down, right in STEPS]


def _along(piece: NDArray[np.int32], count: int, down: int, right: int) -> Meetings:
    height, width = piece.shape
    start, stop = max(0, -right), width - max(0, right)
    found = []
    for rows in bands_of_rows((height - down, width)):  # bounds the memory for huge maps
        first = piece[rows, start:stop]
        second = piece[rows.start + down : rows.stop + down, start + right : stop + right]
        # Few cells lie at a border; NumPy finds them in one dimension several times as fast.
        r, c = np.divmod(np.flatnonzero(first != second), max(stop - start, 1))
        pair = np.stack([first[r, c], second[r, c]]).astype(np.int64)
        low, high = pair.min(axis=0), pair.max(axis=0)
        inside = low >= 0
        found.append((r[inside] + rows.start, c[inside] + start, (low * count + high)[inside]))
    found.append((np.zeros(0, np.int64),) * 3)
    r, c, keys = (np.concatenate(part) for part in zip(*found, strict=True))
    return Meetings((r, c), keys)


def contacts(piece: NDArray[np.int32], count: int) -> Contacts:
    """The borders between the pieces of a raster (H, W), -1 for cells without a piece."""
    return contacts_at(meetings(piece, count), count)


def contacts_at(met: Sequence[Meetings], count: int) -> Contacts:
    """The borders of pieces from their meetings."""
    keys_of = [item.keys for item in met]
    sides, side_counts = np.unique(np.concatenate(keys_of[:2]), return_counts=True)
    corners, corner_counts = np.unique(np.concatenate(keys_of[2:]), return_counts=True)
    keys = np.union1d(sides, corners)
    lengths = np.zeros((2, len(keys)), np.int64)
    lengths[0, np.searchsorted(keys, sides)] = side_counts
    lengths[1, np.searchsorted(keys, corners)] = corner_counts
    pairs = np.stack([keys // max(count, 1), keys % max(count, 1)], axis=1).astype(np.int32)
    return Contacts(pairs, lengths[0], lengths[1])
