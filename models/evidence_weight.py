"""How much a chain's observations and its rare labels count: fitted on training sequences."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pgm_places.evaluation.confusion import accuracy, balanced_accuracy, confusion_matrix
from pgm_places.inference.problem import LabelingProblem
from pgm_places.solvers.relaxation import starting_beliefs

Observation = Literal["posterior", "hard", "soft"]

# Of a transition that was learned to be impossible, where labels are known that prove it wrong: so
# little that it is taken only there, and enough for floats when multiplied by a belief.
LEAST = 1e-200


def log_likelihood(
    unary: NDArray[np.float64],
    observation: Observation,
    confusion: NDArray[np.float64],
    prior: NDArray[np.float64],
    weight: float,
) -> NDArray[np.float64]:
    """(T, K) ``log P(z_t | l)`` up to a constant per step; -inf where a label is forbidden.

    Labels that are allowed are alike where the classifier's confusions exclude them all, and where
    it says nothing of any.

    Parameters
    ----------
    unary : (T, K) float
        Log-probabilities of the labels from the classifier; -inf forbids a label.
    observation : {"posterior", "hard", "soft"}
        As of :class:`pgm_places.models.hmm.HiddenMarkovModel`.
    confusion : (K, K) float
        Probability of the classifier's best label (column) at each true one (row).
    prior : (K,) float
        Share of each label in training.
    weight : float
        Exponent of the likelihood.
    """
    scores = np.full(unary.shape, -np.inf)
    said = np.flatnonzero(unary.max(axis=1, initial=-np.inf) > -np.inf)
    with np.errstate(divide="ignore"):
        if observation == "hard":
            scores[said] = np.log(confusion.T)[unary[said].argmax(axis=1)]
        elif observation == "soft":
            scores[said] = np.log(starting_beliefs(unary[said]) @ confusion.T)
        else:
            scores[said] = unary[said] - np.log(np.where(prior > 0, prior, 1.0))
    scores *= weight
    allowed = unary > -np.inf
    restricted = ~allowed.all(axis=1)
    scores[restricted] = np.where(allowed[restricted], scores[restricted], -np.inf)
    excluded = restricted & (scores.max(axis=1, initial=-np.inf) == -np.inf)
    scores[excluded] = np.where(allowed[excluded], 0.0, -np.inf)
    return scores


def possible(probabilities: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same with the least probability in place of 0, for what evidence says has happened."""
    return np.maximum(probabilities, LEAST)


WEIGHTS = (0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0)
"""Weights of the evidence that are tried."""

BALANCES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Exponents of the labels' shares that are tried."""


def best_weights(
    labels_at: Callable[[float, float, LabelingProblem], NDArray[np.integer]],
    problems: Sequence[LabelingProblem],
    labelings: Sequence[NDArray[np.int64]],
    *,
    weights: Sequence[float] = WEIGHTS,
    balances: Sequence[float] = BALANCES,
    node_weights: Sequence[NDArray[np.float64]] | None = None,
) -> tuple[float, float]:
    """The weight of the evidence and the exponent of the shares with the best labels.

    Best is the mean of accuracy and balanced accuracy over the known steps: accuracy alone would
    give up what is rare and short, such as doorways, for long runs of what is frequent. Of equals,
    the largest weight and the least exponent. An exponent above the least one must not cost
    accuracy: rare labels are named where that is free.

    Parameters
    ----------
    labels_at : function of a weight, an exponent and a problem
        The labels (N,) that the model infers with these, in the mode that it will be used in.
    problems, labelings
        Chains with the unaries of a classifier that has not seen them, and the true label index
        (N,) of each step, -1 where it is unknown.
    weights, balances : sequence of float
        What is tried.
    node_weights : sequence of (N,) float, optional
        What each step counts.
    """
    truth = np.concatenate([np.asarray(labels) for labels in labelings])
    known = np.flatnonzero(truth >= 0)
    counts = None if node_weights is None else np.concatenate(node_weights)[known]

    def best_of(tried: Sequence[float], least: float) -> tuple[tuple[float, float], float]:
        """The best pair with at least that accuracy, and its accuracy."""
        best, highest, right = (1.0, 0.0), -1.0, 0.0
        for weight in sorted(weights, reverse=True):
            for balance in tried:
                answers = np.concatenate([labels_at(weight, balance, item) for item in problems])
                confusion = confusion_matrix(truth[known], answers[known], weights=counts)
                share = float(accuracy(confusion))
                quality = share + float(balanced_accuracy(confusion))
                if share >= least and quality > highest + 1e-9:
                    best, highest, right = (weight, balance), quality, share
        return best, right

    plain, right = best_of(sorted(balances)[:1], 0.0)
    if len(balances) == 1:
        return plain
    return best_of(sorted(balances), right - 1e-9)[0]


def fitted_by_mode(
    model: Any,
    modes: Sequence[str],
    problems: Sequence[LabelingProblem],
    labelings: Sequence[NDArray[np.int64]],
    node_weights: Sequence[NDArray[np.float64]] | None = None,
) -> dict[str, Any]:
    """The best weights and exponents of each mode, by name; None for what is not to be fitted.

    ``model`` is a hidden Markov model with options to be fitted. Viterbi's sequence does not depend
    on the exponent. Other arguments as of :func:`best_weights`.
    """
    weight, balance = model.evidence_weight, model.balance
    weights = WEIGHTS if weight == "fitted" else (weight,)
    balances = BALANCES if balance == "fitted" else (balance,)

    def labels_at(
        mode: Any, weight: float, balance: float, problem: LabelingProblem
    ) -> NDArray[np.integer]:
        other = replace(model, mode=mode, evidence_weight=weight, balance=balance)
        labels: NDArray[np.int64] = other.infer(problem).labels
        return labels

    pairs = [
        best_weights(
            partial(labels_at, mode),
            problems,
            labelings,
            weights=weights,
            balances=(0.0,) if mode == "viterbi" else balances,
            node_weights=node_weights,
        )
        for mode in modes
    ]
    best = np.array(pairs).T
    return {
        "fitted_weights": best[0] if weight == "fitted" else None,
        "fitted_balances": best[1] if balance == "fitted" else None,
    }


def weights_at(
    weights: NDArray[np.float64] | None, from_m: float, to_m: float
) -> NDArray[np.float64] | None:
    """Fitted weights for updates farther apart: they grow with the distance, up to 1.

    Fewer observations say as much per metre. For updates nearer to each other they stay.
    """
    return None if weights is None else np.minimum(weights * max(to_m / from_m, 1.0), 1.0)
