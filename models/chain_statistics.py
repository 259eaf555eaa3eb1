"""Counts of labels, of consecutive labels, and of confusions, as probabilities."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array
from pgm_places.errors import InputError

__all__ = ["count_table", "normalised"]


def count_table(
    name: str, values: ArrayLike, shape: tuple[int | str | None, ...]
) -> NDArray[np.float64]:
    """``values`` as counts of that shape, which must be square if it has two axes.

    Raises
    ------
    InputError
        Another shape, a negative count, or one that is no finite number.
    """
    counts: NDArray[np.float64] = finite_array(name, values, shape)
    if counts.ndim == 2 and counts.shape[0] != counts.shape[1]:
        raise InputError(f"{name} must be square, got shape {counts.shape}")
    if (counts < 0).any():
        raise InputError(f"{name} must hold counts of at least 0, got {counts.min()}")
    return counts


def normalised(counts: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows over their sum; equal probabilities where it is 0."""
    total = counts.sum(axis=-1, keepdims=True)
    even = np.full_like(counts, 1.0 / counts.shape[-1])
    return np.divide(counts, total, out=even, where=total > 0)
