"""Summary statistics of a labelling problem, with warnings."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.graph.cliques import Cliques
from pgm_places.graph.label_graph import LabelGraph

# Below this share of the labelled nodes' links, links between labelled nodes are too few.
FEW_INSIDE = 0.5

# A label of fewer nodes than this share is easily lost.
RARE = 0.02

# A rare label is missed by a unary that predicts it on less than this share of its nodes.
OVERLOOKED = 0.5

# Rows of probabilities sum to 1 within this.
PROBABILITY_ROUNDING = 1e-3

# Neighbours hardly change a node whose best label is a hundred times as probable as the second.
SURE = np.log(100.0)


@dataclass(frozen=True)
class ProblemDescription:
    """Statistics of a problem and its labels; ``print`` shows them line by line.

    ``labelled`` and ``in_cliques`` are shares of the nodes, ``balance`` the share of each label
    among the labelled nodes. ``median_margin`` is the median over nodes of the difference between
    the unaries of the best and the second label; ``collapse_weight`` the Potts weight at which the
    neighbours of a node of mean degree together outweigh it: larger weights spread labels rather
    than smooth them. ``clique_purity`` is the mean share of the most frequent label among the
    labelled nodes of a clique; low values mean uninformative cliques.
    """

    n_nodes: int
    n_edges: int
    n_labels: int
    mean_degree: float
    n_isolated: int
    labelled: float
    balance: dict[str, float]
    median_margin: float | None
    collapse_weight: float | None
    warnings: tuple[str, ...]
    n_cliques: int = 0
    in_cliques: float = 0.0
    clique_purity: float | None = None

    def __str__(self) -> str:
        lines = [
            f"{self.n_nodes} nodes, {self.n_edges} edges, {self.n_labels} labels",
            f"{self.mean_degree:.1f} neighbours in the mean, {self.n_isolated} nodes with none",
            f"{100 * self.labelled:.0f} % of the nodes have a label",
        ]
        if self.balance:
            shares = ", ".join(
                f"{name} {100 * share:.1f} %" for name, share in self.balance.items()
            )
            lines.append(f"of these: {shares}")
        if self.n_cliques:
            pure = self.clique_purity
            of_one = "" if pure is None else f", {100 * pure:.0f} % of their labels the same"
            lines.append(
                f"{self.n_cliques} cliques with {100 * self.in_cliques:.0f} % of the nodes{of_one}"
            )
        if self.median_margin is not None:
            lines.append(f"unary: best label over second {self.median_margin:.2f} (median)")
        if self.collapse_weight is not None:
            lines.append(f"neighbours decide at Potts weights above {self.collapse_weight:.2f}")
        return "\n".join([*lines, *(f"! {warning}" for warning in self.warnings)])


def describe(
    graph: LabelGraph,
    label_names: Sequence[str],
    truth: NDArray[np.int64],
    unary: NDArray[np.float64] | None,
    cliques: Cliques | None,
) -> ProblemDescription:
    """Statistics of a problem and labels (N,), -1 where unknown; see `LabelingProblem.describe`."""
    n, n_labels = graph.n_nodes, len(label_names)
    is_known = truth >= 0
    counts = np.bincount(truth[is_known], minlength=n_labels) / max(is_known.sum(), 1)
    balance = dict(zip(label_names, counts.tolist(), strict=True)) if is_known.any() else {}
    mean_degree = 2 * graph.n_edges / max(n, 1)
    margin = _median_margin(unary)
    return ProblemDescription(
        n_nodes=n,
        n_edges=graph.n_edges,
        n_labels=n_labels,
        mean_degree=mean_degree,
        n_isolated=int((graph.degree == 0).sum()),
        labelled=float(is_known.mean()) if n else 0.0,
        balance=balance,
        median_margin=margin,
        collapse_weight=None if margin is None or not mean_degree else margin / mean_degree,
        warnings=(
            *_about_labels(graph, truth, balance),
            *_about_probabilities(unary),
            *_about_unary(margin),
            *_about_posteriors(label_names, truth, unary),
        ),
        **({} if cliques is None else _about_cliques(cliques, truth, n_labels)),
    )


def _about_cliques(cliques: Cliques, truth: NDArray[np.int64], n_labels: int) -> dict[str, Any]:
    """The fields of a description on cliques."""
    nodes, of_set = cliques.links[truth[cliques.members] >= 0].T
    counts = np.zeros((len(cliques.sizes), n_labels))
    np.add.at(counts, (of_set, truth[nodes]), 1.0)
    counts = counts[counts.any(axis=1)]
    purity = counts.max(axis=1) / counts.sum(axis=1)
    return {
        "n_cliques": len(cliques.sizes),
        "in_cliques": len(np.unique(cliques.members)) / max(len(truth), 1),
        "clique_purity": float(purity.mean()) if len(purity) else None,
    }


def _median_margin(unary: NDArray[np.float64] | None) -> float | None:
    """Median difference of the best and second unary, over nodes with two allowed labels."""
    if unary is None or unary.shape[1] < 2:
        return None
    best = np.sort(unary, axis=1)[:, -2:]
    is_finite = best[:, 0] > -np.inf
    return float(np.median(best[is_finite, 1] - best[is_finite, 0])) if is_finite.any() else None


def _about_labels(
    graph: LabelGraph, truth: NDArray[np.int64], balance: dict[str, float]
) -> list[str]:
    lines = []
    missing = [name for name, share in balance.items() if share == 0]
    rare = [name for name, share in balance.items() if 0 < share < RARE]
    if missing:
        lines.append(f"no node is labelled {_listed(missing)}: it cannot be learned")
    if rare:
        lines.append(
            f"{_listed(rare)}: under {100 * RARE:.0f} % of the labels; judge by balanced accuracy, "
            "and let class_weight count rare labels more"
        )
    ends = (truth >= 0)[graph.edges]
    if 0 < 2 * int(ends.all(axis=1).sum()) < FEW_INSIDE * int(ends.sum()) or (
        ends.any() and not ends.all(axis=1).any()
    ):
        lines.append(
            "most links of labelled nodes lead to nodes without a label: learned without these "
            "(unlabelled='dropped'), links would give all nodes one label; complete them "
            "('hidden'), or take relaxation"
        )
    return lines


def _about_probabilities(unary: NDArray[np.float64] | None) -> list[str]:
    """A warning if every row of the unary is a distribution, so that its logarithm is missing."""
    if unary is None or not unary.size or unary.min() < 0:
        return []
    if np.abs(unary.sum(axis=1) - 1).max() > PROBABILITY_ROUNDING:
        return []
    return [
        "unary holds probabilities in place of their logarithms: use "
        "LabelingProblem.from_probabilities"
    ]


def _about_unary(median: float | None) -> list[str]:
    if median is None:
        return []
    if median == 0:
        return ["unary is equal for the best labels of most nodes: neighbours decide alone"]
    if median > SURE:
        return [
            f"unary is very confident (a factor of {np.exp(min(median, 700.0)):.0f} between "
            "the best labels of the median node): neighbours will change little; calibrate the "
            "classifier, or use held-out scores"
        ]
    return []


def _about_posteriors(
    label_names: Sequence[str], truth: NDArray[np.int64], unary: NDArray[np.float64] | None
) -> list[str]:
    """A warning if the unary hardly ever predicts rare labels, which neighbours make worse."""
    known = np.flatnonzero(truth >= 0)
    if unary is None or not len(known):
        return []
    n_labels = len(label_names)
    share = np.bincount(truth[known], minlength=n_labels) / len(known)
    named = np.bincount(unary[known].argmax(axis=1), minlength=n_labels) / len(known)
    lost = [
        label_names[k]
        for k in np.flatnonzero((share > 0) & (share < 1 / n_labels)).tolist()
        if named[k] < OVERLOOKED * share[k]
    ]
    if not lost:
        return []
    return [
        f"unary hardly ever names {_listed(lost)}: posteriors hold the labels' shares, and "
        "neighbours count them again; for potts, divide by them (evidence='likelihood'), or weigh "
        "the classifier's classes equally"
    ]


def _listed(names: Sequence[str]) -> str:
    return ", ".join(map(repr, names))
