"""Block bootstrap: confidence intervals of scores whose samples are correlated."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import integer_array
from pgm_places.errors import InputError
from pgm_places.evaluation.confusion import accuracy, balanced_accuracy, paired_labels

__all__ = ["Interval", "block_bootstrap", "square_blocks"]


@dataclass(frozen=True)
class Interval:
    """An estimate with the ends of its confidence interval."""

    estimate: float
    low: float
    high: float


def block_bootstrap(
    truth: ArrayLike,
    predicted: ArrayLike,
    blocks: ArrayLike,
    *,
    n_labels: int,
    n_resamples: int = 1000,
    confidence: float = 0.95,
    seed: int = 0,
) -> dict[str, Interval]:
    """Confidence intervals of accuracy and balanced accuracy by resampling blocks of nodes.

    Errors of neighbouring cells are correlated, so single cells are not independent samples; blocks
    (see :func:`square_blocks`, or ``step // length`` on a trajectory) nearly are. The intervals are
    percentiles over ``n_resamples`` draws of as many blocks as there are, with replacement.

    Parameters
    ----------
    truth, predicted : (N,) int
        As in :func:`pgm_places.evaluation.evaluation.evaluate`.
    blocks : (N,) int
        Number of the block that each node belongs to.
    n_labels : int
        K.
    n_resamples : int
        Draws.
    confidence : float
        Probability mass of the intervals, between 0 and 1.
    seed : int
        Of the draws.
    """
    if not 0 < confidence < 1 or n_resamples < 1:
        raise InputError(
            "confidence must be between 0 and 1 and n_resamples at least 1, got "
            f"{confidence} and {n_resamples}"
        )
    true, chosen, known = paired_labels(truth, predicted, n_labels)
    block = integer_array("blocks", blocks, true.shape, low=-(2**62), high=2**62)
    number = np.unique(block[known], return_inverse=True)[1].reshape(-1)
    n_blocks = int(number.max()) + 1
    cells = n_labels * n_labels
    key = (number * n_labels + true[known]) * n_labels + chosen[known]
    counts = np.bincount(key, minlength=n_blocks * cells).reshape(n_blocks, cells)
    draws = np.random.default_rng(seed).multinomial(
        n_blocks, np.full(n_blocks, 1.0 / n_blocks), size=n_resamples
    )
    resampled = (draws @ counts).reshape(n_resamples, n_labels, n_labels)
    whole = counts.sum(axis=0).reshape(1, n_labels, n_labels)
    tail = 0.5 * (1 - confidence)

    def interval(figure: Callable[[NDArray[np.int64]], NDArray[np.float64]]) -> Interval:
        low, high = np.quantile(figure(resampled), [tail, 1 - tail])
        return Interval(float(figure(whole)[0]), float(low), float(high))

    return {
        "accuracy": interval(accuracy),
        "balanced_accuracy": interval(balanced_accuracy),
    }


def numbered_apart(parts: Sequence[NDArray[np.int64]]) -> NDArray[np.int64]:
    """(N,) block numbers of several maps or drives together, so that no two share a block.

    Examples
    --------
    >>> numbered_apart([np.array([0, 0, 1]), np.array([0, 2])]).tolist()
    [0, 0, 1, 2, 4]
    """
    ends = np.cumsum([0, *(int(part.max(initial=-1)) + 1 for part in parts)])
    return np.concatenate([part + first for part, first in zip(parts, ends[:-1], strict=True)])


def square_blocks(cells_rc: ArrayLike, side_cells: int) -> NDArray[np.int64]:
    """(N,) number of the square block of ``side_cells`` x ``side_cells`` that holds each cell."""
    cells = np.asarray(cells_rc)
    if cells.ndim != 2 or cells.shape[1] != 2 or side_cells < 1:
        raise InputError(
            "square_blocks takes cells of shape (N, 2) and a side of at least one cell, got "
            f"{cells.shape} and {side_cells}"
        )
    tile = cells.astype(np.int64) // side_cells
    columns = int(tile[:, 1].max(initial=0)) + 1
    return tile[:, 0] * columns + tile[:, 1]
