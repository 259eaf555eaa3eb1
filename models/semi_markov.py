"""Semi-Markov model: a hidden Markov model that knows how long places last, in metres."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.errors import ConfigError, InputError, NotFittedError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.backends import learned
from pgm_places.inference.problem import LabelingProblem, weights_of
from pgm_places.models.chain_evidence import possible
from pgm_places.models.durations import EDGES_M, Durations, constant_durations, learn_durations
from pgm_places.models.evidence_weight import weights_at
from pgm_places.models.hmm import RUNS_M, HiddenMarkovModel
from pgm_places.solvers.forward import ChainBeliefs, ChainPath
from pgm_places.solvers.semi_markov import SemiMarkovChain, SemiMarkovState

__all__ = ["SemiMarkovModel"]


@dataclass(frozen=True, eq=False)
class SemiMarkovModel(HiddenMarkovModel):
    """Labels the steps of a trajectory, knowing how far each place usually reaches.

    In a hidden Markov model, a place ends with the same probability at every step. Here it ends at
    a rate per metre that depends on the metres driven since it was entered: a doorway hardly lasts
    less than half a metre or more than two, a room may go on. Distances between steps may differ,
    in training and when labelling. Observations and options are those of
    :class:`~pgm_places.models.hmm.HiddenMarkovModel`; filter, smoother and most probable sequence
    are exact (:mod:`pgm_places.solvers.semi_markov`).

    Rates are counted on the labelled drives given to :meth:`fit`
    (:func:`pgm_places.models.durations.learn_durations`). A model that learned from maps alone has
    constant rates, and is a hidden Markov model whose steps may have any length.

    The first step's label is taken to begin there. Problems need positions; without them each step
    counts as a metre.

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
                "'semi_markov' counts durations, which steps without a label do not show; take "
                "unlabelled='dropped', or method 'hmm'"
            )

    def with_sequences(
        self,
        problems: Sequence[LabelingProblem],
        labelings: Sequence[NDArray[np.int64]],
        *,
        sample_weight: Sequence[ArrayLike] | None = None,
    ) -> Self:
        """A new one with durations counted on labelled sequences, then with fitted options."""
        found = learn_durations(
            [_positions(problem.graph) for problem in problems],
            labelings,
            problems[0].n_labels,
            smoothing=float(self.smoothing),
            weights=weights_of(sample_weight, problems),
        )
        counted = replace(self, edges_m=np.array(EDGES_M), rates=found.rates, leaving=found.leaving)
        return super(SemiMarkovModel, counted).with_sequences(
            problems, labelings, sample_weight=sample_weight
        )

    def rescaled(self, from_m: float, to_m: float) -> tuple[Self, float]:
        """One for updates every ``to_m`` metres: rates are per metre, only weights differ."""
        return replace(self, fitted_weights=weights_at(self.fitted_weights, from_m, to_m)), 0.0

    def step(
        self,
        unary: ArrayLike,
        belief: ArrayLike | None = None,
        *,
        moved_m: float | None = None,
        further: ArrayLike | None = None,
    ) -> tuple[NDArray[np.float64], bool]:
        """Not to be had: a belief does not say how long a place has lasted; see :meth:`advance`.

        Raises
        ------
        InputError
            Always, except at the first step.
        """
        if belief is not None:
            raise InputError(
                "a semi-Markov model cannot go on from a belief, which does not say how long the "
                "place has lasted; use advance, which returns a state"
            )
        return super().step(unary, moved_m=moved_m, further=further)

    def _next(
        self,
        observed: NDArray[np.float64],
        state: SemiMarkovState | None,
        moved_m: float | None,
        *,
        everything_possible: bool = False,
    ) -> tuple[NDArray[np.float64], SemiMarkovState, bool]:
        chain = self._chain_of_possible if everything_possible else self._chain
        stays = state is None or moved_m is None or moved_m < self.stay_below_m
        after, was_possible = chain.step(observed, state, 0.0 if stays else float(moved_m or 0.0))
        return after.belief, after, was_possible

    def _explained(
        self,
        graph: LabelGraph,
        observed: NDArray[np.float64],
        *,
        everything_possible: bool = False,
    ) -> ChainBeliefs | ChainPath:
        chain = self._chain_of_possible if everything_possible else self._chain
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
            raise NotFittedError("the semi-Markov model knows no durations yet; call fit first")
        return constant_durations(self.transition, RUNS_M)

    @cached_property
    def _chain(self) -> SemiMarkovChain:
        edges = EDGES_M if self.edges_m is None else self.edges_m
        return SemiMarkovChain(self._start(), self._durations.leaving, edges, self._durations.rates)

    @cached_property
    def _chain_of_possible(self) -> SemiMarkovChain:
        """The same where nothing that evidence may call for has probability 0."""
        edges = EDGES_M if self.edges_m is None else self.edges_m
        found = self._durations
        away = np.where(np.eye(len(found.leaving)) > 0, 0.0, possible(found.leaving))
        if len(away) == 1:
            away = found.leaving
        return SemiMarkovChain(possible(self._start()), away, edges, possible(found.rates))


def _positions(graph: LabelGraph) -> NDArray[np.float64]:
    """(T, 2) or (T, 3) where the steps are; a metre apart where that is unknown."""
    if graph.positions_m is not None:
        return graph.positions_m
    return np.stack([np.arange(float(graph.n_nodes)), np.zeros(graph.n_nodes)], axis=1)
