"""Iterations and prior share of relaxation, chosen on held-out parts of training problems.

Every iteration erodes narrow regions; the best number depends on the cells and on the classifier.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import learned_number
from pgm_places.evaluation.evaluation import confusion_matrix
from pgm_places.inference.problem import evident_unary
from pgm_places.models.evidence_weight import divided_share
from pgm_places.models.held_out_choice import TOLERANCE, WORTH, held_out_words, mean_scores
from pgm_places.models.labelled_examples import Example, held_out_parts, linked_steps
from pgm_places.solvers.relaxation import Beliefs, OnIteration

ITERATIONS = (1, 2, 3, 5, 7, 10, 15, 20, 30, 50)
"""Candidate numbers of iterations; the last is used if nothing can be held out."""

SHARES = (0.0, 0.25, 0.5)
"""Candidate shares of the prior."""

LARGE_SHARE = 0.5
"""From this share on, held-out accuracy must rise by 0.01 (``WORTH``): rare labels then gain at the
cost of frequent ones, a gain that is less reliable on new maps."""

N_PARTS = 4
"""Parts that are held out in turn."""


def iterations_of(choice: NDArray[np.float64] | None) -> int:
    """The chosen number of iterations; the largest without a choice."""
    most = ITERATIONS[-1]
    return most if choice is None else learned_number("choice", choice, 0, most + 1)


def compared(method: Any, examples: Sequence[Example]) -> NDArray[np.float64] | None:
    """(P, 4) iterations, shares of the prior, accuracy and balanced accuracy on held-out parts.

    ``method`` is a :class:`~pgm_places.models.relaxation.Relaxation`. The first row has no
    iterations. If steps are linked to cells, both scores are means over steps and cells. None if a
    problem has no informative unary, or every part has all examples of a label.
    """
    for problem, _ in examples:
        if problem.unary is None or (problem.unary == problem.unary[:, :1]).all():
            return None
    ends = np.cumsum([len(truth) for _, truth in examples])[:-1]
    parts = np.split(held_out_parts(examples, N_PARTS), ends)
    shares = SHARES if method.evidence == "auto" else (divided_share(method.evidence),)
    k = examples[0][0].n_labels
    rows = [(0, 0.0), *product(ITERATIONS, shares)]
    counts = {row: np.zeros((2, k, k)) for row in rows}
    steps = [linked_steps(problem.graph) for problem, _ in examples]
    plain = replace(method, max_iterations=ITERATIONS[-1], evidence=0.0, tolerance=0.0)
    for part in range(N_PARTS):
        rest = _among(examples, [where != part for where in parts])
        masks = [where == part for where in parts]
        held_out = _among(examples, masks)
        kinds = [on[mask] for on, mask in zip(steps, masks, strict=True) if mask.any()]
        if not held_out or len({y for _, truth in rest for y in np.unique(truth).tolist()}) < k:
            continue
        if not any(plain.counts(*example).any() for example in rest):
            continue
        fitted = plain.fit([problem for problem, _ in rest], [truth for _, truth in rest])
        for (problem, truth), kind in zip(held_out, kinds, strict=True):
            alone = evident_unary(problem, "relaxation", single=True).argmax(axis=1)
            counts[0, 0.0] += _by_kind(kind, truth, alone, k)
            for share in shares:
                run = replace(fitted, evidence=share)
                adds = {n: counts[n, share] for n in ITERATIONS}
                end = run.relaxed(problem.graph, run.start(problem), _adds(kind, truth, adds))
                labels = end.beliefs.argmax(axis=1)  # converged: further iterations change nothing
                for n in ITERATIONS:
                    if n > end.iterations:
                        counts[n, share] += _by_kind(kind, truth, labels, k)
    if not counts[0, 0.0].any():
        return None
    scores = [mean_scores(tables) for tables in counts.values()]
    return np.array([(*row, *score) for row, score in zip(rows, scores, strict=True)])


def best_row(table: NDArray[np.float64]) -> NDArray[np.float64]:
    """The row with the best mean of both scores among those as accurate as the first.

    Accuracy may fall by :data:`TOLERANCE`, but must rise with a large share of the prior
    (:data:`LARGE_SHARE`). Among equals the fewest iterations win; without candidates the first row.
    """
    rows = table[1:]
    least = table[0, 2] + np.where(rows[:, 1] < LARGE_SHARE, -TOLERANCE, WORTH)
    good = rows[rows[:, 2] >= least]
    return good[int(good[:, 2:].mean(axis=1).argmax())] if len(good) else table[0]


def label_shares(examples: Sequence[Example]) -> NDArray[np.float64]:
    """(K,) the share of each label among labelled nodes, with add-one smoothing."""
    n_labels = examples[0][0].n_labels
    counts = np.ones(n_labels)
    for _, truth in examples:
        counts += np.bincount(truth[truth >= 0], minlength=n_labels)
    shares: NDArray[np.float64] = counts / counts.sum()
    return shares


def rows_of(table: NDArray[np.float64]) -> list[dict[str, float]]:
    """The rows of :func:`compared` by name."""
    names = ("max_iterations", "evidence", "accuracy", "balanced_accuracy")
    return [dict(zip(names, row, strict=True)) for row in table.tolist()]


def choice_words(summary: Mapping[str, Any]) -> dict[str, str]:
    """The choices in words by option, from a summary with the ``held_out`` rows."""
    taken = summary["max_iterations"], summary["evidence"]
    rows = summary["held_out"]
    [best] = [row for row in rows if (row["max_iterations"], row["evidence"]) == taken]
    start = f"{taken[0]} from the scores without {taken[1]:g} of the prior"
    alone = held_out_words(rows[0])
    return {"max_iterations": f"{start} ({held_out_words(best)}; scores alone, {alone})"}


def _among(examples: Sequence[Example], masks: Sequence[NDArray[np.bool_]]) -> list[Example]:
    """The problems restricted to the nodes of a mask, without empty ones."""
    return [
        (problem.subproblem(nodes), truth[nodes])
        for (problem, truth), nodes in zip(examples, masks, strict=True)
        if nodes.any()
    ]


def _by_kind(
    steps: NDArray[np.bool_], truth: NDArray[np.int64], labels: NDArray[np.int64], k: int
) -> NDArray[np.int64]:
    """(2, K, K) confusion counts (truth, label) of cells, and of steps linked to cells."""
    return np.stack([confusion_matrix(truth[on], labels[on], k) for on in (~steps, steps)])


def _adds(
    steps: NDArray[np.bool_],
    truth: NDArray[np.int64],
    counts: dict[int, NDArray[np.float64]],
) -> OnIteration:
    """A callback that adds the labels after some iterations to confusion counts (2, K, K)."""

    def note(iteration: int, _change: float, beliefs: Callable[[], Beliefs]) -> None:
        if iteration in counts:
            tables = counts[iteration]
            tables += _by_kind(steps, truth, beliefs().argmax(axis=1), tables.shape[1])

    return note
