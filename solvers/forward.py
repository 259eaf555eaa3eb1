"""Hidden Markov chains on arrays: filter, smoother and most probable path.

Observations that the model says cannot happen are left out, as if nothing had been seen in that
step, and their steps are reported; beliefs never become NaN.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array, number_array
from pgm_places.errors import InputError
from pgm_places.solvers.chain_logs import beliefs_in_logs, exceeds_floats
from pgm_places.solvers.chain_tables import SUM_TOLERANCE, Chain, check_chain, check_tables

__all__ = [
    "ChainBeliefs",
    "ChainPath",
    "ForwardFilter",
    "filter_step",
    "filtered_beliefs",
    "smoothed_beliefs",
    "viterbi",
]

STEPS_AT_ONCE = 8192  # log-likelihoods of so many steps stay in cache between check and kernel
LANES_WIDE = 8  # labels of a chain that one vector holds
FEWER_ALONE = 4  # so few labels are faster one by one, but in the filter
FEW_LABELS = 8  # kernels are compiled for each of these numbers of labels, and for any larger one


@dataclass(frozen=True, eq=False)
class ChainBeliefs:
    """Beliefs along a chain.

    Parameters
    ----------
    beliefs : (T, K) float
        Probability of each label at each step.
    log_evidence : float
        Log-probability of all observations (up to the constants of the likelihoods); ``-inf`` if
        any is impossible.
    impossible : (M,) int
        Steps whose observation has probability 0 given all before.
    """

    beliefs: NDArray[np.float64]
    log_evidence: float
    impossible: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class ChainPath:
    """The most probable labels along a chain.

    Parameters
    ----------
    labels : (T,) int
        Label index per step.
    log_probability : float
        Joint log-probability of labels and observations, without those that are impossible.
    impossible : (M,) int
        Steps that no path reaches together with their observation.
    """

    labels: NDArray[np.int64]
    log_probability: float
    impossible: NDArray[np.int64]


def filtered_beliefs(
    initial: ArrayLike,
    transition: ArrayLike,
    log_likelihood: ArrayLike,
    *,
    actions: ArrayLike | None = None,
) -> ChainBeliefs:
    """Beliefs from the observations up to each step (paper eq. 3).

    ``Bel(l_t) = alpha P(z_t | l_t) sum_m P(l_t | m, u_{t-1}) Bel(m_{t-1})``

    Likelihoods may differ by any factor, and add up to any over many steps.

    Parameters
    ----------
    initial : (K,) float
        Probabilities of the labels at the first step, before its observation.
    transition : (K, K) or (A, K, K) float
        ``transition[..., m, l]`` is the probability of ``l`` after ``m``; one table, or one for
        each of A actions. Rows sum to 1.
    log_likelihood : (T, K) float
        ``log P(z_t | l)`` up to a constant per step; ``-inf`` is probability 0.
    actions : (T - 1,) int, optional
        Number of the action between each step and the next; needed where A > 1.

    Examples
    --------
    >>> stay = [[0.9, 0.1], [0.1, 0.9]]
    >>> found = filtered_beliefs([0.5, 0.5], stay, np.log([[0.8, 0.2], [0.5, 0.5]]))
    >>> found.beliefs.round(3).tolist()
    [[0.8, 0.2], [0.74, 0.26]]
    """
    return _explained(check_chain(initial, transition, log_likelihood, actions), smooth=False)


def smoothed_beliefs(
    initial: ArrayLike,
    transition: ArrayLike,
    log_likelihood: ArrayLike,
    *,
    actions: ArrayLike | None = None,
) -> ChainBeliefs:
    """Beliefs from all observations, before and after; arguments as :func:`filtered_beliefs`.

    Examples
    --------
    >>> stay = [[0.9, 0.1], [0.1, 0.9]]
    >>> found = smoothed_beliefs([0.5, 0.5], stay, np.log([[0.5, 0.5], [0.8, 0.2]]))
    >>> found.beliefs.round(3).tolist()
    [[0.74, 0.26], [0.8, 0.2]]
    """
    return _explained(check_chain(initial, transition, log_likelihood, actions), smooth=True)


def viterbi(
    initial: ArrayLike,
    transition: ArrayLike,
    log_likelihood: ArrayLike,
    *,
    actions: ArrayLike | None = None,
) -> ChainPath:
    """The labels with the largest joint probability; arguments as :func:`filtered_beliefs`.

    Ties go to the smaller label.

    Examples
    --------
    >>> stay = [[0.9, 0.1], [0.1, 0.9]]
    >>> viterbi([0.5, 0.5], stay, np.log([[0.8, 0.2], [0.4, 0.6], [0.8, 0.2]])).labels.tolist()
    [0, 0, 0]
    """
    from pgm_places.solvers._forward_kernels import trace_back

    start, arrival, observed, led = check_chain(initial, transition, log_likelihood, actions)
    n_steps, n_labels = observed.shape
    if n_labels > np.iinfo(np.int16).max:
        raise InputError(f"viterbi takes at most {np.iinfo(np.int16).max} labels, got {n_labels}")
    with np.errstate(divide="ignore"):
        score, log_arrival = np.log(start), np.log(arrival)
    in_lanes = FEWER_ALONE < n_labels <= LANES_WIDE
    narrow = np.int8 if n_labels <= FEW_LABELS else np.int16
    origin = np.empty((n_steps, LANES_WIDE if in_lanes else n_labels), narrow)
    impossible = np.empty(n_steps, np.bool_)
    go_on = _viterbi_in_lanes if in_lanes else _viterbi_one_by_one
    score, shift = go_on(score, log_arrival, observed, led, origin, impossible)
    labels, last = np.empty(n_steps, np.int64), int(score.argmax()) if n_labels else 0
    trace_back(origin, last, labels)
    total = shift + float(score[last]) if n_steps else 0.0
    return ChainPath(labels, total, np.flatnonzero(impossible))


def filter_step(
    belief: ArrayLike, transition: ArrayLike, log_likelihood: ArrayLike
) -> tuple[NDArray[np.float64], bool]:
    """The belief (K,) one step on, and whether the observation was possible at all.

    Parameters
    ----------
    belief : (K,) float
        Belief at the step before.
    transition : (K, K) float
        Probability of each label (column) after each (row).
    log_likelihood : (K,) float
        ``log P(z | l)`` of the new observation.

    Examples
    --------
    >>> belief, possible = filter_step([0.8, 0.2], [[0.9, 0.1], [0.1, 0.9]], np.log([0.5, 0.5]))
    >>> belief.round(3).tolist(), possible
    ([0.74, 0.26], True)
    """
    n_labels = len(np.asarray(log_likelihood, np.float64))
    return ForwardFilter(np.full(n_labels, 1.0 / n_labels), transition).step(log_likelihood, belief)


class ForwardFilter:
    """A chain filtered step by step, its tables checked once for all steps.

    Parameters
    ----------
    initial, transition
        As in :func:`filtered_beliefs`.
    """

    def __init__(self, initial: ArrayLike, transition: ArrayLike) -> None:
        n_labels = len(np.asarray(initial))
        self._start, arrival = check_tables(initial, transition, n_labels)
        self._run = _filter_for(arrival)

    def step(
        self, log_likelihood: ArrayLike, belief: ArrayLike | None = None, action: int = 0
    ) -> tuple[NDArray[np.float64], bool]:
        """The belief (K,) one step on, and whether the observation was possible at all.

        Parameters
        ----------
        log_likelihood : (K,) float
            ``log P(z | l)`` of the new observation.
        belief : (K,) float, optional
            Belief at the step before; None at the first. A label of belief 0 stays at 0, also where
            it was more but too little for a float, until a transition leads back to it.
        action : int
            Which of the transition's tables led here.

        Raises
        ------
        InputError
            An array has another shape, the likelihood NaN or +inf, or the belief does not sum to 1.
        """
        rows = number_array("log_likelihood", log_likelihood)[None]
        before = self._start if belief is None else number_array("belief", belief)
        for name, values in (("log_likelihood", rows[0]), ("belief", before)):
            if values.shape != self._start.shape:
                raise InputError(f"{name} must have shape {self._start.shape}, got {values.shape}")
        if not rows.max() < np.inf:  # also true of NaN
            finite_array("log_likelihood", rows[0], ("K",), allow_minus_inf=True)
        if not (before.min() >= 0 and abs(before.sum() - 1.0) <= SUM_TOLERANCE):
            raise InputError(f"belief must hold probabilities that sum to one, got {before}")
        row, impossible = np.empty(rows.size + LANES_WIDE), np.empty(1, np.bool_)
        self._run(before, belief is not None, rows, np.array([action]), row, impossible)
        return row[: rows.size], not impossible[0]


def _each(n_labels: int) -> Any:
    """A 0.0 per label: a tuple, whose length kernels are compiled for, if there are few."""
    return (0.0,) * n_labels if 0 < n_labels <= FEW_LABELS else np.zeros(n_labels)


def _blocks(n_steps: int, size: int | None = None) -> Iterator[slice]:
    """Slices of as many steps, by default few enough that all their numbers stay in cache."""
    size = size or STEPS_AT_ONCE
    for begin in range(0, n_steps, size):
        yield slice(begin, min(begin + size, n_steps))


def _checked(observed: NDArray[np.float64], part: slice) -> NDArray[np.float64]:
    """Some rows of the log-likelihoods (T, K), looked at just before they are needed in cache."""
    rows = observed[part]
    if not rows.max(initial=-np.inf) < np.inf:  # also true of NaN
        finite_array("log_likelihood", observed, ("T", "K"), allow_minus_inf=True)
    return rows


def _rows_in_lanes(
    observed: NDArray[np.float64], size: int | None = None
) -> Iterator[tuple[slice, NDArray[np.float64]]]:
    """Slices of the steps, and their rows in one, which has room behind it."""
    for part in _blocks(len(observed), size):
        behind = observed[part.start : part.stop + LANES_WIDE]
        is_last = len(behind) < part.stop - part.start + LANES_WIDE
        yield part, _in_a_row(observed[part], 0.0) if is_last else behind.reshape(1, -1)


_Run = Callable[
    [
        NDArray[np.float64],
        bool,
        NDArray[np.float64],
        NDArray[np.int64],
        NDArray[np.float64],
        NDArray[np.bool_],
    ],
    float,
]
"""Writes the beliefs of some steps in a row, and which are impossible; the log of the evidence.

It is given the belief (K,) before, whether anything has begun, the log-likelihoods (T, K), and the
actions that led to each step."""


def _explained(chain: Chain, *, smooth: bool) -> ChainBeliefs:
    """Filtered or smoothed beliefs: as floats, or by logarithms where floats lose a label."""
    start, arrival, observed, led = chain
    row = np.empty(observed.size + LANES_WIDE)  # a vector ends behind the last belief
    impossible = np.empty(len(observed), np.bool_)
    evidence = _filter_for(arrival)(start, False, observed, led, row, impossible)
    beliefs = row[: observed.size].reshape(observed.shape)
    if exceeds_floats(chain, beliefs, impossible):
        evidence = beliefs_in_logs(chain, beliefs, impossible, smooth=smooth)
    elif smooth:
        in_lanes = FEWER_ALONE < observed.shape[1] <= LANES_WIDE
        (_smooth_in_lanes if in_lanes else _smooth_one_by_one)(arrival, led, beliefs)
    return ChainBeliefs(beliefs, evidence, np.flatnonzero(impossible))


def _filter_for(arrival: NDArray[np.float64]) -> _Run:
    """The filter for arrivals (A, K, K), in vectors where there are few labels."""
    if arrival.shape[1] <= LANES_WIDE:
        return partial(_filter_in_lanes, _by_origin(arrival, 0.0))
    return partial(_filter_one_by_one, arrival)


def _filter_in_lanes(
    table: NDArray[np.float64],
    start: NDArray[np.float64],
    begun: bool,
    observed: NDArray[np.float64],
    led: NDArray[np.int64],
    row: NDArray[np.float64],
    impossible: NDArray[np.bool_],
) -> float:
    from pgm_places.solvers._chain_lane_kernels import filter_lanes

    belief, each, evidence = _in_a_row(start, 0.0), _each(len(start)), 0.0
    most = max(len(observed) - LANES_WIDE, LANES_WIDE)
    for part, flat in _rows_in_lanes(observed, most):  # nearly all at once, and those at the end
        begun, out = begun or part.start > 0, row[None, part.start * len(start) :]
        evidence += filter_lanes(belief, begun, table, led[part], flat, out, impossible[part], each)
    if np.isnan(evidence):
        finite_array("log_likelihood", observed, ("T", "K"), allow_minus_inf=True)
    return evidence


def _filter_one_by_one(
    arrival: NDArray[np.float64],
    start: NDArray[np.float64],
    begun: bool,
    observed: NDArray[np.float64],
    led: NDArray[np.int64],
    row: NDArray[np.float64],
    impossible: NDArray[np.bool_],
) -> float:
    from pgm_places.solvers._forward_kernels import Steps, filter_steps, subtract_best

    belief, evidence = start.copy(), 0.0
    beliefs = row[: observed.size].reshape(observed.shape)
    for part in _blocks(len(observed)):
        rows = _checked(observed, part)
        scaled, scale = np.empty(rows.shape), np.empty(len(rows))
        subtract_best(rows, scaled, scale)
        np.exp(scaled, out=scaled)
        steps = Steps(led[part], rows, scaled, scale, beliefs[part], impossible[part])
        evidence += filter_steps(belief, begun or part.start > 0, arrival, steps)
        evidence += float(scale.sum())
    return evidence


def _smooth_one_by_one(
    arrival: NDArray[np.float64], led: NDArray[np.int64], beliefs: NDArray[np.float64]
) -> None:
    """Turn filtered beliefs (T, K) into smoothed ones, in place, for any number of labels."""
    from pgm_places.solvers._forward_kernels import smooth_steps

    smooth_steps(arrival, led, beliefs, _each(beliefs.shape[1]))


def _smooth_in_lanes(
    arrival: NDArray[np.float64], led: NDArray[np.int64], beliefs: NDArray[np.float64]
) -> None:
    """The same for five to eight labels; steps that lanes cannot take are taken one by one.

    The first of them is the last of the chain, which leaves room behind the rows of the others.
    """
    from pgm_places.solvers._chain_lane_kernels import smooth_lanes

    arriving, leaving = _by_origin(arrival, 0.0), _by_origin(arrival.transpose(0, 2, 1), 0.0)
    row, last, each = beliefs.reshape(1, -1), len(beliefs) - 1, _each(beliefs.shape[1])
    while last > 0:
        last -= 1
        _smooth_one_by_one(arrival, led[last : last + 2], beliefs[last : last + 2])
        last = smooth_lanes(arriving, leaving, led, row, last, each)


def _by_origin(arrival: NDArray[np.float64], fill: float) -> NDArray[np.float64]:
    """(A K, 8) what leads to each label, a row per action and label before."""
    n_actions, n_labels = arrival.shape[:2]
    table = np.full((n_actions, n_labels, LANES_WIDE), fill)
    table[..., :n_labels] = arrival.transpose(0, 2, 1)
    return table.reshape(-1, LANES_WIDE)


def _in_a_row(values: NDArray[np.float64], fill: float) -> NDArray[np.float64]:
    """(1, n + some) numbers, and at least eight lanes behind the first."""
    row = np.empty((1, values.size + LANES_WIDE))
    row[0, : values.size], row[0, values.size :] = values.reshape(-1), fill
    return row


def _viterbi_in_lanes(
    score: NDArray[np.float64],
    log_arrival: NDArray[np.float64],
    observed: NDArray[np.float64],
    led: NDArray[np.int64],
    origin: NDArray[Any],
    impossible: NDArray[np.bool_],
) -> tuple[NDArray[np.float64], float]:
    """The scores of the best paths (K,), and what was taken off them; writes the origins."""
    from pgm_places.solvers._chain_lane_kernels import viterbi_lanes

    reach, table, shift = _in_a_row(score, -np.inf), _by_origin(log_arrival, -np.inf), 0.0
    for part, flat in _rows_in_lanes(observed):
        _checked(observed, part)
        begun = part.start > 0
        shift += viterbi_lanes(
            reach, begun, table, led[part], flat, origin[part], impossible[part], _each(len(score))
        )
    return reach[0, : len(score)], shift


def _viterbi_one_by_one(
    score: NDArray[np.float64],
    log_arrival: NDArray[np.float64],
    observed: NDArray[np.float64],
    led: NDArray[np.int64],
    origin: NDArray[Any],
    impossible: NDArray[np.bool_],
) -> tuple[NDArray[np.float64], float]:
    """The same for any number of labels."""
    from pgm_places.solvers._forward_kernels import viterbi_steps

    shift, each = 0.0, _each(len(score))
    for part in _blocks(len(observed)):
        rows, begun = _checked(observed, part), part.start > 0
        shift += viterbi_steps(
            score, begun, log_arrival, led[part], rows, origin[part], impossible[part], each
        )
    return score, shift
