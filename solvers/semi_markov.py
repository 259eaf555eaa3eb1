"""Semi-Markov chains on arrays: the rate of leaving a label depends on its age in metres.

A label that was entered ``a`` metres ago is left at the rate ``r_l(a)`` per metre, so that it lasts
longer than ``a`` with probability ``S_l(a) = exp(-integral of r_l from 0 to a)``; constant rates
give a hidden Markov chain. Inference is exact for any distances between steps. If a label is left
between two steps, the next label begins at the second step, at age 0.

Filter and smoother after Yu and Kobayashi, "An efficient forward-backward algorithm for an
explicit-duration hidden Markov model", IEEE Signal Processing Letters 10 (2003), with survival by
distance in place of durations counted in steps. Time grows with the number of steps within the last
edge of the rates, memory only with the number of steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places import _core
from pgm_places._checks import finite_array, require_at_least
from pgm_places.errors import InputError
from pgm_places.solvers.forward import (
    RARE_ARRIVAL,
    RARE_BELIEF,
    ChainBeliefs,
    ChainPath,
    check_start,
    require_distributions,
)


class _Rates(NamedTuple):
    """Transitions between labels, and rates of leaving."""

    leaving: NDArray[np.float64]
    """(K, K) probability of each label (column) after each (row), given that the row is left."""
    edges_m: NDArray[np.float64]
    """(B,) age at which each rate begins; the first is 0, the last rate has no end."""
    rates: NDArray[np.float64]
    """(K, B) rate per metre at which each label is left."""
    sums: NDArray[np.float64]
    """(K, B) integral of the rates from age 0 to each edge."""


class _States(NamedTuple):
    """Masses of all states at the current step, or log-probabilities of their best paths."""

    at_m: NDArray[np.float64]
    """(T,) distance driven until each step."""
    recent: NDArray[np.float64]
    """(T, K) of a label entered at that step, for steps within the last edge."""
    old: NDArray[np.float64]
    """(K,) of a label entered before."""


class _Filtered(NamedTuple):
    """Output of the filter, by step."""

    beliefs: NDArray[np.float64]
    """(T, K)."""
    factor: NDArray[np.float64]
    """(T, K) likelihood over the total: the factor of each label's mass."""
    left: NDArray[np.float64]
    """(T, K) mass that left each label after the step; all masses sum to one."""
    entered: NDArray[np.float64]
    """(T, K) mass that entered each label at the step, before the observation."""
    low: NDArray[np.int64]
    """(T,) the first step whose entries are recent."""
    total: NDArray[np.float64]
    """(T,) the sum before normalising, 0 for an impossible observation."""
    scale: NDArray[np.float64]
    """(T,) the logarithm that the total is scaled by."""


class _LogFiltered(NamedTuple):
    """Output of the filter in logarithms, by step."""

    beliefs: NDArray[np.float64]
    """(T, K)."""
    factor: NDArray[np.float64]
    """(T, K) logarithm added to each label's masses."""
    entered: NDArray[np.float64]
    """(T, K) mass that entered each label at the step, before the observation."""
    old: NDArray[np.float64]
    """(T, K) mass of each label entered before the recent steps."""
    low: NDArray[np.int64]
    """(T,) the first step whose entries are recent."""
    impossible: NDArray[np.bool_]
    """(T,) whether the observation was skipped."""


class _Origins(NamedTuple):
    """Back-pointers of the best paths."""

    began: NDArray[np.int64]
    """(T, K) step at which the label was entered, on the best path that leaves it after a step."""
    label: NDArray[np.int16]
    """(T, K) label before, on the best path that enters a label at a step."""


@dataclass(frozen=True, eq=False)
class SemiMarkovState:
    """A joint belief of the label and of its age in metres."""

    age_m: NDArray[np.float64]
    """(W,) distance driven since each of the last steps, oldest first."""
    recent: NDArray[np.float64]
    """(W, K) probability of a label that was entered at that step."""
    old: NDArray[np.float64]
    """(K,) probability of a label that was entered before."""

    @property
    def belief(self) -> NDArray[np.float64]:
        """(K,) probability of each label, summed over its age."""
        return np.asarray(self.recent.sum(axis=0) + self.old)


class SemiMarkovChain:
    """A chain whose labels are left at a rate that depends on their age.

    ``initial`` (K,) are probabilities at the first step, where every label has just been entered;
    ``leaving`` (K, K) those of each label (column) after each (row), 0 on the diagonal. ``rates``
    (K, B) per metre hold from the ages ``edges_m`` (B,) on, the first 0.

    Examples
    --------
    A doorway (1) is left within a metre; a room (0) takes some metres:

    >>> chain = SemiMarkovChain([0.5, 0.5], [[0, 1], [1, 0]], [0.0, 1.0], [[0.5, 0.5], [1.0, 9.0]])
    >>> observed = np.log([[0.9, 0.1], [0.1, 0.9], [0.2, 0.8], [0.9, 0.1], [0.8, 0.2]])
    >>> chain.viterbi(np.full(4, 0.5), observed).labels.tolist()
    [0, 1, 1, 0, 0]
    """

    def __init__(
        self, initial: ArrayLike, leaving: ArrayLike, edges_m: ArrayLike, rates: ArrayLike
    ) -> None:
        n_labels = len(np.asarray(initial))
        self._start = check_start(initial, n_labels)
        after = finite_array("leaving", leaving, (n_labels, n_labels))
        require_distributions("leaving", after)
        if n_labels > 1 and after.diagonal().any():
            raise InputError("leaving must have a diagonal of 0: a label is not left for itself")
        edges = finite_array("edges_m", edges_m, ("B",))
        if not len(edges) or edges[0] != 0 or not (np.diff(edges) > 0).all():
            raise InputError(f"edges_m must rise from 0, got {edges}")
        by_age = finite_array("rates", rates, (n_labels, len(edges)))
        if (by_age < 0).any():
            raise InputError(f"rates must be at least 0, got {by_age.min()}")
        sums = np.zeros(by_age.shape)
        sums[:, 1:] = np.cumsum(by_age[:, :-1] * np.diff(edges), axis=1)
        self._model = _Rates(*map(np.ascontiguousarray, (after, edges, by_age, sums)))

    def filtered(self, moved_m: ArrayLike, log_likelihood: ArrayLike) -> ChainBeliefs:
        """Beliefs (T, K) from the observations until each step.

        ``moved_m`` (T - 1,) are distances from each step to the next, ``log_likelihood`` (T, K) is
        ``log P(z_t | l)``; -inf forbids a label. InputError if shapes do not fit, a distance is
        negative, or a likelihood NaN or +inf.
        """
        return self._explained(moved_m, log_likelihood, smooth=False)

    def smoothed(self, moved_m: ArrayLike, log_likelihood: ArrayLike) -> ChainBeliefs:
        """Beliefs from the observations of all steps; arguments and result of :meth:`filtered`."""
        return self._explained(moved_m, log_likelihood, smooth=True)

    def viterbi(self, moved_m: ArrayLike, log_likelihood: ArrayLike) -> ChainPath:
        """The labels (T,) of largest joint probability, and its logarithm.

        Arguments are those of :meth:`filtered`. A stay of label l, ``a`` metres long at its last
        step and ``b`` at the first step of the next stay, has the probability ``S_l(a) - S_l(b)``;
        the last stay has ``S_l(a)``.
        """
        states, observed = self._checked(moved_m, log_likelihood)
        n_steps, n_labels = observed.shape
        labels, impossible = np.zeros(n_steps, np.int64), np.zeros(n_steps, np.bool_)
        origins = _Origins(np.zeros(observed.shape, np.int64), np.zeros(observed.shape, np.int16))
        if n_labels > np.iinfo(np.int16).max:
            raise InputError(
                f"viterbi takes at most {np.iinfo(np.int16).max} labels, got {n_labels}"
            )
        total = 0.0
        if n_steps:
            total = _core.best_stretches(
                *self._logs, self._model, states, observed, origins, labels, impossible
            )
        return ChainPath(labels, float(total), np.flatnonzero(impossible))

    def step(
        self, log_likelihood: ArrayLike, state: SemiMarkovState | None = None, moved_m: float = 0.0
    ) -> tuple[SemiMarkovState, bool]:
        """The state after one more step, and whether its observation was possible: online use.

        ``state`` is that of the step before, None at the first, ``moved_m`` the distance since. A
        label of belief 0, even after underflow, stays at 0 until it is entered again.
        """
        rows = finite_array(
            "log_likelihood", log_likelihood, (len(self._start),), allow_minus_inf=True
        )
        require_at_least("moved_m", moved_m, 0, "metres")
        finite_array("moved_m", [moved_m], (1,))
        factor = np.ones(len(rows))
        if state is None:
            age_m, recent, old = np.zeros(1), self._start[None].copy(), np.zeros(len(rows))
            held = self._start
        else:
            before = finite_array("age_m", state.age_m, ("W",))
            held_before = finite_array("recent", state.recent, (len(before), len(rows)))
            age_m = np.append(before + moved_m, 0.0)
            recent = np.concatenate([held_before, np.zeros((1, len(rows)))])
            old = np.array(finite_array("old", state.old, rows.shape))
            states = _States(age_m[0] - age_m, recent, old)
            left, entered, held = (np.empty(len(rows)) for _ in range(3))
            flow = (left, entered, held)
            low = _core.pass_on_states(self._model, states, len(age_m) - 1, 0, factor, flow)
            age_m, recent = age_m[low:], recent[low:]
        total = _core.weigh_states(held, np.ascontiguousarray(rows), factor)
        return SemiMarkovState(age_m, recent * factor, old * factor), bool(total > 0.0)

    @property
    def _logs(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Logarithms of the initial probabilities (K,) and of the transitions (K, K)."""
        with np.errstate(divide="ignore"):
            return np.log(self._start), np.log(self._model.leaving)

    def _explained(
        self, moved_m: ArrayLike, log_likelihood: ArrayLike, *, smooth: bool
    ) -> ChainBeliefs:
        """Filtered or smoothed beliefs, in logarithms where floats underflow."""
        states, observed = self._checked(moved_m, log_likelihood)
        steps = self._filter(states, observed)
        if self._exceeds_floats(steps, observed):
            return self._in_logs(states, observed, smooth=smooth)
        if smooth and len(observed):
            _core.smooth_stretches(self._model, states, steps)
        return _beliefs(steps)

    def _exceeds_floats(self, steps: _Filtered, observed: NDArray[np.float64]) -> bool:
        """Whether a label may have underflowed that later steps need."""
        leaving = self._model.leaving
        if leaving.min(initial=1.0, where=leaving > 0) < RARE_ARRIVAL:
            return True
        rare = (steps.beliefs < RARE_BELIEF) & (
            (observed > -np.inf) | (steps.total == 0.0)[:, np.newaxis]
        )
        if not rare.any():
            return False
        before = np.vstack([self._start, steps.beliefs[:-1]])
        return bool((rare & ((before > 0) | (steps.entered > 0))).any())

    def _in_logs(
        self, states: _States, observed: NDArray[np.float64], *, smooth: bool
    ) -> ChainBeliefs:
        shape = observed.shape
        steps = _LogFiltered(
            beliefs=np.empty(shape),
            factor=np.empty(shape),
            entered=np.empty(shape),
            old=np.empty(shape),
            low=np.empty(len(observed), np.int64),
            impossible=np.empty(len(observed), np.bool_),
        )
        logs = self._logs
        evidence = _core.filter_stretches_in_logs(*logs, self._model, states, observed, steps)
        if smooth:
            _core.smooth_stretches_in_logs(logs[1], self._model, states, steps)
        beliefs = np.exp(steps.beliefs)
        beliefs /= beliefs.sum(axis=1, keepdims=True)
        return ChainBeliefs(beliefs, evidence, np.flatnonzero(steps.impossible))

    def _filter(self, states: _States, observed: NDArray[np.float64]) -> _Filtered:
        shape = observed.shape
        steps = _Filtered(
            beliefs=np.zeros(shape),
            factor=np.ones(shape),
            left=np.zeros(shape),
            entered=np.zeros(shape),
            low=np.zeros(len(observed), np.int64),
            total=np.zeros(len(observed)),
            scale=np.zeros(len(observed)),
        )
        if len(observed):
            _core.filter_stretches(self._start, self._model, states, observed, steps)
        return steps

    def _checked(
        self, moved_m: ArrayLike, observed: ArrayLike
    ) -> tuple[_States, NDArray[np.float64]]:
        """Initial states, and the checked log-likelihoods (T, K)."""
        n_labels = len(self._start)
        rows = finite_array("log_likelihood", observed, ("T", n_labels), allow_minus_inf=True)
        moved = finite_array("moved_m", moved_m, (max(len(rows) - 1, 0),))
        if (moved < 0).any():
            raise InputError(f"moved_m must be at least 0 metres, got {moved.min()}")
        at_m = np.zeros(len(rows))
        with np.errstate(over="ignore"):
            at_m[1:] = np.cumsum(moved)
        if not np.isfinite(at_m[-1:]).all():
            raise InputError("moved_m adds up to more metres than a float holds")
        return _States(at_m, np.zeros(rows.shape), np.zeros(n_labels)), np.ascontiguousarray(rows)


def _beliefs(steps: _Filtered) -> ChainBeliefs:
    impossible = np.flatnonzero(steps.total == 0.0)
    evidence = -np.inf
    if not len(impossible):
        evidence = float(np.log(steps.total).sum() + steps.scale.sum())
    return ChainBeliefs(steps.beliefs, evidence, impossible)
