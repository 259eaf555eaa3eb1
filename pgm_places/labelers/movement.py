"""How a robot moves between places, learned from labelled maps alone (paper, section 5)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.models.hmm import HiddenMarkovModel
from pgm_places.sensing.simulated_moves import STAY_M, simulate_moves

__all__ = ["confusion_counts", "learn_movement"]


def confusion_counts(
    truths: Sequence[NDArray[np.int64]], scores: Sequence[NDArray[np.float64]], n_labels: int
) -> NDArray[np.int64]:
    """(K, K) how often the best label of scores (N, K) was the column where the row was true.

    Truths are label indices (N,), -1 where unknown.

    Examples
    --------
    >>> confusion_counts([np.array([0, 1, -1])], [np.log([[0.9, 0.1]] * 3)], 2).tolist()
    [[1, 0], [1, 0]]
    """
    counts = np.zeros((n_labels, n_labels), np.int64)
    for truth, part in zip(truths, scores, strict=True):
        known = np.flatnonzero(truth >= 0)
        np.add.at(counts, (truth[known], part[known].argmax(axis=1)), 1)
    return counts


def learn_movement(
    maps: Sequence[LabelledMap],
    truths: Sequence[NDArray[np.int64]],
    scores: Sequence[NDArray[np.float64]],
    n_labels: int,
    *,
    model: HiddenMarkovModel | None = None,
    n_runs: int = 1000,
    seed: int = 0,
) -> HiddenMarkovModel:
    """A hidden Markov model whose moves are simulated and whose observations are counted.

    Parameters
    ----------
    maps : sequence of LabelledMap
        Where the actions MOVE and STAY are simulated.
    truths, scores : sequence of (N,) int and (N, K) float
        What is true and what the list says, at best of examples that it did not learn from.
    n_labels : int
        K.
    model : HiddenMarkovModel, optional
        Whose options to take; soft observations by default.
    n_runs, seed : int
        As in :func:`pgm_places.sensing.simulated_moves.simulate_moves`.
    """
    return (model or HiddenMarkovModel(observation="soft")).with_counts(
        confusions=confusion_counts(truths, scores, n_labels),
        moves=simulate_moves(maps, n_labels, n_runs=n_runs, seed=seed),
        stays=simulate_moves(maps, n_labels, n_runs=n_runs, seed=seed, step_m=STAY_M),
    )
