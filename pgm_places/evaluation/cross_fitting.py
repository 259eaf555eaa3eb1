"""Cross-fitting: a model per fold, fitted without that fold, and held-out scores."""

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from pgm_places.progress import report_stage

M = TypeVar("M")


def cross_fit(
    folds: NDArray[np.int64],
    fit: Callable[[int], M],
    name: str = "held-out scores",
) -> dict[int, M]:
    """For each fold, the model that ``fit`` returns for all rows outside it.

    Parameters
    ----------
    folds : (n,) int64
        The fold of each row.
    fit : callable
        From the number of a fold to the model of all other rows.
    name : str
        The name of the progress stage.

    Examples
    --------
    >>> y, folds = np.array([1.0, 2.0, 6.0]), np.array([0, 0, 1])
    >>> means = cross_fit(folds, lambda fold: y[folds != fold].mean())
    >>> held_out_scores(means, folds, lambda mean, rows: mean - y[rows]).tolist()
    [5.0, 4.0, -4.5]
    """
    models, numbers = {}, np.unique(folds).tolist()
    with report_stage(name) as stage:
        for count, fold in enumerate(numbers, start=1):
            models[fold] = fit(fold)
            stage.update(count / len(numbers))
    return models


def held_out_scores(
    models: Mapping[int, M],
    folds: NDArray[np.int64],
    score: Callable[[M, NDArray[np.bool_] | slice], NDArray[Any]],
) -> NDArray[np.float64]:
    """(n, ...) the score of each row by the model that was fitted without its fold.

    ``score`` takes a model and the rows to score; if one model scores all rows, these are a slice,
    to avoid copies.
    """
    numbers = np.unique(folds).tolist()
    if len({id(models[fold]) for fold in numbers}) == 1:
        return np.asarray(score(models[numbers[0]], slice(None)), np.float64)
    scores = np.empty(0)
    for fold in numbers:
        rows = folds == fold
        part = score(models[fold], rows)
        if not len(scores):
            scores = np.empty((len(folds), *part.shape[1:]))
        scores[rows] = part
    return scores
