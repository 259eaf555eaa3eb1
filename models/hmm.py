"""Hidden Markov model: labels along a trajectory, with transitions learned from training data."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, ClassVar, Literal, Self, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array
from pgm_places.errors import InputError, NotFittedError
from pgm_places.inference.backends import LearnedNames, Traits, in_learned_order, learned
from pgm_places.inference.labeling import Labeling, Status
from pgm_places.inference.node_weights import weights_of
from pgm_places.inference.problem import LabelingProblem, evident_unary
from pgm_places.models.chain_statistics import (
    counted_tables,
    learned_tables,
    log_impossible,
    require_chain,
)
from pgm_places.models.chain_transitions import (
    ChainTransitions,
    StepLength,
    known_lengths,
    step_lengths,
)
from pgm_places.models.evidence_weight import (
    Observation,
    chosen_observation,
    fitted_by_mode,
    log_likelihood,
    words_of_choices,
)
from pgm_places.options import AtLeastZero, Options
from pgm_places.options.marks import Ge, Gt, Le
from pgm_places.solvers.forward import ChainPath

Mode = Literal["filter", "smooth", "viterbi"]
MODES: tuple[Mode, ...] = get_args(Mode)
# From this number of trajectories on, options are chosen on trajectories not counted in the tables.
FEWEST_DRIVES, FOLDS = 3, 5


@dataclass(frozen=True, eq=False)
class HiddenMarkovModel(LearnedNames, ChainTransitions, Options):
    """Labels the steps of a trajectory by classifier output and learned transitions.

    ``Bel(l_t) = alpha P(z_t | l_t) sum_m P(l_t | m) Bel(m_{t-1})`` (paper section 5, eq. 3). The
    transition model and the classifier's confusions are counted on labelled trajectories. Only
    chains can be labelled: ``LabelGraph.from_trajectory``.

    Parameters
    ----------
    mode : {"filter", "smooth", "viterbi"}
        Beliefs from the steps so far, as online; from all steps; or the most probable sequence.
    observation : {"auto", "posterior", "hard", "soft"}
        The likelihood ``P(z | l)`` of the classifier's output. ``hard`` looks up its best label in
        the confusions of training (the paper's); ``soft`` averages this over its probabilities z;
        ``posterior`` is z divided by the share of each label in training. ``auto`` chooses, for
        each mode, the one that labels the training sequences best (see ``evidence_weight``);
        ``soft`` without labelled sequences.
    start : {"uniform", "learned"}
        Belief before the first step: uniform (the paper's), or the frequencies of first labels in
        training.
    smoothing : float
        Added to every count.
    unlabelled : {"dropped", "hidden"}
        Steps without a label are ignored, or learned from by expectation maximisation
        (:func:`pgm_places.models.baum_welch.baum_welch`).
    evidence_weight : float or "fitted"
        Exponent of the likelihood, from 0 (observations are ignored) to 1 (the paper's:
        observations are independent given the labels). Errors of successive scans are correlated; a
        weight below 1 accounts for that. ``"fitted"`` chooses, for each mode, the weight that
        labels the training sequences of :meth:`fit` best, which should have held-out unaries; 1
        without labelled sequences.
    balance : float or "fitted"
        Preference for rare labels in the decision at a step: the label with the largest belief
        divided by ``share**balance``, with its share in training. 0 chooses the most probable
        label; 1 compares beliefs with the shares, which also finds short labels such as doorways.
        Beliefs do not change. ``"fitted"`` is chosen together with ``evidence_weight``; 0 without
        labelled sequences. Viterbi's sequence is decoded jointly and not affected.
    stay_below_m : float
        A robot that moved less than this between two steps counts as standing; needs positions. 0
        disables this.
    shrinkage : float or "fitted"
        Weight of the labels' shares mixed into every row of the transitions: 1 makes steps
        independent. ``"fitted"``: chosen together with ``observation`` and ``evidence_weight`` if
        both are to be fitted as well, else 0.
    step_length : {"usual", "positions", "given"}
        ``usual``: one table for every step. Otherwise ``expm(Q d)`` for a step of length d, which
        is the learned table at the median length in training (0.35 m on simulated runs). Lengths
        are distances of ``positions`` in metres, or the one column of ``edge_features``
        (``given``).

    Examples
    --------
    >>> from pgm_places import LabelGraph
    >>> graph = LabelGraph.from_trajectory(np.arange(12.0).reshape(6, 2))
    >>> truth = np.array([0, 0, 0, 1, 1, 1])
    >>> z = np.array([[0.8, 0.2], [0.4, 0.6], [0.8, 0.2], [0.2, 0.8], [0.4, 0.6], [0.1, 0.9]])
    >>> problem = LabelingProblem(graph, ["room", "corridor"], unary=np.log(z))
    >>> model = HiddenMarkovModel("smooth", "posterior").fit([problem], [truth])
    >>> model.infer(problem).labels.tolist()
    [0, 0, 0, 1, 1, 1]
    """

    traits: ClassVar[Traits] = Traits(
        uses_node_features=False, chains_only=True, labelling_options=("mode",)
    )

    name: ClassVar[str] = "hmm"
    mode: Mode = "filter"
    observation: Observation | Literal["auto"] = "auto"
    start: Literal["uniform", "learned"] = "uniform"
    smoothing: AtLeastZero = 1.0
    unlabelled: Literal["dropped", "hidden"] = "dropped"
    stay_below_m: AtLeastZero = 0.0
    evidence_weight: Annotated[float, Gt(0), Le(1)] | Literal["fitted"] = "fitted"
    balance: Annotated[float, Ge(0), Le(1)] | Literal["fitted"] = 0.0
    shrinkage: Annotated[float, Ge(0), Le(1)] | Literal["fitted"] = "fitted"
    step_length: StepLength = "usual"
    transition: NDArray[np.float64] | None = learned()
    """(K, K) probability of each label (column) after each (row), where the robot moved."""
    confusion: NDArray[np.float64] | None = learned()
    """(K, K) probability of the classifier's best label (column) at each true one (row)."""
    initial: NDArray[np.float64] | None = learned()
    """(K,) probability of each label at the first step."""
    prior: NDArray[np.float64] | None = learned()
    """(K,) share of each label in training."""
    stay: NDArray[np.float64] | None = learned()
    """(K, K) transitions where the robot stayed; None for the identity."""
    counted_m: NDArray[np.float64] | None = learned()
    """(1,) step length in metres over which ``transition`` was counted; None for simulated runs."""
    fitted_weights: NDArray[np.float64] | None = learned()
    """(3,) the fitted evidence weight for filter, smooth and viterbi."""
    fitted_balances: NDArray[np.float64] | None = learned()
    """(3,) the fitted exponent of the labels' shares for each mode."""
    fitted_shrinkages: NDArray[np.float64] | None = learned()
    """(3,) the fitted shrinkage of transitions for each mode."""
    fitted_observations: NDArray[np.int64] | None = learned()
    """(3,) the observation model for each mode, as an index into ``OBSERVATIONS``."""
    fitted_scores: NDArray[np.float64] | None = learned()
    """(3, 4) training accuracy and balanced accuracy of each mode, and of independent steps."""
    learning_curve: NDArray[np.float64] | None = learned()
    """(R,) objective of Baum-Welch by rounds, if unlabelled steps were used."""

    def fit(
        self,
        problems: Sequence[LabelingProblem],
        labelings: Sequence[NDArray[np.int64]],
        *,
        sample_weight: Sequence[ArrayLike] | None = None,
    ) -> Self:
        """A new model fitted to labelled trajectories.

        A transition is counted if two consecutive steps are labelled (and the robot moved), a
        confusion at each labelled step. A label without examples gets uniform probabilities.
        ``sample_weight`` has one weight, or one per step, for each trajectory.

        Raises
        ------
        InputError
            A graph is not a chain, there is no unary, labels differ from the first problem, or no
            step is labelled.
        """
        weights = weights_of(sample_weight, problems)
        learned_now = self._counted(problems, labelings, weights)
        if self.unlabelled == "hidden":
            from pgm_places.models.baum_welch import with_unlabelled  # not needed for inference

            hidden = with_unlabelled(learned_now, problems, labelings, self._moved, weights)
            learned_now = replace(learned_now, **hidden)
        elif self.can_shrink:
            models = learned_now._counted_elsewhere(problems, labelings, weights)
            return learned_now._with_choices(problems, labelings, weights, models)
        return learned_now.with_sequences(problems, labelings, sample_weight=sample_weight)

    def _counted(
        self,
        problems: Sequence[LabelingProblem],
        labelings: Sequence[NDArray[np.int64]],
        weights: Sequence[NDArray[np.float64]],
    ) -> Self:
        """A new model with the counts of trajectories, without fitted options."""
        tables = learned_tables(
            problems,
            labelings,
            self._moved,
            self.name,
            smoothing=float(self.smoothing),
            weights=weights,
            lengths=known_lengths(problems, self.step_length),
        )
        return replace(self, **tables, learning_curve=None).with_names_of(problems[0])

    def _counted_elsewhere(
        self,
        problems: Sequence[LabelingProblem],
        labelings: Sequence[NDArray[np.int64]],
        weights: Sequence[NDArray[np.float64]],
    ) -> list[Self]:
        """Per trajectory, a model counted on others; this model if there are too few."""
        different = list(dict.fromkeys(map(id, problems)))
        if len(different) < FEWEST_DRIVES:
            return [self] * len(problems)
        fold = [different.index(id(problem)) % FOLDS for problem in problems]
        models = {}
        for held_out in set(fold):
            rest = [k for k, number in enumerate(fold) if number != held_out]
            known = any(((labelings[k] >= 0) & (weights[k] > 0)).any() for k in rest)
            parts = [problems[k] for k in rest], [labelings[k] for k in rest]
            counts = [weights[k] for k in rest]
            models[held_out] = self._counted(*parts, counts) if known else self
        return [models[number] for number in fold]

    def with_sequences(
        self,
        problems: Sequence[LabelingProblem],
        labelings: Sequence[NDArray[np.int64]],
        *,
        sample_weight: Sequence[ArrayLike] | None = None,
    ) -> Self:
        """A new model with options chosen on labelled sequences, for each mode separately.

        See :func:`pgm_places.models.evidence_weight.fitted_by_mode`; arguments as in :meth:`fit`.
        """
        weights = weights_of(sample_weight, problems)
        return self._with_choices(problems, labelings, weights, [self] * len(problems))

    def _with_choices(
        self,
        problems: Sequence[LabelingProblem],
        labelings: Sequence[NDArray[np.int64]],
        weights: Sequence[NDArray[np.float64]],
        models: Sequence[Self],
    ) -> Self:
        """A new model with the options that label the trajectories best, each by its own model."""
        if not {"fitted", "auto"} & {self.evidence_weight, self.balance, self.observation}:
            return self
        return replace(self, **fitted_by_mode(models, MODES, problems, labelings, weights))

    def choose(self, beliefs: ArrayLike) -> NDArray[np.int64]:
        """(T,) the label chosen for each row of beliefs (T, K): see ``balance``."""
        rows = np.asarray(beliefs, np.float64)
        balance = self._fitted(self.balance, self.fitted_balances, 0.0)
        if balance == 0 or self.prior is None:
            return rows.argmax(axis=1)
        return (rows / np.where(self.prior > 0, self.prior, 1.0) ** balance).argmax(axis=1)

    def with_counts(
        self,
        *,
        confusions: ArrayLike | None = None,
        moves: ArrayLike | None = None,
        stays: ArrayLike | None = None,
        first: ArrayLike | None = None,
    ) -> Self:
        """A new model with tables from counts; tables without new counts do not change.

        ``smoothing`` is added to every count except ``stays``, so that label changes of a standing
        robot stay impossible.

        Parameters
        ----------
        confusions : (K, K) float, optional
            Counts of the classifier's best label (column) by true label (row). Sums of rows are
            also the labels' shares.
        moves, stays : (K, K) float, optional
            Counts of the next label (column) by label (row), where the robot moved or stayed;
            for example from :func:`pgm_places.sensing.simulated_moves.simulate_moves`.
        first : (K,) float, optional
            Counts of the first label of a trajectory; uniform by default.

        Examples
        --------
        >>> model = HiddenMarkovModel(smoothing=0.0)
        >>> model = model.with_counts(confusions=[[8, 2], [1, 9]], moves=[[19, 1], [1, 19]])
        >>> model.confusion.tolist(), model.transition.tolist()
        ([[0.8, 0.2], [0.1, 0.9]], [[0.95, 0.05], [0.05, 0.95]])
        """
        counts, begun = (confusions, moves, stays, first), self.initial is not None
        return replace(self, **counted_tables(*counts, smoothing=self.smoothing, begun=begun))

    @in_learned_order
    def infer(self, problem: LabelingProblem, *, further: ArrayLike | None = None) -> Labeling:
        """A label per step, with its beliefs unless the mode is ``viterbi``.

        ``info["impossible"]`` has the steps whose observation has probability 0; they count as
        steps without an observation. The score of a Viterbi path is its joint log-probability,
        which is also its bound.

        Known and forbidden (-inf) labels of the problem are always respected: transitions of
        probability 0 that contradict them count as 1e-200.

        Parameters
        ----------
        problem : LabelingProblem
            A chain.
        further : (T, K) float, optional
            Log-likelihoods of other observations, such as the step's position on a labelled map.

        Raises
        ------
        NotFittedError
            Before :meth:`fit`.
        InputError
            The graph is not a chain, there is no unary, or labels differ from training.
        """
        begin = time.perf_counter()
        unary = evident_unary(problem, self.name, observed=True)
        require_chain(problem.graph, self.name)
        observed = self._log_likelihood(unary)
        if further is not None:
            observed += finite_array("further", further, observed.shape)
        lengths = step_lengths(problem, self.step_length)
        chain = self._explained(problem.graph, observed, lengths)
        impossible, contradicts = chain.impossible, problem.evidence[chain.impossible]
        if contradicts.any():
            observed[impossible[~contradicts]] = 0.0
            chain = self._all_possible._explained(problem.graph, observed, lengths)
        info: dict[str, object] = {}
        if isinstance(chain, ChainPath):
            labels, beliefs, status = chain.labels, None, Status.EXACT
            total: float | None = chain.log_probability
        else:
            labels, beliefs, status = self.choose(chain.beliefs), chain.beliefs, Status.CONVERGED
            total = None
            info["log_evidence"] = -np.inf if len(impossible) else chain.log_evidence
        if len(impossible):
            log_impossible(impossible, len(labels))
        info["impossible"] = impossible.tolist()
        info["seconds"] = time.perf_counter() - begin
        return Labeling(labels, status, beliefs=beliefs, score=total, bound=total, info=info)

    def _log_likelihood(self, unary: NDArray[np.float64]) -> NDArray[np.float64]:
        """(T, K) ``log P(z_t | l)`` up to a constant per step; -inf where a label is forbidden."""
        confusion, prior = self._confusions_and_shares
        k = unary.shape[1]
        if len(prior) != k:
            raise InputError(
                f"the hidden Markov model learned {len(prior)} labels, but there are {k}"
            )
        weight = self._fitted(self.evidence_weight, self.fitted_weights, 1.0)
        return log_likelihood(unary, self.observation_model, confusion, prior, weight)

    @property
    def can_shrink(self) -> bool:
        """Whether shrinkage can be fitted."""
        return self.shrinkage == "fitted"

    @property
    def shrinkage_used(self) -> float:
        """The shrinkage of transitions in this mode, set or fitted."""
        return self._fitted(self.shrinkage, self.fitted_shrinkages, 0.0)

    @property
    def observation_model(self) -> Observation:
        """The observation model of this mode, set or chosen."""
        return chosen_observation(self, MODES.index(self.mode))

    @property
    def choices(self) -> dict[str, str]:
        """The choices on training sequences for this mode, in words by option."""
        return words_of_choices(self, MODES.index(self.mode))

    def _fitted(
        self,
        option: float | Literal["fitted"],
        by_mode: NDArray[np.float64] | None,
        otherwise: float,
    ) -> float:
        """The option's value, or the one fitted for this mode; ``otherwise`` before a fit."""
        if option != "fitted":
            return float(option)
        return otherwise if by_mode is None else float(by_mode[MODES.index(self.mode)])

    def _start(self) -> NDArray[np.float64]:
        if self.initial is None:
            raise NotFittedError("the hidden Markov model has no probabilities of the first label")
        k = len(self.initial)
        return self.initial if self.start == "learned" else np.full(k, 1.0 / k)

    @cached_property
    def _confusions_and_shares(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The classifier's confusions (K, K) and the labels' shares (K,), checked."""
        if self.confusion is None or self.prior is None:
            raise NotFittedError("the hidden Markov model has learned nothing yet; call fit first")
        confusion = finite_array("confusion", self.confusion, ("K", "K"))
        return confusion, finite_array("prior", self.prior, (len(confusion),))
