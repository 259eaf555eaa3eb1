"""The choice of a learner's options by how they label held-out parts of the training problems."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.evaluation.confusion import balanced_accuracy, confusion_matrix

NODE_CHOICES = ("auto", "logz", "logz+raw")
"""Node features that are compared, the simpler ones first; ``auto`` where there is no choice."""

LEARNERS = (
    "cutting-plane", "qp", "likelihood", "pseudo-likelihood", "piecewise", "max-margin",
)  # fmt: skip
"""Learners by name; learned arrays hold their places here, so new ones come last."""

WORTH = 0.01
"""By how much a richer set of features must label held-out parts better than a simpler one: its
weights fit noise where it brings less."""


def node_choice(node_features: str) -> int:
    """The place of node features in :data:`NODE_CHOICES`, 0 for others."""
    return NODE_CHOICES.index(node_features) if node_features in NODE_CHOICES else 0


class Candidate(NamedTuple):
    """Options that are compared."""

    node_features: str
    learner: str
    penalty: float


def best_candidate(
    candidates: Sequence[Candidate],
    truth: Sequence[NDArray[np.int64]],
    answers: Mapping[Candidate, Sequence[NDArray[np.int64]]],
) -> tuple[Candidate, NDArray[np.float64]]:
    """The candidate that labels held-out parts best, and all of them with their scores.

    What counts is the mean of accuracy and balanced accuracy on all parts together. The smaller C
    wins among equals, and richer features only where they bring :data:`WORTH` more. Where no part
    could be held out it is the first candidate, with scores of NaN.

    Returns
    -------
    Candidate
    (P, 5) float
        Rows as :func:`choice_record` names them: places in :data:`NODE_CHOICES` and
        :data:`LEARNERS`, C, accuracy, balanced accuracy.

    Examples
    --------
    >>> small, large = (Candidate("logz", "qp", C) for C in (1.0, 10.0))
    >>> answers = {small: [np.array([0, 0])], large: [np.array([0, 1])]}
    >>> best_candidate([small, large], [np.array([0, 1])], answers)[0].penalty
    10.0
    """
    scores = np.full((len(candidates), 2), np.nan)
    if truth:
        everywhere = np.concatenate(truth)
        for row, candidate in zip(scores, candidates, strict=True):
            counts = confusion_matrix(everywhere, np.concatenate(answers[candidate]))
            row[:] = np.trace(counts) / counts.sum(), float(balanced_accuracy(counts))
    features = [node_choice(each.node_features) for each in candidates]
    learners = [LEARNERS.index(each.learner) for each in candidates]
    penalties = [each.penalty for each in candidates]
    table = np.column_stack([features, learners, penalties, scores])
    if not truth:
        return candidates[0], table
    means = scores.mean(axis=1)
    best: int | None = None
    for group in sorted(set(features)):
        members = [row for row, feature in enumerate(features) if feature == group]
        first = max(members, key=lambda row: (means[row], -penalties[row]))
        if best is None or means[first] > means[best] + WORTH:
            best = first
    assert best is not None  # there are candidates
    return candidates[best], table


def choice_record(
    table: NDArray[np.float64] | None, chosen: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """The rows of :func:`best_candidate` by name, with the one that was ``chosen`` marked."""
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
    """What a model chose, in words by option, from its summary with the ``held_out`` rows."""
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


def _options(row: Mapping[str, Any]) -> str:
    learner = "" if row["learner"] in ("cutting-plane", "qp") else f", {row['learner']}"
    features = "" if row["node_features"] == "auto" else f", {row['node_features']}"
    return f"C = {row['penalty']:g}{features}{learner}"


def _mean(row: Mapping[str, Any]) -> float:
    return float(row["accuracy"] + row["balanced_accuracy"])
