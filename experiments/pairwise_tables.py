"""Learned tables of label pairs on three kinds of problems: python -m experiments.pairwise_tables.

Prints the tables of docs/crf.md and, with --picture FILE, draws what was learned. Every problem is
drawn from a seed; all methods learn from the same held-out scores of one classifier.
"""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from sklearn.linear_model import LogisticRegression

from experiments.defaults import Labelled, digit_chains, scored
from experiments.paper.markdown import markdown_table
from experiments.paper.section import Table
from pgm_places import LabelGraph, LabelingProblem, StructuredLabeler, build

SEEDS = range(5)
SIDE = 40

METHODS: dict[str, tuple[str, dict[str, Any]]] = {
    "each node alone": ("independent", {}),
    "Potts, `auto`": ("potts", {}),
    "AMN": ("amn", {}),
    "HMM, Viterbi": ("hmm", {"mode": "viterbi"}),
    "CRF, likelihood": ("crf", {"learner": "likelihood"}),
    "CRF, pseudo-likelihood": ("crf", {"learner": "pseudo-likelihood"}),
    "CRF, piecewise": ("crf", {"learner": "piecewise"}),
    "CRF, max margin": ("crf", {"learner": "max-margin"}),
}
"""What is compared; ``likelihood`` and the HMM only where the graph is a chain."""

CHAINS_ONLY = ("HMM, Viterbi", "CRF, likelihood")


def digits(seed: int) -> list[Labelled]:
    """A counter's handwritten digits: twelve chains to learn from, six to label."""
    return list(digit_chains(seed))


def clouds(seed: int) -> list[Labelled]:
    """Three labels in blobs on a grid, as in maps."""
    rng = np.random.default_rng(seed)
    smooth = [
        np.argmax([gaussian_filter(rng.normal(size=(SIDE, SIDE)), 3) for _ in range(3)], axis=0)
        for _ in range(5)
    ]
    return [_grid(truth, rng) for truth in smooth]


def stripes(seed: int) -> list[Labelled]:
    """Three labels in diagonal stripes one cell wide; edges say whether they lead right or down."""
    rng = np.random.default_rng(seed)
    rows, columns = np.mgrid[:SIDE, :SIDE]
    plain = [_grid((rows + 2 * columns + shift) % 3, rng) for shift in range(5)]
    return [
        (replace(problem, edge_features=_directions(problem)), truth) for problem, truth in plain
    ]


def _directions(problem: LabelingProblem) -> NDArray[np.float64]:
    """(E, 2) whether an edge leads right, and whether it leads down."""
    right = np.diff(problem.graph.edges, axis=1) == 1
    return np.hstack([right, ~right]).astype(np.float64)


def _grid(truth: NDArray[np.int64], rng: np.random.Generator) -> Labelled:
    labels = truth.ravel()
    looks = np.eye(3)[labels] + 1.2 * rng.normal(size=(labels.size, 3))
    graph = LabelGraph.from_lattice(truth.shape)
    return LabelingProblem(graph, ("a", "b", "c"), node_features=looks), labels


PROBLEMS: dict[str, tuple[Callable[[int], list[Labelled]], int]] = {
    "chains of digits": (digits, 12),
    "blobs on a grid": (clouds, 3),
    "stripes on a grid": (stripes, 3),
}
"""Name -> how problems are drawn, and how many of them are for learning."""


def accuracies(examples: list[Labelled], n_train: int, methods: Sequence[str]) -> list[float]:
    """The share of test nodes that each method labels as in the truth, in percent."""
    learning, (test, truths) = _scored_with_truth(examples, n_train)
    truth = np.concatenate(truths)
    found = [fitted(method, *learning).predict(test) for method in methods]
    return [100 * float(np.mean(np.concatenate(labels) == truth)) for labels in found]


def fitted(
    method: str, problems: list[LabelingProblem], truths: list[NDArray[np.int64]]
) -> StructuredLabeler:
    """The method, learned from scored problems."""
    name, options = METHODS[method]
    if name == "crf":
        options = {**options, "tables_tell": "order"}
    return StructuredLabeler(build(name, options)).fit(problems, truths)


def compared() -> Table:
    """Accuracy of every method on every kind of problem, means over the seeds."""
    columns = []
    for name, (draw, n_train) in PROBLEMS.items():
        methods = [m for m in METHODS if "chains" in name or m not in CHAINS_ONLY]
        found = np.mean([accuracies(draw(seed), n_train, methods) for seed in SEEDS], axis=0)
        shown = {m: f"{rate:.1f}" for m, rate in zip(methods, found, strict=True)}
        columns.append([shown.get(m, "-") for m in METHODS])
    rows = zip(METHODS, *columns, strict=True)
    return Table("", ("method", *PROBLEMS), tuple(rows))


Scored = tuple[list[LabelingProblem], list[NDArray[np.int64]]]


def _scored_with_truth(examples: list[Labelled], n_train: int) -> tuple[Scored, Scored]:
    train, test = scored(examples, n_train, LogisticRegression(C=0.01))
    truths = [truth for _, truth in examples]
    return (train, truths[:n_train]), (test, truths[n_train:])


def draw_tables(file: Path) -> None:
    """What was learned on digits and on stripes, beside what it is good for."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 4, figsize=(13, 3.6), layout="constrained")
    chains = digits(0)
    on_chain = fitted("CRF, likelihood", *_scored_with_truth(chains, 12)[0])
    table = on_chain.backend_.tables[0]
    shown = axes[0].imshow(table, cmap="PuOr_r", vmin=-abs(table).max(), vmax=abs(table).max())
    axes[0].set(title="learned on chains of digits", xlabel="next digit", ylabel="digit")
    axes[0].set(xticks=range(10), yticks=range(10))
    figure.colorbar(shown, ax=axes[0], shrink=0.8)
    learning, (tests, truths) = _scored_with_truth(stripes(0), 3)
    truth = truths[-1]
    pictures = {"stripes: the truth": truth}
    for title, method in {
        "each cell alone": "each node alone",
        "with learned tables": "CRF, max margin",
    }.items():
        pictures[title] = fitted(method, *learning).predict(tests)[-1]
    for axis, (title, labels) in zip(axes[1:], pictures.items(), strict=True):
        axis.imshow(labels.reshape(SIDE, SIDE), cmap="cividis", vmin=0, vmax=2)
        wrong = (labels != truth).mean()
        share = "" if labels is truth else f": {100 * wrong:.0f} % wrong"
        axis.set(title=title + share)
        axis.set(xticks=[], yticks=[])
    figure.savefig(file, dpi=110)


def main() -> None:
    """Run the comparison, or draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--picture", type=Path, help="draw what was learned into this file")
    arguments = parser.parse_args()
    if arguments.picture is not None:
        draw_tables(arguments.picture)
        return
    print(markdown_table(compared()))


if __name__ == "__main__":
    main()
