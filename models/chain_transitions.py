"""Transitions of a hidden Markov model along a chain: per step, or by the step's length."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._arguments import travels
from pgm_places._checks import finite_array, number_array
from pgm_places.errors import InputError, NotFittedError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.problem import LabelingProblem
from pgm_places.models.chain_statistics import (
    moved_steps,
    transition_at,
    transition_powers,
    usual_length,
)
from pgm_places.models.evidence_weight import possible, weights_at
from pgm_places.solvers.forward import (
    ChainBeliefs,
    ChainPath,
    ForwardFilter,
    filtered_beliefs,
    markov_chain,
    smoothed_beliefs,
    viterbi,
)


@travels
class StepFilter(ABC):
    """Online interface of chain models."""

    def advance(
        self,
        unary: ArrayLike,
        state: Any = None,
        *,
        moved_m: float | None = None,
        further: ArrayLike | None = None,
    ) -> tuple[NDArray[np.float64], Any, bool]:
        """The belief (K,) after one more observation, the next state, and whether it was possible.

        ``unary`` (K,) are the classifier's log-probabilities: -inf forbids a label, NaN for all
        labels means no observation. ``state`` is that of the step before, None at the first: the
        belief (K,) in a hidden Markov model. ``moved_m`` is the distance from the step before, for
        ``stay_below_m``; None counts as moved. ``further`` (K,) are log-likelihoods of other
        observations.
        """
        row = number_array("unary", unary)
        if row.ndim != 1 or not row.size or not np.isnan(row).all():
            row = finite_array("unary", row, ("K",), allow_minus_inf=True)
        observed = self._log_likelihood(row[None])[0]
        if further is not None:
            observed += finite_array("further", further, row.shape)
        belief, after, was_possible = self._next(observed, state, moved_m)
        if not was_possible and (row == -np.inf).any() and row.max() > -np.inf:
            belief, after, _ = self._all_possible._next(observed, state, moved_m)
        return belief, after, was_possible

    @abstractmethod
    def _log_likelihood(self, unary: NDArray[np.float64]) -> NDArray[np.float64]:
        """(T, K) ``log P(z_t | l)`` up to a constant per step; -inf where a label is forbidden."""

    @property
    @abstractmethod
    def _all_possible(self) -> Self:
        """The model without probabilities of 0 that known labels could contradict."""

    @abstractmethod
    def _next(
        self, observed: NDArray[np.float64], state: Any, moved_m: float | None
    ) -> tuple[NDArray[np.float64], Any, bool]:
        """:meth:`advance` for checked log-likelihoods."""


StepLength = Literal["usual", "positions", "given"]

MOVE, STAY = 0, 1
# Mean step length of the simulated runs on which transitions are counted without labelled drives.
RUNS_M = 0.35
# Step lengths are rounded to this share of the usual one, to bound the number of tables.
FINEST = 1e-3


def step_lengths(problem: LabelingProblem, lengths: StepLength) -> NDArray[np.float64] | None:
    """(T - 1,) length of each step of a chain; None for ``step_length = 'usual'``."""
    graph = problem.graph
    if lengths == "usual":
        return None
    if lengths == "positions":
        if graph.positions_m is None:
            raise InputError(
                "step_length = 'positions' needs the positions of the steps, and this graph has "
                "none; give lengths as edge_features with step_length = 'given'"
            )
        return np.asarray(np.linalg.norm(np.diff(graph.positions_m, axis=0), axis=1))
    if problem.edge_features is None or problem.edge_features.shape[1] != 1:
        came = None if problem.edge_features is None else problem.edge_features.shape
        raise InputError(
            f"step_length = 'given' needs edge_features of shape ({graph.n_edges}, 1), the length "
            f"or duration of each step, got {came}"
        )
    lengths_m = problem.edge_features[:, 0]
    if lengths_m.min(initial=0.0) < 0:
        raise InputError(f"lengths of steps must be at least 0, got {lengths_m.min():g}")
    return np.asarray(lengths_m, np.float64)


def known_lengths(
    problems: Sequence[LabelingProblem], lengths: StepLength
) -> list[NDArray[np.float64]]:
    """Step lengths of chains; with ``step_length = 'usual'`` of chains with positions."""
    if lengths == "usual":
        placed = [problem for problem in problems if problem.graph.positions_m is not None]
        return [np.asarray(step_lengths(problem, "positions")) for problem in placed]
    of_chains = [np.asarray(step_lengths(problem, lengths)) for problem in problems]
    if not any(lengths_m.any() for lengths_m in of_chains):
        raise InputError("all steps have length 0: transitions by step length need lengths above 0")
    return of_chains


class ChainTransitions(StepFilter):
    """Base of hidden Markov models: inference with their transitions."""

    mode: Any
    stay_below_m: float
    step_length: StepLength
    transition: NDArray[np.float64] | None
    stay: NDArray[np.float64] | None
    prior: NDArray[np.float64] | None
    counted_m: NDArray[np.float64] | None
    fitted_weights: NDArray[np.float64] | None

    @property
    def shrinkage_used(self) -> float:
        """The weight of the labels' shares in the transitions of this mode."""
        raise NotImplementedError

    def _start(self) -> NDArray[np.float64]:
        """(K,) belief before the first observation."""
        raise NotImplementedError

    def rescaled(self, from_m: float, to_m: float) -> tuple[Self, float]:
        """A model for updates every ``to_m``, not ``from_m`` metres; its table's largest change.

        See :func:`pgm_places.models.chain_statistics.transition_at`,
        :func:`pgm_places.models.evidence_weight.weights_at`. By step length only weights change.
        """
        if not (from_m > 0 and to_m > 0):
            raise InputError(
                f"transitions for updates every {from_m:g} m cannot be rescaled to every {to_m:g} "
                "m; train the model at this distance"
            )
        changes: dict[str, object] = {
            "fitted_weights": weights_at(self.fitted_weights, from_m, to_m)
        }
        if self.step_length != "usual":
            return replace(self, **changes), 0.0  # type: ignore[type-var]
        table, changed = transition_at(self._moves, self._usual_length, from_m, to_m)
        return replace(self, transition=table, **changes), changed  # type: ignore[type-var]

    def _explained(
        self,
        graph: LabelGraph,
        observed: NDArray[np.float64],
        lengths: NDArray[np.float64] | None = None,
    ) -> ChainBeliefs | ChainPath:
        """The result of the mode's algorithm, for steps of ``lengths`` (T - 1,)."""
        methods: dict[str, Callable[..., ChainBeliefs | ChainPath]]
        methods = {"filter": filtered_beliefs, "smooth": smoothed_beliefs, "viterbi": viterbi}
        moved = self._moved(graph)
        if lengths is None:
            tables, actions = self._transitions, np.where(moved, MOVE, STAY)
        else:
            parts = np.rint(lengths / self._usual_length / FINEST).astype(np.int64)
            different, led = np.unique(parts, return_inverse=True)
            of_lengths = self._by_length(np.multiply(FINEST, different))
            tables = np.concatenate([of_lengths, self._transitions[STAY:]])
            actions = np.where(moved, led.reshape(-1), len(different))
        return methods[self.mode](markov_chain(self._start(), tables, observed, actions))

    def _moved(self, graph: LabelGraph) -> NDArray[np.bool_]:
        return moved_steps(graph, self.stay_below_m)

    def _next(
        self, observed: NDArray[np.float64], state: Any, moved_m: float | None
    ) -> tuple[NDArray[np.float64], Any, bool]:
        stays = moved_m is not None and moved_m < self.stay_below_m
        forward, action = self._filter, STAY if stays else MOVE
        known = self.step_length != "usual" and moved_m is not None and np.isfinite(moved_m)
        if known and not stays:
            assert moved_m is not None
            forward = self._filter_of(round(float(moved_m) / self._usual_length / FINEST))
        belief, was_possible = forward.step(observed, state, action)
        return belief, belief, was_possible

    def _filter_of(self, parts: int) -> ForwardFilter:
        """The filter for a step of ``parts * FINEST`` usual lengths."""
        forward = self._filters.get(parts)
        if forward is None:
            forward = ForwardFilter(self._start(), self._by_length(np.array([FINEST * parts])))
            self._filters[parts] = forward
        return forward

    @cached_property
    def _filters(self) -> dict[int, ForwardFilter]:
        return {}

    @cached_property
    def _filter(self) -> ForwardFilter:
        return ForwardFilter(self._start(), self._transitions)

    def _by_length(self, exponents: NDArray[np.float64]) -> NDArray[np.float64]:
        """(A, K, K) transitions over these numbers of usual lengths; the identity for 0."""
        tables = self._shrunk(transition_powers(self._moves, exponents))
        tables[exponents == 0] = np.eye(tables.shape[1])
        return tables

    @property
    def _usual_length(self) -> float:
        return usual_length(self.counted_m, RUNS_M)

    @property
    def _moves(self) -> NDArray[np.float64]:
        if self.transition is None:
            raise NotFittedError("the hidden Markov model has no transitions yet; call fit first")
        return self.transition

    def _shrunk(self, tables: NDArray[np.float64]) -> NDArray[np.float64]:
        """Tables (..., K, K) with the labels' shares mixed into every row."""
        share = self.shrinkage_used
        if share == 0 or self.prior is None:
            return tables
        return (1.0 - share) * tables + share * self.prior / self.prior.sum()

    @cached_property
    def _transitions(self) -> NDArray[np.float64]:
        """(2, K, K) transitions of MOVE and of STAY; STAY is the identity unless learned."""
        moves = self._moves
        stay = np.eye(len(moves)) if self.stay is None else self.stay
        return np.stack([self._shrunk(moves), stay])

    @cached_property
    def _all_possible(self) -> Self:
        stay = possible(self._transitions[STAY])
        tables = {"initial": possible(self._start()), "transition": possible(self._moves)}
        return replace(self, stay=stay, **tables)  # type: ignore[type-var]
