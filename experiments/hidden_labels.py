"""Learning on a social graph of which few nodes are labelled: python -m experiments.hidden_labels.

Three groups, a dozen ties each, most of them within the group; features that tell a group in two
of three cases; 15 % of the nodes have a label. Prints the table of docs/crf.md.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.linear_model import LogisticRegression

from experiments.paper.markdown import markdown_table
from experiments.paper.section import Table
from pgm_places import LabelGraph, LabelingProblem, StructuredLabeler, build

SEEDS = range(10, 15)
"""Options were chosen on seeds 0 to 4."""

INSIDE = (0.7, 0.9)
"""Share of the ties within a group."""

METHODS: dict[str, tuple[str, dict[str, Any]]] = {
    "each node alone": ("independent", {}),
    "Potts, `auto`": ("potts", {}),
    "relaxation": ("relaxation", {}),
    "AMN, unlabelled nodes dropped": ("amn", {"unlabelled": "dropped"}),
    "AMN": ("amn", {}),
    "CRF, max margin, dropped": ("crf", {"learner": "max-margin", "unlabelled": "dropped"}),
    "CRF, max margin": ("crf", {"learner": "max-margin"}),
    "CRF, piecewise": ("crf", {"learner": "piecewise"}),
    "CRF, pseudo-likelihood": ("crf", {"learner": "pseudo-likelihood"}),
}

Truth = NDArray[np.int64]


def social_graph(seed: int, inside: float) -> tuple[LabelingProblem, Truth, Truth]:
    """A problem of 600 nodes, its truth, and the labels that are known (-1 elsewhere)."""
    rng = np.random.default_rng(seed)
    n, k, degree = 600, 3, 12
    truth = rng.integers(0, k, n)
    same = truth[:, None] == truth[None]
    chance = np.where(same, inside * degree * k / n, (1 - inside) * degree * k / (n * (k - 1)))
    edges = np.argwhere(np.triu(rng.random((n, n)) < chance, 1))
    looks = np.eye(k)[truth] + rng.normal(size=(n, k))
    labels = np.where(rng.random(n) < 0.15, truth, -1)
    graph = LabelGraph.from_edges(n, edges)
    return LabelingProblem(graph, ["a", "b", "c"], node_features=looks), truth, labels


def accuracy(method: str, seed: int, inside: float) -> float:
    """The share of nodes without a label that the method labels as in the truth, in percent."""
    problem, truth, labels = social_graph(seed, inside)
    name, options = METHODS[method]
    labeler = StructuredLabeler(build(name, options), LogisticRegression())
    found = labeler.fit([problem], [labels]).predict([problem])[0]
    hidden = labels < 0
    return 100 * float(np.mean(found[hidden] == truth[hidden]))


def main() -> None:
    """Print the table: the mean over the graphs, and the worst of them."""
    rows = []
    for method in METHODS:
        rates = [[accuracy(method, seed, inside) for seed in SEEDS] for inside in INSIDE]
        rows.append((method, *(f"{np.mean(each):.1f} ({min(each):.1f})" for each in rates)))
    heads = ("method", *(f"{100 * inside:.0f} % within the group" for inside in INSIDE))
    print(markdown_table(Table("", heads, tuple(rows))))


if __name__ == "__main__":
    main()
