"""Semi-Markov model: a hidden Markov model with learned durations of labels, in metres."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.errors import ConfigError, NotFittedError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.backends import learned
from pgm_places.inference.node_weights import weights_of
from pgm_places.inference.problem import LabelingProblem
from pgm_places.models.chain_statistics import normalised
from pgm_places.models.chain_transitions import RUNS_M
from pgm_places.models.evidence_weight import possible, weights_at
from pgm_places.models.hmm import HiddenMarkovModel
from pgm_places.solvers.forward import ChainBeliefs, ChainPath
from pgm_places.solvers.semi_markov import SemiMarkovChain, SemiMarkovState

EDGES_M = (0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)
"""Edges of ages with constant rates, in metres: fine for doorways, coarse for rooms."""

# Steps longer than this many median lengths are gaps, across which labels are unknown.
GAP = 5.0


class Durations(NamedTuple):
    """Rates of leaving labels, and transitions."""

    rates: NDArray[np.float64]
    """(K, B) rate per metre at which each label is left, from each of the edges on."""
    leaving: NDArray[np.float64]
    """(K, K) probability of each label (column) after each other one (row)."""


class _Stay(NamedTuple):
    """A stretch with one label."""

    label: int
    entered: bool  # whether its beginning was observed, so that its age is known
    length_m: float  # until the last step that has it
    exit_m: float  # from there to the next step
    following: int  # the label there, -1 where unknown
    weight: float  # weight of the stretch


def learn_durations(
    positions_m: Sequence[NDArray[np.float64]],
    labelings: Sequence[NDArray[np.int64]],
    n_labels: int,
    *,
    smoothing: float,
    weights: Sequence[NDArray[np.float64]] | None = None,
) -> Durations:
    """Occurrence-exposure rates: how often a label was left at an age, per metre at that age.

    ``positions_m`` (T, 2), ``labelings`` (T,), -1 where unknown, and ``weights`` (T,) are those of
    each drive; a stretch has the mean weight of its steps. Stretches censored by the end of the
    drive or by unlabelled steps count up to their end. Each rate is smoothed by ``smoothing``
    occurrences at the label's overall rate, which is smoothed in the same way by that of all
    labels.

    Examples
    --------
    >>> line = np.stack([np.arange(0.0, 6.0, 0.5), np.zeros(12)], axis=1)
    >>> labels = np.array([0, 0, 0, 0, 0, 1, 1, 0, 0, 0, 0, 0])
    >>> learn_durations([line], [labels], 2, smoothing=0.0).rates[1, :6].round(2).tolist()
    [0.0, 0.0, 4.0, 1.33, 1.33, 1.33]
    """
    edges = np.array(EDGES_M)
    occurrences, exposure = np.zeros((n_labels, len(edges))), np.zeros((n_labels, len(edges)))
    left, metres = np.zeros(n_labels), np.zeros(n_labels)
    following = np.zeros((n_labels, n_labels))
    if weights is None:
        weights = [np.ones(len(labels)) for labels in labelings]
    for places, labels, weight in zip(positions_m, labelings, weights, strict=True):
        for stay in _stays(places, labels, weight):
            ends = stay.following >= 0
            lasted = stay.length_m + (0.5 * stay.exit_m if ends else 0.0)
            metres[stay.label] += stay.weight * lasted
            if stay.entered:
                exposure[stay.label] += stay.weight * _within(edges, lasted)
            if ends:
                left[stay.label] += stay.weight
                following[stay.label, stay.following] += stay.weight
                if stay.entered:
                    occurrences[stay.label, _bin_of(edges, lasted)] += stay.weight
    total_m, all_left = max(float(metres.sum()), EDGES_M[-1]), max(float(left.sum()), 1.0)
    overall = _over(left, metres, smoothing, np.full(n_labels, all_left / total_m))
    rates = _over(occurrences, exposure, smoothing, overall[:, None] + np.zeros_like(exposure))
    return Durations(rates, _other_labels(following + smoothing))


def constant_durations(transition: NDArray[np.float64], step_m: float) -> Durations:
    """Durations of a Markov chain with this transition (K, K) every ``step_m`` metres."""
    stays = np.clip(transition.diagonal(), 1e-9, 1.0)
    rates = np.repeat(-np.log(stays)[:, None] / step_m, len(EDGES_M), axis=1)
    return Durations(rates, _other_labels(transition))


def _over(
    occurrences: NDArray[np.float64],
    exposure: NDArray[np.float64],
    smoothing: float,
    prior: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Occurrences divided by exposure, with ``smoothing`` occurrences at the prior rate added."""
    metres = exposure + smoothing / prior if smoothing > 0 else exposure
    return np.divide(occurrences + smoothing, metres, out=prior.copy(), where=metres > 0)


def _other_labels(weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows of weights without their diagonal, as probabilities; uniform where the sum is 0."""
    others = weights * (1.0 - np.eye(len(weights)))
    if len(weights) > 1:
        others[others.sum(axis=1) == 0] = 1.0
        np.fill_diagonal(others, 0.0)
    return normalised(others)


def _bin_of(edges: NDArray[np.float64], age_m: float) -> int:
    """The index of the rate at the end of a stretch."""
    return max(int(np.searchsorted(edges, age_m)) - 1, 0)


def _within(edges: NDArray[np.float64], length_m: float) -> NDArray[np.float64]:
    """(B,) the metres of a stretch of this length between each edge and the next."""
    return np.diff(np.minimum(np.append(edges, np.inf), length_m))


def _stays(
    places: NDArray[np.float64], labels: NDArray[np.int64], weight: NDArray[np.float64]
) -> list[_Stay]:
    """The stretches of one known label; gaps are unknown."""
    if len(labels) < 2:
        return []
    moved = np.linalg.norm(np.diff(places, axis=0), axis=1)
    usual = np.median(moved[moved > 0]) if (moved > 0).any() else 0.0
    gap = moved > GAP * usual
    at_m = np.concatenate([[0.0], np.cumsum(moved)])
    changes = np.flatnonzero((np.diff(labels) != 0) | gap) + 1
    starts, ends = np.append(0, changes), np.append(changes, len(labels))
    stays = []
    for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
        if labels[start] < 0:
            continue
        entered = start > 0 and not gap[start - 1] and labels[start - 1] >= 0
        goes_on = end < len(labels) and not gap[end - 1]
        stays.append(
            _Stay(
                label=int(labels[start]),
                entered=entered,
                length_m=float(at_m[end - 1] - at_m[start]),
                exit_m=float(moved[end - 1]) if goes_on else 0.0,
                following=int(labels[end]) if goes_on else -1,
                weight=float(weight[start:end].mean()),
            )
        )
    return stays


@dataclass(frozen=True, eq=False)
class SemiMarkovModel(HiddenMarkovModel):
    """Labels the steps of a trajectory with a model of the length of each label's stretches.

    In a hidden Markov model, a label is left with constant probability per step. Here it is left at
    a rate per metre that depends on the metres driven since it was entered: a doorway is rarely
    shorter than half a metre or longer than two. Distances between steps may vary. Observations and
    options are those of :class:`~pgm_places.models.hmm.HiddenMarkovModel`; filter, smoother and
    most probable sequence are exact (:mod:`pgm_places.solvers.semi_markov`).

    :meth:`fit` counts rates on labelled drives
    (:func:`~pgm_places.models.semi_markov.learn_durations`). A model trained on maps only has
    constant rates, and equals a hidden Markov model with steps of any length. The label of the
    first step is assumed to begin there. Without positions each step counts as a metre.

    Examples
    --------
    >>> from pgm_places.graph.label_graph import LabelGraph
    >>> graph = LabelGraph.from_trajectory(np.arange(0.0, 12.0, 0.5).reshape(12, 2))
    >>> truth = np.array([0, 0, 0, 0, 0, 1, 1, 0, 0, 0, 0, 0])
    >>> z = np.where(np.eye(2)[truth] > 0, 0.9, 0.1)
    >>> problem = LabelingProblem(graph, ["room", "doorway"], unary=np.log(z))
    >>> model = SemiMarkovModel("smooth").fit([problem], [truth])
    >>> model.infer(problem).labels.tolist()
    [0, 0, 0, 0, 0, 1, 1, 0, 0, 0, 0, 0]
    """

    name: ClassVar[str] = "semi_markov"
    edges_m: NDArray[np.float64] | None = learned()
    """(B,) age in metres from which on each rate holds."""
    rates: NDArray[np.float64] | None = learned()
    """(K, B) rate per metre at which each label is left."""
    leaving: NDArray[np.float64] | None = learned()
    """(K, K) probability of each label (column) after each other one (row)."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.unlabelled == "hidden":
            raise ConfigError(
                "'semi_markov' cannot learn durations from steps without a label; use "
                "unlabelled='dropped', or method 'hmm'"
            )
        if self.step_length != "usual" or self.shrinkage not in ("fitted", 0):
            raise ConfigError(
                "'semi_markov' always uses the distances between steps and has no transitions to "
                "shrink; remove step_length and shrinkage, or use method 'hmm'"
            )

    def with_sequences(
        self,
        problems: Sequence[LabelingProblem],
        labelings: Sequence[NDArray[np.int64]],
        *,
        sample_weight: Sequence[ArrayLike] | None = None,
    ) -> Self:
        """A new model with durations from labelled sequences, then with fitted options."""
        stays = learn_durations(
            [_positions(problem.graph) for problem in problems],
            labelings,
            problems[0].n_labels,
            smoothing=float(self.smoothing),
            weights=weights_of(sample_weight, problems),
        )
        counted = replace(self, edges_m=np.array(EDGES_M), rates=stays.rates, leaving=stays.leaving)
        return super(SemiMarkovModel, counted).with_sequences(
            problems, labelings, sample_weight=sample_weight
        )

    @property
    def can_shrink(self) -> bool:
        """False: durations replace transitions."""
        return False

    def rescaled(self, from_m: float, to_m: float) -> tuple[Self, float]:
        """A model for updates every ``to_m`` metres: rates are per metre, only weights change."""
        return replace(self, fitted_weights=weights_at(self.fitted_weights, from_m, to_m)), 0.0

    def _next(
        self, observed: NDArray[np.float64], state: SemiMarkovState | None, moved_m: float | None
    ) -> tuple[NDArray[np.float64], SemiMarkovState, bool]:
        stays = state is None or moved_m is None or moved_m < self.stay_below_m
        driven = 0.0 if stays else float(moved_m or 0.0)
        after, was_possible = self._chain.step(observed, state, driven)
        return after.belief, after, was_possible

    def _explained(
        self,
        graph: LabelGraph,
        observed: NDArray[np.float64],
        lengths: NDArray[np.float64] | None = None,  # noqa: ARG002
    ) -> ChainBeliefs | ChainPath:
        chain = self._chain
        moved = np.linalg.norm(np.diff(_positions(graph), axis=0), axis=1)
        moved[moved < self.stay_below_m] = 0.0
        methods: dict[str, Callable[..., ChainBeliefs | ChainPath]]
        methods = {"filter": chain.filtered, "smooth": chain.smoothed, "viterbi": chain.viterbi}
        return methods[self.mode](moved, observed)

    @cached_property
    def _durations(self) -> Durations:
        if self.rates is not None and self.leaving is not None:
            return Durations(self.rates, self.leaving)
        if self.transition is None:
            raise NotFittedError("the semi-Markov model has no durations yet; call fit first")
        return constant_durations(self.transition, RUNS_M)

    @cached_property
    def _chain(self) -> SemiMarkovChain:
        edges = EDGES_M if self.edges_m is None else self.edges_m
        return SemiMarkovChain(self._start(), self._durations.leaving, edges, self._durations.rates)

    @cached_property
    def _all_possible(self) -> Self:
        rates, leaving = self._durations
        if len(leaving) > 1:
            leaving = np.where(np.eye(len(leaving)) > 0, 0.0, possible(leaving))
        start = possible(self._start())
        return replace(self, initial=start, rates=possible(rates), leaving=leaving)


def _positions(graph: LabelGraph) -> NDArray[np.float64]:
    """(T, 2) or (T, 3) positions of the steps; a metre apart if unknown."""
    if graph.positions_m is not None:
        return graph.positions_m
    return np.stack([np.arange(float(graph.n_nodes)), np.zeros(graph.n_nodes)], axis=1)
