"""Blocks of f x f cells, f a fraction: their positions, and areas of masks in them."""

from collections.abc import Iterator
from fractions import Fraction
from itertools import count
from math import ceil

import numpy as np
from numpy.typing import NDArray

from pgm_places.graph.bands import bands_of_rows

SAME = 1e-3
"""Tolerance of ratios: map files round resolutions to three or four digits."""


def simplest_factor(ratio: float) -> Fraction:
    """The fraction with the least denominator within a thousandth of a ratio."""
    fractions = (Fraction(round(ratio * parts), parts) for parts in count(1))
    return next(f for f in fractions if abs(ratio - f) <= SAME * ratio)


# Fractions of this denominator are at most 2 SAME apart, so the simplest one never has a larger.
_MAX_PARTS = ceil(1 / (2 * SAME))


def factor_between(fine_m: float, coarse_m: float) -> Fraction:
    """The factor between a map and its coarsened version: the fraction nearest to the ratio.

    Rounding apart, that is the :func:`simplest_factor` of the requested resolution; the ratio
    itself could have a simpler one.
    """
    if coarse_m < fine_m:
        return 1 / factor_between(coarse_m, fine_m)
    return Fraction(coarse_m / fine_m).limit_denominator(_MAX_PARTS)


def holders(cells: NDArray[np.integer], factor: Fraction) -> NDArray[np.int64]:
    """The block of ``factor`` cells that holds the centre of each cell, along one axis."""
    return (2 * cells.astype(np.int64) + 1) * factor.denominator // (2 * factor.numerator)


def coarse_shape(shape: tuple[int, int], factor: Fraction) -> tuple[int, int]:
    """Rows and columns of the blocks that cover a raster."""
    height, width = shape
    return ceil(height / factor), ceil(width / factor)


def block_rows(
    cells: NDArray[np.integer], factor: Fraction
) -> Iterator[tuple[slice, NDArray[np.integer]]]:
    """Rows of blocks and their cells, a few million cells at a time; no cell is in two parts."""
    blocks, tall = factor.denominator, factor.numerator  # ``blocks`` blocks span ``tall`` cells
    for rows in bands_of_rows((cells.shape[0], cells.shape[1]), multiple=tall):
        first = rows.start // tall * blocks
        yield slice(first, first + ceil((rows.stop - rows.start) / factor)), cells[rows]


def block_areas(
    mask: NDArray[np.bool_], factor: Fraction, shape: tuple[int, ...]
) -> NDArray[np.int64]:
    """(h, w) area of the true cells in each block; a cell is ``denominator**2``."""
    tall = _run_sums(mask.T, factor, shape[0]).T
    return _run_sums(tall, factor, shape[1])


def _run_sums(values: NDArray[np.generic], factor: Fraction, n_runs: int) -> NDArray[np.int64]:
    """(n, n_runs) sum of each row over runs of ``factor`` entries; cut entries count in part."""
    length = values.shape[1]
    total = np.zeros((len(values), length + 1), np.int64)
    np.cumsum(values, axis=1, out=total[:, 1:])
    ends = np.minimum(np.arange(n_runs + 1) * factor.numerator, length * factor.denominator)
    entry, rest = np.divmod(ends, factor.denominator)
    before = total[:, entry] * factor.denominator
    cut = np.flatnonzero(rest)
    before[:, cut] += values[:, entry[cut]] * rest[cut]
    return np.diff(before, axis=1)
