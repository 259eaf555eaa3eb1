"""Baum-Welch: transitions and confusions of an HMM from partly labelled chains.

Expectation maximisation of ::

    sum over chains weight * log p(observations, known labels)
    + smoothing * (sum of the tables' logarithms)

(L. Baum et al., "A maximization technique occurring in the statistical analysis of probabilistic
functions of Markov chains", Annals of Mathematical Statistics 41 (1970)). Labelled steps add their
counts, unlabelled steps their expected counts. No round lowers the objective.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.graph.known_labels import keep_known
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.problem import LabelingProblem, evident_unary, labelled_problems
from pgm_places.models.chain_statistics import normalised
from pgm_places.models.evidence_weight import Observation, log_likelihood, possible
from pgm_places.solvers.adjacency import adjacency
from pgm_places.solvers.forest import forest_marginals
from pgm_places.solvers.pairwise import pairwise_model
from pgm_places.solvers.relaxation import starting_beliefs

MAX_ROUNDS = 100

AT_REST = 1e-4
"""Learning ends when a round raises the objective per step by less than this."""


class ChainTables(NamedTuple):
    """The parameters of a hidden Markov model."""

    initial: NDArray[np.float64]
    """(K,)."""
    transition: NDArray[np.float64]
    """(K, K)."""
    confusion: NDArray[np.float64]
    """(K, K)."""


class ChainToLearn(NamedTuple):
    """The training data of one chain."""

    unary: NDArray[np.float64]
    """(T, K) log-probabilities of a classifier."""
    labels: NDArray[np.int64]
    """(T,) -1 where unknown."""
    moved: NDArray[np.bool_]
    """(T - 1,) whether the robot moved between each step and the next; else the label stays."""
    weight: float = 1.0
    """Weight of the chain."""


class _Expected(NamedTuple):
    """Expected counts of all chains, and the log-probability of the observations."""

    first: NDArray[np.float64]
    moves: NDArray[np.float64]
    confusions: NDArray[np.float64]
    log_evidence: float


@dataclass(frozen=True, eq=False)
class LearnedChains:
    """The tables, and the objective before each round and at the end (R + 1,)."""

    tables: ChainTables
    objectives: NDArray[np.float64]


def baum_welch(
    chains: Sequence[ChainToLearn],
    tables: ChainTables,
    prior: NDArray[np.float64],
    *,
    observation: Observation,
    learns_start: bool = True,
    smoothing: float = 1.0,
    max_rounds: int = MAX_ROUNDS,
) -> LearnedChains:
    """The tables at which expectation maximisation converges.

    ``tables`` were counted on labelled steps. ``prior`` (K,), the share of each label, divides
    ``posterior`` observations, for which confusions are not learned. The initial distribution is
    uniform unless ``learns_start``. ``smoothing`` is added to every expected count.
    """
    n_steps = max(sum(chain.weight * len(chain.labels) for chain in chains), 1.0)
    objectives: list[float] = []
    for _ in range(max_rounds):
        expected = _expected(chains, tables, prior, observation, learns_start)
        prior_terms = _log_prior(tables, smoothing, observation, learns_start)
        objectives.append(expected.log_evidence + prior_terms)
        if len(objectives) > 1 and objectives[-1] - objectives[-2] <= AT_REST * n_steps:
            break
        tables = ChainTables(
            normalised(expected.first + smoothing) if learns_start else tables.initial,
            normalised(expected.moves + smoothing),
            tables.confusion
            if observation == "posterior"
            else normalised(expected.confusions + smoothing),
        )
    return LearnedChains(tables, np.array(objectives))


def with_unlabelled(
    model: Any,
    problems: Sequence[LabelingProblem],
    labelings: Sequence[NDArray[np.int64]],
    moved: Callable[[LabelGraph], NDArray[np.bool_]],
    weights: Sequence[NDArray[np.float64]],
) -> dict[str, Any]:
    """Tables of a hidden Markov model learned with unlabelled steps, by the names of its fields.

    ``model`` has the tables counted on labelled steps; ``moved(graph)`` (T - 1,) is whether the
    robot moved. Each chain has one weight.
    """
    if any(len(np.unique(node_weights)) > 1 for node_weights in weights):
        raise InputError(
            "sample_weight needs one weight per chain with unlabelled='hidden'; use 'dropped' for "
            "weights of single steps"
        )
    pairs = labelled_problems(problems, labelings)
    chains = [
        ChainToLearn(
            evident_unary(problem, "hmm", observed=True),
            labels,
            moved(problem.graph),
            float(weight[0]),
        )
        for (problem, labels), weight in zip(pairs, weights, strict=True)
        if len(labels)
    ]
    learned = baum_welch(
        chains,
        ChainTables(model.initial, model.transition, model.confusion),
        model.prior,
        observation=model.observation_model,
        learns_start=model.start == "learned",
        smoothing=float(model.smoothing),
    )
    return {**learned.tables._asdict(), "learning_curve": learned.objectives}


def _expected(
    chains: Sequence[ChainToLearn],
    tables: ChainTables,
    prior: NDArray[np.float64],
    observation: Observation,
    learns_start: bool,
) -> _Expected:
    k = len(tables.initial)
    first, moves, confusions, total = np.zeros(k), np.zeros((k, k)), np.zeros((k, k)), 0.0
    start = tables.initial if learns_start else np.full(k, 1.0 / k)
    log_start, log_move = np.log(possible(start)), np.log(possible(tables.transition))
    log_stay = np.log(possible(np.eye(k)))
    for unary, labels, moved, weight in chains:
        scores = log_likelihood(unary, observation, tables.confusion, prior, 1.0)
        scores[0] += log_start
        steps = np.arange(len(labels))
        chain = adjacency(len(labels), np.stack([steps[:-1], steps[1:]], axis=1))
        pairwise = log_move if moved.all() else np.where(moved[:, None, None], log_move, log_stay)
        known = keep_known(scores, labels)
        chances = forest_marginals(pairwise_model(known, chain, pairwise=pairwise), pairs=True)
        assert chances.pair_beliefs is not None
        total += weight * chances.log_partition
        first += weight * chances.beliefs[0]
        moves += weight * chances.pair_beliefs[moved].sum(axis=0)
        confusions += weight * _confusions(unary, chances.beliefs, tables.confusion, observation)
    return _Expected(first, moves, confusions, total)


def _confusions(
    unary: NDArray[np.float64],
    beliefs: NDArray[np.float64],
    confusion: NDArray[np.float64],
    observation: Observation,
) -> NDArray[np.float64]:
    """(K, K) expected counts of the classifier's label (column) by true label (row)."""
    said_something = ~np.isnan(unary).any(axis=1)
    unary, beliefs = unary[said_something], beliefs[said_something]
    if observation == "hard":
        return beliefs.T @ np.eye(unary.shape[1])[unary.argmax(axis=1)]
    reported = starting_beliefs(unary)
    likelihood = reported @ confusion.T
    share = np.divide(beliefs, likelihood, out=np.zeros_like(beliefs), where=likelihood > 0)
    return (share.T @ reported) * confusion


def _log_prior(
    tables: ChainTables, smoothing: float, observation: Observation, learns_start: bool
) -> float:
    if smoothing == 0:
        return 0.0
    learned = [tables.transition]
    learned += [tables.initial] if learns_start else []
    learned += [] if observation == "posterior" else [tables.confusion]
    return smoothing * sum(float(np.log(possible(table)).sum()) for table in learned)
