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
"""The option of methods with tempered beliefs: a number, or "auto", set by training."""

HOTTEST = 100.0
"""The largest temperature; for uninformative beliefs the optimum is infinite."""

PRECISION = 1e-6
"""Relative tolerance of the search for 1/T."""

LEAST_BELIEF = 1e-12
"""Lower bound of beliefs: in single precision they may be 0, which no power changes."""


def tempered(labeling: Labeling, temperature: float | Literal["auto"]) -> Labeling:
    """The labelling with beliefs ``b^(1/T) / sum b^(1/T)`` (Guo et al. 2017, equation 9).

    Temperatures above 1 lower the confidence; the order of beliefs, labels, score and status stay.
    ``"auto"`` without training is 1.

    Examples
    --------
    >>> from pgm_places.inference.labeling import Status
    >>> labeling = Labeling(np.array([0]), Status.EXACT, beliefs=np.array([[0.8, 0.2]]))
    >>> tempered(labeling, 2.0).beliefs.round(3).tolist()
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
    """The maximum-likelihood temperature for the true labels of nodes, from 1 to 100.

    With l = log b it solves ``sum_i w_i (sum_k b_ik(T) l_ik - l_i,true) = 0`` by bisection over
    1/T. Below 1, a few nodes, all labelled correctly, would make every belief certain. Held-out
    beliefs (N, K), true labels (N,), -1 where unknown; all graphs have equal weight. InputError if
    no node has a true label.

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


def _log_beliefs(
    beliefs: ArrayLike, truth: ArrayLike
) -> tuple[NDArray[np.generic], NDArray[np.int64]]:
    """(n, K) logarithms of the beliefs of labelled nodes, and (n,) their labels."""
    known = np.flatnonzero(np.asarray(truth) >= 0)
    log = np.log(np.maximum(np.asarray(beliefs, np.float64)[known], LEAST_BELIEF))
    return log, np.asarray(truth, np.int64)[known]


def _expected(log_beliefs: NDArray[Any], power: float) -> float:
    """The mean over nodes of the expected log-belief under beliefs to a power."""
    return float((_flattened(np.exp(log_beliefs), power) * log_beliefs).sum(axis=1).mean())


def calibrated(
    backend: Any, problems: Sequence[LabelingProblem], labelings: Sequence[NDArray[np.int64]]
) -> Any:
    """The method with a temperature fitted to its beliefs on labelled problems.

    Unaries should be held-out scores; nodes with known labels do not count. A method without
    beliefs or with a fixed temperature, or without labelled nodes, is returned unchanged.
    """
    if getattr(backend, "temperature", None) != "auto" or not backend.gives_beliefs:
        return backend
    pairs = [
        (example, _unknown(example, labels))
        for example, labels in labelled_problems(problems, labelings)
    ]
    pairs = [(example, truth) for example, truth in pairs if (truth >= 0).any()]
    if not pairs:
        return backend
    beliefs = [backend.infer(problem).beliefs for problem, _ in pairs]
    factor = likeliest_temperature(beliefs, [truth for _, truth in pairs])
    return dataclasses.replace(backend, temperature=factor)


def _unknown(problem: LabelingProblem, truth: NDArray[np.int64]) -> NDArray[np.int64]:
    """The labels of the nodes without a known label in the problem, -1 elsewhere."""
    return truth if problem.known is None else np.where(problem.known >= 0, -1, truth)


def _flattened(beliefs: NDArray[Any], power: float) -> NDArray[Any]:
    """Rows to a power, normalised; scaled to a maximum of 1 before, to avoid underflow."""
    flattened = (beliefs / beliefs.max(axis=1, keepdims=True)) ** beliefs.dtype.type(power)
    flattened /= flattened.sum(axis=1, keepdims=True)
    return flattened
