"""Temperature scaling of beliefs."""

import dataclasses
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import ROWS_AT_ONCE, freeze
from pgm_places.errors import InputError
from pgm_places.inference.labeling import Labeling
from pgm_places.inference.problem import LabelingProblem, labelled_problems
from pgm_places.kernels.threads import run_parts
from pgm_places.options import Positive

Temperature = Positive | Literal["auto"]
"""The option of methods whose beliefs are tempered: a number, or the one that training found."""

HOTTEST = 100.0
"""Beliefs that are worth nothing at all would be given an endless temperature."""

PRECISION = 1e-6
"""Where the search ends, as a share of 1/T."""

LEAST_BELIEF = 1e-12
"""Smaller beliefs count as this one: in single precision they may be 0, which no power changes."""


def tempered(labeling: Labeling, temperature: float | Literal["auto"]) -> Labeling:
    """The labelling with beliefs ``b^(1/T) / sum b^(1/T)``; labels, score and status are the same.

    Methods on graphs are too sure of themselves: neighbours that see the same count as so many
    witnesses. Above 1 a temperature makes beliefs less sure, below 1 surer; which of two beliefs is
    the greater never changes (temperature scaling, Guo et al. 2017, equation 9).

    Parameters
    ----------
    labeling : Labeling
        N nodes, K labels. Without beliefs it comes back as it is.
    temperature : float or "auto"
        T, above 0; ``"auto"``, which no training has replaced, is 1.

    Examples
    --------
    >>> from pgm_places.inference.labeling import Status
    >>> found = Labeling(np.array([0]), Status.EXACT, beliefs=np.array([[0.8, 0.2]]))
    >>> tempered(found, 2.0).beliefs.round(3).tolist()
    [[0.667, 0.333]]
    """
    if labeling.beliefs is None or temperature in ("auto", 1.0):
        return labeling
    beliefs, power = np.empty_like(labeling.beliefs), 1 / float(temperature)

    def part(rows: slice) -> None:
        beliefs[rows] = _flattened(labeling.beliefs[rows], power)  # type: ignore[index]

    run_parts(part, len(beliefs), ROWS_AT_ONCE)
    return dataclasses.replace(labeling, beliefs=freeze(beliefs))


def likeliest_temperature(beliefs: Sequence[ArrayLike], truths: Sequence[ArrayLike]) -> float:
    """The temperature that makes the true labels of nodes likeliest, from 1 to 100.

    With l = log b it solves ``sum_i w_i (sum_k b_ik(T) l_ik - l_i,true) = 0``, the derivative of
    the cross entropy by 1/T, which rises with 1/T: the root is enclosed and bisected. Never below
    1: what is always right on a few nodes would else be made certain of everything.

    Parameters
    ----------
    beliefs : sequence of (N, K) float
        Of methods, in each of some graphs, that learned nothing from its labels.
    truths : sequence of (N,) int
        True labels, -1 where unknown. Every graph weighs the same.

    Raises
    ------
    InputError
        No node has a true label.

    Examples
    --------
    >>> likeliest_temperature([[[0.99, 0.01]] * 4], [[0, 0, 0, 1]]).__round__(2)
    4.18
    """
    parts = [_log_beliefs(*pair) for pair in zip(beliefs, truths, strict=True)]
    parts = [(log, label) for log, label in parts if len(label)]
    if not parts:
        raise InputError("no node has a true label, so no temperature can be found")
    at_truth = sum(float(log[np.arange(len(label)), label].mean()) for log, label in parts)

    def too_sure(power: float) -> bool:
        return sum(_expected(log, power) for log, _ in parts) > at_truth

    low, high = 1 / HOTTEST, 1.0
    if not too_sure(high):
        return 1.0
    while high - low > PRECISION * high:
        middle = (low + high) / 2
        low, high = (low, middle) if too_sure(middle) else (middle, high)
    return 1 / high


def _log_beliefs(beliefs: ArrayLike, truth: ArrayLike) -> tuple[NDArray[Any], NDArray[np.int64]]:
    """(n, K) logarithms of the beliefs of labelled nodes, and (n,) their labels."""
    known = np.flatnonzero(np.asarray(truth) >= 0)
    log = np.log(np.maximum(np.asarray(beliefs, np.float64)[known], LEAST_BELIEF))
    return log, np.asarray(truth, np.int64)[known]


def _expected(log_beliefs: NDArray[Any], power: float) -> float:
    """The mean over nodes of what beliefs of that power expect of their logarithms."""
    return float((_flattened(np.exp(log_beliefs), power) * log_beliefs).sum(axis=1).mean())


def calibrated(
    backend: Any, problems: Sequence[LabelingProblem], labelings: Sequence[NDArray[np.int64]]
) -> Any:
    """The method with the temperature that fits its beliefs on labelled problems.

    One whose temperature is not ``"auto"``, or that has no beliefs, comes back as it is, as does
    any where no labelled node is left. Nodes whose label the problem itself knows do not count:
    their beliefs are given. The unaries should be of a classifier that has not seen the labelled
    nodes: on nodes that it was fitted on it is right whenever it is sure.
    """
    if getattr(backend, "temperature", None) != "auto" or not backend.gives_beliefs:
        return backend
    pairs = [
        (item, _unknown(item, labels)) for item, labels in labelled_problems(problems, labelings)
    ]
    pairs = [(item, truth) for item, truth in pairs if (truth >= 0).any()]
    if not pairs:
        return backend
    beliefs = [backend.infer(problem).beliefs for problem, _ in pairs]
    factor = likeliest_temperature(beliefs, [truth for _, truth in pairs])
    return dataclasses.replace(backend, temperature=factor)


def _unknown(problem: LabelingProblem, truth: NDArray[np.int64]) -> NDArray[np.int64]:
    """The labels of the nodes that the problem itself does not know, -1 elsewhere."""
    return truth if problem.known is None else np.where(problem.known >= 0, -1, truth)


def _flattened(beliefs: NDArray[Any], power: float) -> NDArray[Any]:
    """Rows to a power, summing to one; the greatest is 1 before, so that none is all zeros."""
    flattened = (beliefs / beliefs.max(axis=1, keepdims=True)) ** beliefs.dtype.type(power)
    flattened /= flattened.sum(axis=1, keepdims=True)
    return flattened
