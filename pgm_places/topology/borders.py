"""Borders between pieces: the border length of every adjacent pair."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy import sparse

__all__ = ["Contacts", "contacts"]


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

    def matrix(self, count: int) -> "sparse.csr_array":
        """(R, R) symmetric border lengths; a corner counts as a thousandth of a side."""
        from scipy import sparse

        length = self.sides + 1e-3 * self.corners
        i, j = self.pairs.T
        values = np.concatenate([length, length])
        index = (np.concatenate([i, j]), np.concatenate([j, i]))
        return sparse.csr_array((values, index), shape=(count, count))


def contacts(piece: NDArray[np.int32], count: int) -> Contacts:
    """The borders between the pieces of a raster (H, W), -1 for cells without a piece."""
    side_keys = [
        _keys(piece[:, :-1], piece[:, 1:], count),
        _keys(piece[:-1], piece[1:], count),
    ]
    corner_keys = [
        _keys(piece[:-1, :-1], piece[1:, 1:], count),
        _keys(piece[:-1, 1:], piece[1:, :-1], count),
    ]
    sides, side_counts = np.unique(np.concatenate(side_keys), return_counts=True)
    corners, corner_counts = np.unique(np.concatenate(corner_keys), return_counts=True)
    keys = np.union1d(sides, corners)
    lengths = np.zeros((2, len(keys)), np.int64)
    lengths[0, np.searchsorted(keys, sides)] = side_counts
    lengths[1, np.searchsorted(keys, corners)] = corner_counts
    pairs = np.stack([keys // max(count, 1), keys % max(count, 1)], axis=1).astype(np.int32)
    return Contacts(pairs, lengths[0], lengths[1])


def _keys(first: NDArray[np.int32], second: NDArray[np.int32], count: int) -> NDArray[np.int64]:
    """One number per place where two different pieces meet."""
    meet = (first >= 0) & (second >= 0) & (first != second)
    a, b = first[meet].astype(np.int64), second[meet].astype(np.int64)
    keys: NDArray[np.int64] = np.minimum(a, b) * count + np.maximum(a, b)
    return keys
