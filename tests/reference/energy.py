"""Pairwise models by brute force: every labelling is scored, one term after the other."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Model:
    """Log-potentials on a graph: ``agreement`` (E, K), or ``pairwise`` (K, K) or (E, K, K)."""

    unary: Array
    edges: NDArray[np.int64]
    agreement: Array | None = None
    pairwise: Array | None = None

    @property
    def arrays(self) -> tuple[Array, NDArray[np.int64], Array | None, Array | None]:
        """As every solver takes them."""
        return self.unary, self.edges, self.agreement, self.pairwise


def pair_score(model: Model, edge: int, first: int, second: int) -> float:
    if model.agreement is not None:
        return float(model.agreement[edge, first]) if first == second else 0.0
    if model.pairwise is None:
        return 0.0
    table = model.pairwise if model.pairwise.ndim == 2 else model.pairwise[edge]
    return float(table[first, second])


def score(model: Model, labels: tuple[int, ...]) -> float:
    total = 0.0
    for i, label in enumerate(labels):
        total += float(model.unary[i, label])
    for edge, (i, j) in enumerate(model.edges):
        total += pair_score(model, edge, labels[i], labels[j])
    return total


def labelings(model: Model) -> Iterator[tuple[int, ...]]:
    n_nodes, n_labels = model.unary.shape
    return product(range(n_labels), repeat=n_nodes)


def best_score(model: Model) -> float:
    return max(score(model, labels) for labels in labelings(model))


def best_labelings(model: Model, atol: float = 1e-9) -> list[tuple[int, ...]]:
    best = best_score(model)
    return [labels for labels in labelings(model) if score(model, labels) >= best - atol]


def best_move(model: Model, labels: tuple[int, ...], target: int) -> float:
    """The best score that one expansion move on ``target`` reaches."""
    choices = [{label, target} for label in labels]
    return max(score(model, moved) for moved in product(*choices))


def distribution(model: Model) -> tuple[Array, float]:
    """Marginals (N, K) and log Z of ``p ~ exp(score)``."""
    top = best_score(model)
    marginals = np.zeros(model.unary.shape)
    total = 0.0
    for labels in labelings(model):
        weight = float(np.exp(score(model, labels) - top))
        total += weight
        for i, label in enumerate(labels):
            marginals[i, label] += weight
    return marginals / total, float(top + np.log(total))


def pair_marginals(model: Model) -> Array:
    """(E, K, K) probability of the labels at both ends of each edge under ``p ~ exp(score)``."""
    n_labels = model.unary.shape[1]
    top = best_score(model)
    found = np.zeros((len(model.edges), n_labels, n_labels))
    total = 0.0
    for labels in labelings(model):
        weight = float(np.exp(score(model, labels) - top))
        total += weight
        for edge, (i, j) in enumerate(model.edges):
            found[edge, labels[i], labels[j]] += weight
    return found / total


def cut_value(
    source: Array,
    sink: Array,
    edges: NDArray[np.int64],
    forward: Array,
    backward: Array,
    source_side: tuple[bool, ...],
) -> float:
    total = 0.0
    for i, inside in enumerate(source_side):
        total += float(sink[i] if inside else source[i])
    for edge, (i, j) in enumerate(edges):
        if source_side[i] and not source_side[j]:
            total += float(forward[edge])
        if source_side[j] and not source_side[i]:
            total += float(backward[edge])
    return total
