"""Hidden Markov chains on arrays: filter, smoother and most probable path.

Observations of probability 0 under the model are skipped, as if the step had no observation, and
their steps are reported; beliefs never become NaN.

A belief below ``exp(-700)`` of the largest one underflows to 0. That is harmless where all
transitions are possible: the label's own remainder is then negligible compared with the probability
that arrives from other labels. Where a transition is impossible, this remainder may be the only
probability left when later observations rule out all other labels: the chain is then filtered in
logarithms.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import (
    finite_array,
    integer_array,
    number_array,
    require_shape,
    row_blocks,
)
from pgm_places._core import (
    filter_chain,
    filter_in_logs,
    smooth_chain,
    smooth_in_logs,
    subtract_best,
    trace_back,
    viterbi_chain,
)
from pgm_places.errors import InputError

SUM_TOLERANCE = 1e-6
"""Tolerance of probabilities that must sum to one."""

# Larger beliefs have full precision, since the sum that divides them is at least 1e-200.
RARE_BELIEF = 1e-100

# If all transitions are as probable as that, a label's former belief of 1e-107 does not count.
LEAST_ARRIVAL = 1e-90

# Beliefs above the former, times such transitions and the sum of 1e-100, are floats in full.
RARE_ARRIVAL = 1e-50

STEPS_AT_ONCE = 8192  # log-likelihoods that stay in cache between check and kernel


class Chain(NamedTuple):
    """A hidden Markov chain of T steps, K labels, and A transition tables (one per action)."""

    start: NDArray[np.float64]
    """(K,) probabilities at the first step, before its observation."""
    transition_t: NDArray[np.float64]
    """(A, K, K) probability of each label (row) after each label before (column)."""
    observed: NDArray[np.float64]
    """(T, K) log-likelihoods; checked for NaN and +inf at first use."""
    action: NDArray[np.int64]
    """(T,) the transition table before each step; the first entry is not used."""


def markov_chain(
    initial: ArrayLike,
    transition: ArrayLike,
    log_likelihood: ArrayLike,
    actions: ArrayLike | None = None,
) -> Chain:
    """A hidden Markov chain with its observations.

    ``initial`` (K,) holds probabilities before the first observation. ``transition[..., m, l]``,
    (K, K) or one table for each of A actions, is the probability of ``l`` after ``m``; rows sum to
    1. ``log_likelihood`` (T, K) is ``log P(z_t | l)`` up to a constant per step, of any range;
    ``-inf`` is probability 0. ``actions`` (T - 1,) are needed where A > 1.
    """
    rows = np.asarray(log_likelihood, np.float64)
    if rows.ndim != 2:
        finite_array("log_likelihood", rows, ("T", "K"), allow_minus_inf=True)
    n_steps, n_labels = rows.shape
    start, transition_t = check_tables(initial, transition, n_labels)
    action = np.zeros(n_steps, np.int64)
    if actions is not None:
        high = len(transition_t)
        action[1:] = integer_array("actions", actions, (max(n_steps - 1, 0),), low=0, high=high)
    elif len(transition_t) != 1:
        raise InputError(f"transition has {len(transition_t)} tables, so actions are needed")
    return Chain(start, transition_t, np.ascontiguousarray(rows), action)


def check_tables(
    initial: ArrayLike, transition: ArrayLike, n_labels: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Start (K,) and transition_t (A, K, K), by label and label before."""
    start = check_start(initial, n_labels)
    tables = np.asarray(transition, np.float64)
    tables = tables[None] if tables.ndim == 2 else tables
    tables = finite_array("transition", tables, ("A", n_labels, n_labels))
    require_distributions("transition", tables)
    return start, np.ascontiguousarray(tables.transpose(0, 2, 1))


def check_start(initial: ArrayLike, n_labels: int) -> NDArray[np.float64]:
    """A copy of the probabilities (K,) at the first step."""
    start = finite_array("initial", initial, (n_labels,))
    require_distributions("initial", start)
    return np.array(start)


def require_distributions(name: str, values: NDArray[np.float64]) -> None:
    """Refuse rows that hold no probabilities or do not sum to one."""
    if values.min(initial=0.0) < 0 or abs(values.sum(axis=-1) - 1.0).max(initial=0.0) > (
        SUM_TOLERANCE
    ):
        raise InputError(f"{name} must hold probabilities that sum to one in every row")


def exceeds_floats(
    chain: Chain, beliefs: NDArray[np.float64], impossible: NDArray[np.bool_]
) -> bool:
    """Whether filtered beliefs (T, K) may have lost a label to underflow that later steps need.

    The observations of ``impossible`` steps (T,) were skipped.
    """
    if chain.transition_t.min(initial=1.0) >= LEAST_ARRIVAL:
        return False
    n_uses = np.bincount(chain.action[1:], minlength=len(chain.transition_t))
    tables = chain.transition_t[n_uses > 0]
    if tables.min(initial=1.0) >= LEAST_ARRIVAL:
        return False
    if tables.min(initial=1.0, where=tables > 0) < RARE_ARRIVAL:
        return True
    for part in row_blocks(len(beliefs), STEPS_AT_ONCE):
        some = beliefs[part]
        if some.min() >= RARE_BELIEF:
            continue
        step, label = np.nonzero(some < RARE_BELIEF)
        step += part.start
        possible = (chain.observed[step, label] > -np.inf) | impossible[step]
        step, label = step[possible], label[possible]
        coming = (chain.transition_t[chain.action[step], label] * beliefs[step - 1]).sum(axis=1)
        if np.where(step == 0, chain.start[label], coming).any():
            return True
    return False


def beliefs_in_logs(
    chain: Chain, beliefs: NDArray[np.float64], impossible: NDArray[np.bool_], *, smooth: bool
) -> float:
    """Write filtered or smoothed beliefs (T, K) and impossible steps (T,); the log-evidence."""
    with np.errstate(divide="ignore"):
        start, transition_t = np.log(chain.start), np.log(chain.transition_t)
    scaled, best = np.empty(beliefs.shape), np.empty(len(beliefs))
    subtract_best(chain.observed, scaled, best)
    logs = np.empty(beliefs.shape)
    evidence = filter_in_logs(start, transition_t, chain.action, scaled, logs, impossible)
    if smooth:
        leaving = np.ascontiguousarray(transition_t.transpose(0, 2, 1))
        smooth_in_logs(transition_t, leaving, chain.action, logs)
    np.exp(logs, out=beliefs)
    beliefs /= beliefs.sum(axis=1, keepdims=True)
    return evidence + float(best.sum())


class _Steps(NamedTuple):
    """A block of steps of a chain, and the filter's output for it."""

    action: NDArray[np.int64]
    """(n,) the action before each step."""
    log_likelihood: NDArray[np.float64]
    """(n, K)."""
    likelihood: NDArray[np.float64]
    """(n, K) its exponential, up to a factor per step."""
    scale: NDArray[np.float64]
    """(n,) whose logarithm is here."""
    beliefs: NDArray[np.float64]
    """(n, K), written."""
    impossible: NDArray[np.bool_]
    """(n,), written: whether the observation has probability 0 given the earlier ones."""


@dataclass(frozen=True, eq=False)
class ChainBeliefs:
    """Beliefs along a chain."""

    beliefs: NDArray[np.float64]
    """(T, K) probability of each label at each step."""
    log_evidence: float
    """Log-probability of all observations (up to the constants of the likelihoods); ``-inf`` if any
    is impossible."""
    impossible: NDArray[np.int64]
    """(M,) steps whose observation has probability 0 given the earlier ones."""


@dataclass(frozen=True, eq=False)
class ChainPath:
    """The most probable labels along a chain."""

    labels: NDArray[np.int64]
    """(T,) label index per step."""
    log_probability: float
    """Joint log-probability of labels and observations, without impossible observations."""
    impossible: NDArray[np.int64]
    """(M,) steps whose observation has probability 0 on every path."""


def filtered_beliefs(chain: Chain) -> ChainBeliefs:
    """Beliefs from the observations up to each step (paper eq. 3).

    ``Bel(l_t) = alpha P(z_t | l_t) sum_m P(l_t | m, u_{t-1}) Bel(m_{t-1})``

    Examples
    --------
    >>> from pgm_places.solvers.forward import markov_chain
    >>> stay = [[0.9, 0.1], [0.1, 0.9]]
    >>> chain = markov_chain([0.5, 0.5], stay, np.log([[0.8, 0.2], [0.5, 0.5]]))
    >>> filtered_beliefs(chain).beliefs.round(3).tolist()
    [[0.8, 0.2], [0.74, 0.26]]
    """
    return _explained(chain, smooth=False)


def smoothed_beliefs(chain: Chain) -> ChainBeliefs:
    """Beliefs from all observations, before and after."""
    return _explained(chain, smooth=True)


def viterbi(chain: Chain) -> ChainPath:
    """The labels with the largest joint probability; ties go to the smaller label.

    Examples
    --------
    >>> from pgm_places.solvers.forward import markov_chain
    >>> stay = [[0.9, 0.1], [0.1, 0.9]]
    >>> chain = markov_chain([0.5, 0.5], stay, np.log([[0.8, 0.2], [0.4, 0.6], [0.8, 0.2]]))
    >>> viterbi(chain).labels.tolist()
    [0, 0, 0]
    """
    _check(chain)
    start, transition_t, observed, action = chain
    n_steps, n_labels = observed.shape
    if n_labels > np.iinfo(np.int16).max:
        raise InputError(f"viterbi takes at most {np.iinfo(np.int16).max} labels, got {n_labels}")
    with np.errstate(divide="ignore"):
        score, log_transition_t = np.log(start), np.log(transition_t)
    origin = np.empty(observed.shape, np.int8 if n_labels <= np.iinfo(np.int8).max else np.int16)
    impossible = np.empty(n_steps, np.bool_)
    shift = 0.0
    for part in row_blocks(n_steps, STEPS_AT_ONCE):
        rows, begun = _checked(observed, part), part.start > 0
        shift += viterbi_chain(
            score, begun, log_transition_t, action[part], rows, origin[part], impossible[part]
        )
    labels, last = np.empty(n_steps, np.int64), int(score.argmax()) if n_labels else 0
    trace_back(origin, last, labels)
    total = shift + float(score[last]) if n_steps else 0.0
    return ChainPath(labels, total, np.flatnonzero(impossible))


class ForwardFilter:
    """A chain filtered step by step, its tables checked once for all steps."""

    def __init__(self, initial: ArrayLike, transition: ArrayLike) -> None:
        n_labels = len(np.asarray(initial))
        self._start, self._transition_t = check_tables(initial, transition, n_labels)

    def step(
        self, log_likelihood: ArrayLike, belief: ArrayLike | None = None, action: int = 0
    ) -> tuple[NDArray[np.float64], bool]:
        """The belief (K,) after one more step, and whether its observation was possible.

        ``log_likelihood`` (K,) is ``log P(z | l)``, ``belief`` (K,) that of the step before, None
        at the first step, ``action`` the number of the transition table. A label of belief 0, even
        after underflow, stays at 0 until a transition leads back to it.
        """
        table = integer_array("action", [action], (1,), low=0, high=len(self._transition_t))
        rows = np.ascontiguousarray(number_array("log_likelihood", log_likelihood)[None])
        before = self._start if belief is None else number_array("belief", belief)
        before = np.ascontiguousarray(before)
        for name, values in (("log_likelihood", rows[0]), ("belief", before)):
            require_shape(name, values.shape, self._start.shape)
        if not rows.max() < np.inf:  # also true of NaN
            finite_array("log_likelihood", rows[0], ("K",), allow_minus_inf=True)
        if not (before.min() >= 0 and abs(before.sum() - 1.0) <= SUM_TOLERANCE):
            raise InputError(f"belief must hold probabilities that sum to one, got {before}")
        beliefs, impossible = np.empty(rows.shape), np.empty(1, np.bool_)
        chain = Chain(before, self._transition_t, rows, table)
        _filter(chain, belief is not None, beliefs, impossible)
        return beliefs[0], not impossible[0]


def _check(chain: Chain) -> None:
    """Raise InputError unless shapes and actions are consistent: kernels do not check them."""
    n_steps, n_labels = chain.observed.shape
    require_shape("the chain's start", chain.start.shape, (n_labels,))
    require_shape("the chain's transition_t", chain.transition_t.shape, ("A", n_labels, n_labels))
    high = len(chain.transition_t)
    integer_array("the chain's actions", chain.action, (n_steps,), low=0, high=high)


def _checked(observed: NDArray[np.float64], part: slice) -> NDArray[np.float64]:
    """A block of the log-likelihoods (T, K), checked just before use, while in cache."""
    rows = observed[part]
    if not rows.max(initial=-np.inf) < np.inf:  # also true of NaN
        finite_array("log_likelihood", observed, ("T", "K"), allow_minus_inf=True)
    return rows


def _explained(chain: Chain, *, smooth: bool) -> ChainBeliefs:
    """Filtered or smoothed beliefs, in logarithms where floats underflow."""
    _check(chain)
    observed = chain.observed
    beliefs, impossible = np.empty(observed.shape), np.empty(len(observed), np.bool_)
    evidence = _filter(chain, False, beliefs, impossible)
    if exceeds_floats(chain, beliefs, impossible):
        evidence = beliefs_in_logs(chain, beliefs, impossible, smooth=smooth)
    elif smooth:
        smooth_chain(chain.transition_t, chain.action, beliefs)
    return ChainBeliefs(beliefs, evidence, np.flatnonzero(impossible))


def _filter(
    chain: Chain, begun: bool, beliefs: NDArray[np.float64], impossible: NDArray[np.bool_]
) -> float:
    """Write filtered beliefs (T, K) and impossible steps; returns the log-evidence."""
    belief, evidence = chain.start.copy(), 0.0
    for part in row_blocks(len(chain.observed), STEPS_AT_ONCE):
        rows = _checked(chain.observed, part)
        scaled, scale = np.empty(rows.shape), np.empty(len(rows))
        subtract_best(rows, scaled, scale)
        np.exp(scaled, out=scaled)
        steps = _Steps(chain.action[part], rows, scaled, scale, beliefs[part], impossible[part])
        evidence += filter_chain(belief, begun or part.start > 0, chain.transition_t, steps)
        evidence += float(scale.sum())
    return evidence
