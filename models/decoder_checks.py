"""Conformance test of decoders against brute force."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InfeasibleError, InputError, SolverError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.labeling import Labeling, Status
from pgm_places.inference.potentials import Potentials, score
from pgm_places.models.decoding import decode

# Scales of potentials, in turn.
SCALES = (1.0, 1e-12, 1e12)

# Ratios of edge to node potentials, in turn for problems with unequal scales.
RATIOS = (1e-12, 1e-6, 1e6, 1e12)

# Tolerance as a share of the score and the size of a problem: ten times that of a proof.
ROUNDING = 1e-11

MOST_NODES, MOST_LABELS = 8, 3


@dataclass(frozen=True)
class DecoderReport:
    """The results of a decoder that passed all test problems."""

    statuses: Mapping[str, int]
    """Number of labellings by status; ``infeasible`` includes correct InfeasibleErrors."""
    refused: int
    """Number of problems that it does not support (InputError)."""
    best: int
    """Number of optimal labellings, proved or not."""


def check_decoder(name: str, *, n_problems: int = 300, seed: int = 0) -> DecoderReport:
    """Test a decoder against brute force on random problems of up to 8 nodes and 3 labels.

    The problems have graphs with and without cycles, some frustrated so that relaxations are not
    tight; rewards of agreement and tables; many ties; forbidden labels and pairs of labels; known
    labels; potentials of about 1, 1e-12 and 1e12; and edge potentials a million or a trillion times
    larger or smaller than node potentials. Use it as the first test of a new decoder: built in,
    registered or installed.

    Raises
    ------
    SolverError
        An answer is wrong: ``EXACT`` although a labelling is better; a bound that a labelling
        exceeds, or that proves a labelling without status ``EXACT``; a forbidden labelling or a
        changed known label although others are allowed; ``REPAIRED`` although another label of one
        node is better; beliefs that do not sum to one or are positive for forbidden labels;
        InfeasibleError although a labelling is allowed. The message has the fault and the problem
        (see :func:`small_problems`).

    Examples
    --------
    >>> report = check_decoder("icm", n_problems=30)
    >>> report.refused, sum(report.statuses.values())
    (0, 30)
    """
    statuses: Counter[str] = Counter()
    refused = best = 0
    for index, (graph, potentials) in enumerate(small_problems(n_problems, seed)):
        scores = _all_scores(graph, potentials)
        where = f"decoder {name!r} on problem {index} of seed {seed}"
        try:
            labeling = decode(graph, potentials, name, certify=index % 2 == 1)
        except InfeasibleError:
            if scores.max() > -np.inf:
                raise SolverError(f"{where}: calls it infeasible, but it is not") from None
            statuses[str(Status.INFEASIBLE)] += 1
            continue
        except InputError:
            refused += 1
            continue
        best += _check(where, graph, potentials, labeling, float(scores.max()))
        statuses[str(labeling.status)] += 1
    return DecoderReport(dict(statuses), refused, best)


def small_problems(n_problems: int, seed: int) -> Iterator[tuple[LabelGraph, Potentials]]:
    """The test problems of :func:`check_decoder`."""
    rng = np.random.default_rng(seed)
    for index in range(n_problems):
        traits = _TRAITS[index % len(_TRAITS)]
        least = (5, MOST_LABELS) if traits.torn else (1, 1)
        n_nodes = int(rng.integers(least[0], MOST_NODES + 1))
        n_labels = int(rng.integers(least[1], MOST_LABELS + 1))
        forest = index % 3 == 0 and not traits.torn
        graph = LabelGraph.from_edges(n_nodes, _edges(rng, n_nodes, forest, torn=traits.torn))
        coarse = rng.random() < 0.5
        unit = SCALES[index // 3 % len(SCALES)]

        def drawn(*shape: int, coarse: bool = coarse, unit: float = unit) -> NDArray[np.float64]:
            """Random values; few distinct ones make ties."""
            values = rng.integers(-3, 4, shape) / 2 if coarse else rng.normal(size=shape)
            return unit * values

        unary = drawn(n_nodes, n_labels) * (0.1 if traits.torn else 1.0)
        barred = rng.random(unary.shape) < (0.0 if traits.torn else rng.choice([0.0, 0.3]))
        barred[np.arange(n_nodes), rng.integers(0, n_labels, n_nodes)] = False
        unary[barred] = -np.inf
        kind = index % 5
        ratio = RATIOS[index // 4 % len(RATIOS)] if traits.apart else 1.0
        if kind < 2:
            reward = ratio * drawn(graph.n_edges, n_labels)
            yield graph, Potentials(unary, agreement=np.abs(reward) if kind else reward)
            continue
        table = ratio * drawn(*([graph.n_edges] if kind < 4 else []), n_labels, n_labels)
        share = 0.5 if traits.ruled else 0.0 if traits.torn else rng.choice([0.0, 0.3])
        table[rng.random(table.shape) < share] = -np.inf
        potentials = Potentials(unary, pairwise=table)
        known = np.full(n_nodes, -1)
        if kind == 4:
            known[0] = unary[0].argmax()
        yield graph, potentials.with_known(known)


class _Traits(NamedTuple):
    """Difficulties of a test problem."""

    torn: bool = False
    """Weak nodes and many cycles of strong edges: relaxations are not tight."""
    ruled: bool = False
    """Half of the pairs of labels are forbidden: labellings have to be repaired."""
    apart: bool = False
    """Edge potentials are far larger or far smaller than node potentials."""


_TRAITS = (_Traits(), _Traits(torn=True), _Traits(ruled=True), _Traits(apart=True))
"""In turn."""


def _edges(
    rng: np.random.Generator, n_nodes: int, forest: bool, *, torn: bool
) -> list[tuple[int, int]]:
    if forest:
        return [(int(rng.integers(0, j)), j) for j in range(1, n_nodes) if rng.random() < 0.9]
    every = [(i, j) for j in range(n_nodes) for i in range(j)]
    share = rng.uniform(0.5 if torn else 0.0, 1.0)
    return [pair for pair in every if rng.random() < share]


def _all_scores(graph: LabelGraph, potentials: Potentials) -> NDArray[np.float64]:
    """(M,) the scores of all labellings."""
    n, k = potentials.unary.shape
    every = np.indices((k,) * n).reshape(n, -1)
    total = potentials.unary[np.arange(n)[:, np.newaxis], every].sum(axis=0)
    for (i, j), table in zip(graph.edges, potentials.edge_tables(graph), strict=True):
        total = total + table[every[i], every[j]]
    return total


def _check(
    where: str, graph: LabelGraph, potentials: Potentials, labeling: Labeling, best: float
) -> bool:
    """Raise SolverError if the labelling contradicts its status; whether it is optimal."""
    terms = potentials.unary, potentials.edge_tables(graph)
    sizes = [np.abs(term[np.isfinite(term)]).max(initial=0.0) for term in terms]
    slack = ROUNDING * sum(size * len(term) for size, term in zip(sizes, terms, strict=True))
    if labeling.score != score(graph, potentials, labeling.labels):
        raise SolverError(f"{where}: its score is not that of its labels")
    if best > -np.inf and labeling.score == -np.inf and labeling.status is not Status.INFEASIBLE:
        raise SolverError(f"{where}: it breaks a rule, but its status is {labeling.status}")
    if labeling.bound is not None and labeling.bound < best - slack:
        raise SolverError(
            f"{where}: its bound is {labeling.bound:.12g}, but one scores {best:.12g}"
        )
    if labeling.status is Status.INFEASIBLE and labeling.score > -np.inf:
        raise SolverError(f"{where}: called infeasible, but it breaks no rule")
    if labeling.bound == labeling.score and labeling.status is not Status.EXACT:
        raise SolverError(f"{where}: its bound proves it, but its status is {labeling.status}")
    if labeling.status is Status.REPAIRED and _gain_of_one(graph, potentials, labeling) > slack:
        raise SolverError(f"{where}: called repaired, but another label at one node scores more")
    is_best = bool(labeling.score >= best - slack)
    if labeling.status is Status.EXACT and not is_best:
        raise SolverError(
            f"{where}: called exact with {labeling.score:.12g}, but one scores {best:.12g}"
        )
    if labeling.beliefs is not None and (abs(labeling.beliefs.sum(axis=1) - 1) > 1e-9).any():
        raise SolverError(f"{where}: its beliefs do not sum to one")
    if labeling.beliefs is not None and labeling.beliefs[potentials.unary == -np.inf].any():
        raise SolverError(f"{where}: it believes in a label that is forbidden")
    return is_best


def _gain_of_one(graph: LabelGraph, potentials: Potentials, labeling: Labeling) -> float:
    """The gain of the best change of a single node's label."""
    assert labeling.score is not None
    best = labeling.score
    for node, label in np.ndindex(potentials.unary.shape):
        changed = labeling.labels.copy()
        changed[node] = label
        best = max(best, score(graph, potentials, changed))
    return best - labeling.score
