"""Model selection: options of a learner chosen on held-out parts of the training problems."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import learned_number, number_array
from pgm_places.errors import InputError
from pgm_places.evaluation.evaluation import balanced_accuracy, confusion_matrix

NODE_CHOICES = ("auto", "logz", "logz+raw", "offset+logz", "offset+logz+raw")
"""Node features to compare, simpler ones first; ``auto`` if there is no choice.
Learned arrays store indices into this tuple, so append new ones."""

LEARNERS = (
    "cutting-plane", "qp", "likelihood", "pseudo-likelihood", "piecewise", "max-margin",
)  # fmt: skip
"""Learners by name; learned arrays store indices into this tuple, so append new ones."""

TOLERANCE = 0.001
"""Loss of held-out accuracy that is accepted for a better balanced accuracy."""

WORTH = 0.01
"""Gain of the held-out score that a richer set of features needs: with less, it fits noise."""


def node_choice(node_features: str) -> int:
    """The index of node features in :data:`NODE_CHOICES`, 0 for others."""
    return NODE_CHOICES.index(node_features) if node_features in NODE_CHOICES else 0


class Candidate(NamedTuple):
    """One combination of options."""

    node_features: str
    learner: str
    penalty: float


Path = Callable[[float], tuple[NDArray[np.int64], NDArray[np.float64]]]
"""Learns without a part of the nodes, for one C after the other: labels of the part, weights."""


class Choice(NamedTuple):
    """The options that label held-out parts best."""

    best: Candidate
    table: NDArray[np.float64]
    """(P, 5) all comparisons, as named by :func:`choice_record`; NaN if nothing could be held
    out."""
    weights: NDArray[np.float64] | None
    """The mean of the weights learned without each part: a start for learning."""


def choose(
    labels: NDArray[np.int64],
    scored: NDArray[np.bool_],
    parts: NDArray[np.int64],
    kinds: tuple[Sequence[str], Sequence[str]],
    penalties: Sequence[float],
    usual: float,
    begin: Callable[[NDArray[np.bool_], str, str], Path],
    alone: NDArray[np.int64] | None = None,
    *,
    steps: NDArray[np.bool_],
) -> Choice:
    """The node features, learner and C that label held-out parts best.

    Every part is held out in turn: a model learns on the rest and labels the part. Single nodes are
    never held out, since their neighbours would reveal their labels, nor is a part with all
    examples of a label. C rises from the one below the usual (or middle) one, each start being the
    weights of the last, until the score falls by :data:`WORTH`; then C falls from the start as long
    as the smallest is best. Other learners are compared at the best C, richer features at the best
    C and one below. The choice is at most :data:`TOLERANCE` less accurate than the labels of nodes
    ``alone``. A C above the usual one must be more accurate by :data:`WORTH`: gains of rare labels
    at the cost of frequent ones are less reliable on new maps.

    ``labels`` (N,) are -1 where unknown, ``parts`` (N,) -1 where never held out; nodes ``scored``
    (N,) count. ``kinds`` are node features, simpler ones first, and learners; ``begin`` starts a
    path without the nodes of a mask (N,). Both scores are means over ``steps`` (N,) linked to cells
    and other nodes: the few steps of a drive weigh as much as the many cells of its map.
    """
    held_out = [
        parts == part
        for part in np.unique(parts[parts >= 0])
        if (scored & (parts == part)).any()
        and len(np.unique(labels[(parts != part) & (labels >= 0)])) == labels.max() + 1
    ]
    features, learners = kinds
    rising = sorted(penalties)
    if not held_out:
        none = {Candidate(features[0], learners[0], C): (np.nan, np.nan) for C in rising}
        return Choice(next(iter(none)), _table(none), None)
    scored_nodes = np.concatenate([np.flatnonzero(part & scored) for part in held_out])
    truth, on_steps = labels[scored_nodes], steps[scored_nodes]

    def scores_of(predicted: NDArray[np.int64]) -> tuple[float, float]:
        k = int(labels.max()) + 1
        kinds_of_nodes = (~on_steps, on_steps)
        return mean_scores([confusion_matrix(truth[on], predicted[on], k) for on in kinds_of_nodes])

    least = dict.fromkeys(rising, 0.0)
    if alone is not None:
        right, _ = scores_of(alone[scored_nodes])
        least = {C: right + (WORTH if usual < C else -TOLERANCE) for C in rising}
    paths: dict[tuple[str, str], list[Path]] = {}
    scores: dict[Candidate, tuple[float, float]] = {}
    weights: dict[Candidate, NDArray[np.float64]] = {}

    def score(name: str, learner: str, penalty: float) -> float:
        if (name, learner) not in paths:
            paths[name, learner] = [begin(part, name, learner) for part in held_out]
        outcomes = [path(penalty) for path in paths[name, learner]]
        answers = [mine[scored[part]] for (mine, _), part in zip(outcomes, held_out, strict=True)]
        candidate = Candidate(name, learner, penalty)
        scores[candidate] = scores_of(np.concatenate(answers))
        weights[candidate] = np.mean([w for _, w in outcomes], axis=0)
        return sum(scores[candidate]) / 2

    middle = rising.index(usual) if usual in rising else len(rising) // 2
    start, most = max(middle - 1, 0), 0.0
    for penalty in rising[start:]:
        value = score(features[0], learners[0], penalty)
        falls, most = value < most - WORTH, max(most, value)
        if falls or most == 1.0:
            break
    for penalty in rising[:start][::-1]:
        lower = rising[rising.index(penalty) + 1]
        best = best_candidate(scores, least)
        if scores[best][0] >= least[best.penalty] and (best.penalty != lower or most == 1.0):
            break
        score(features[0], learners[0], penalty)
    at = rising.index(best_candidate(scores, least).penalty)
    for learner in learners[1:]:
        score(features[0], learner, rising[at])
    for name in features[1:]:
        for penalty in rising[max(at - 1, 0) : at + 1]:
            score(name, best_candidate(scores, least).learner, penalty)
    best = best_candidate(scores, least)
    return Choice(best, _table(scores), weights[best])


def best_candidate(
    scores: Mapping[Candidate, tuple[float, float]], least: Mapping[float, float] | None = None
) -> Candidate:
    """The candidate of the largest mean of accuracy and balanced accuracy on held-out parts.

    Among equals the smaller C wins; richer features must be better by :data:`WORTH`. With a
    ``least`` accuracy for each C, the best candidate that reaches it is chosen, or the one of the
    smallest C if none does.

    Examples
    --------
    >>> small, large = (Candidate("logz", "qp", C) for C in (1.0, 10.0))
    >>> best_candidate({large: (0.9, 0.9), small: (1.0, 0.8)}).penalty
    1.0
    """
    accurate = [each for each in scores if not least or scores[each][0] >= least[each.penalty]]
    if not accurate:
        return min(scores, key=lambda each: (each.penalty, -scores[each][0]))
    best: Candidate | None = None
    for group in sorted({node_choice(each.node_features) for each in accurate}):
        members = [each for each in accurate if node_choice(each.node_features) == group]
        first = max(members, key=lambda each: (sum(scores[each]), -each.penalty))
        if best is None or sum(scores[first]) > sum(scores[best]) + 2 * WORTH:
            best = first
    assert best is not None  # there are candidates
    return best


def mean_scores(tables: Iterable[NDArray[np.int64] | NDArray[np.float64]]) -> tuple[float, float]:
    """Mean accuracy and balanced accuracy of confusion tables (K, K), one per kind of nodes."""
    some = [table for table in tables if table.any()]
    accuracy = float(np.mean([np.trace(table) / table.sum() for table in some]))
    return accuracy, float(np.mean([balanced_accuracy(table) for table in some]))


def _table(scores: Mapping[Candidate, tuple[float, float]]) -> NDArray[np.float64]:
    """(P, 5) indices into :data:`NODE_CHOICES` and :data:`LEARNERS`, C, both scores."""
    return np.array(
        [
            (node_choice(each.node_features), LEARNERS.index(each.learner), each.penalty, *both)
            for each, both in sorted(scores.items())
        ]
    )


def check_choices(table: NDArray[np.float64] | None) -> None:
    """Raise InputError if the table of a :class:`Choice` from a file is damaged."""
    if table is None:
        return
    if number_array("penalty_search", table).ndim != 2:
        raise InputError(f"penalty_search must be a table, got shape {table.shape}")
    for column, words in enumerate((NODE_CHOICES, LEARNERS) if table.shape[1] == 5 else ()):
        for row in range(len(table)):
            learned_number("penalty_search", table[:, column], row, len(words))


def choice_record(
    table: NDArray[np.float64] | None, chosen: Mapping[str, Any]
) -> list[dict[str, object]]:
    """The rows of a :class:`Choice` by name, with the one that was ``chosen`` marked."""
    if table is None or table.shape[1] != 5:  # of earlier versions: C and balanced accuracy
        return []
    rows = []
    for place, learner, penalty, accuracy, balanced in table.tolist():
        options = {
            "node_features": NODE_CHOICES[int(place)],
            "learner": LEARNERS[int(learner)],
            "penalty": penalty,
        }
        scores = {"accuracy": accuracy, "balanced_accuracy": balanced}
        known = {name: None if np.isnan(score) else score for name, score in scores.items()}
        features = options["node_features"] in ("auto", chosen.get("node_features"))
        taken = features and penalty == chosen.get("penalty")
        rows.append({**options, **known, "chosen": taken})
    return rows


def choice_words(summary: Mapping[str, Any]) -> dict[str, str]:
    """A model's choices in words by option, from its summary with the ``held_out`` rows."""
    words: dict[str, str] = {}
    rows = [row for row in summary.get("held_out", []) if row["accuracy"] is not None]
    if rows:
        taken = [row for row in rows if row["chosen"]]
        best = max(taken or rows, key=_mean)
        others = [row for row in rows if _options(row) != _options(best)]
        text = f"{_options(best)} ({held_out_words(best)}"
        if others:
            second = max(others, key=_mean)
            text += f"; next {_options(second)}, {held_out_words(second)}"
        words["C and node features"] = f"{text})"
    if summary.get("reason") not in (None, "chosen by hand"):
        words["learner"] = f"{summary['learner']}: {summary['reason']}"
    return words


def held_out_words(row: Mapping[str, Any]) -> str:
    """Both scores of a row, in percent."""
    accuracy, balanced = 100 * row["accuracy"], 100 * row["balanced_accuracy"]
    return f"held-out accuracy {accuracy:.1f}, balanced {balanced:.1f}"


def _options(row: Mapping[str, object]) -> str:
    learner = "" if row["learner"] in ("cutting-plane", "qp") else f", {row['learner']}"
    features = "" if row["node_features"] == "auto" else f", {row['node_features']}"
    return f"C = {row['penalty']:g}{features}{learner}"


def _mean(row: Mapping[str, Any]) -> float:
    return float(row["accuracy"] + row["balanced_accuracy"])
