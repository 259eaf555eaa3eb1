"""The order of label names changes the order of tables and no figure."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import permutations
from math import isclose
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pgm_places.experiment.comparison import Comparison
from pgm_places.experiment.config import parse_config
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.runs import compare

ORDERS = tuple(permutations(("corridor", "room", "doorway")))[::3]
UNARIES = ("laser", "context", "space")
METHODS = ("independent", "potts", "relaxation", "amn", "crf")
WITHOUT_LEARNING = METHODS[:3]
SMALL = {
    0.2: (20, "laser", (((0, 200), (200, 400)), (100, 300))),
    0.1: (4, "context", (((60, 120), (120, 180)), (210, 270))),
    0.05: (2, "space", (((60, 120), (120, 180)), (210, 270))),
}
"""Rounds of boosting, what AMN and CRF learn from, and small parts of the building, by cells."""


def compared(
    names: Sequence[str],
    resolution_m: float,
    n_rounds: int,
    methods: Sequence[tuple[str, str]],
    parts: tuple[Sequence[tuple[int, int]], tuple[int, int]],
) -> Comparison:
    """Methods by name and unary, learned on one part of a generated building, on another part.

    Parts are the columns of the training and of the test part, and the rows of both, in cells of
    0.05 m.
    """
    train, test = (
        [{"generated": 3, "columns": columns, "rows": parts[1], "name": f"from {columns[0]}"}]
        for columns in parts[0]
    )
    config = {
        "resolution_m": resolution_m,
        "labels": {"names": names},
        "train": train,
        "test": test,
        "classifier": {"n_rounds": n_rounds, "n_folds": 2},
        "context": {"half_widths_m": [0.5]},
        "space": {"n_rounds": n_rounds},
        "methods": [
            {"id": f"{name} {seen}", "name": name, "unary": seen} for name, seen in methods
        ],
    }
    return compare(Experiment(parse_config(config), Path()))


def differences(one: Comparison, other: Comparison) -> Iterator[str]:
    """Each figure of a method that differs between two orders of the names, with both values."""
    for first, second in zip(one.methods, other.methods, strict=True):
        labels = [
            np.array(names.label_names)[method.labelings[0].labels]
            for names, method in ((one, first), (other, second))
        ]
        changed = np.count_nonzero(labels[0] != labels[1])
        if changed:
            yield f"{first.id}: {changed} labels"
        a, b = _figures(first), _figures(second)
        yield from (f"{first.id}: {key} {a[key]}, {b[key]}" for key in a if a[key] != b[key])
        balanced = [method.evaluation.balanced_accuracy for method in (first, second)]
        if not isclose(*balanced, rel_tol=1e-12):  # a mean in another order of labels
            yield f"{first.id}: balanced accuracy {balanced[0]}, {balanced[1]}"


def _figures(method: Any) -> dict[str, Any]:
    found = method.evaluation
    figures = {name: getattr(found, name) for name in ("accuracy", "recall", "precision")}
    return {**figures, "doors": method.doors}


@pytest.mark.parametrize("resolution_m", SMALL)
def test_figures_do_not_depend_on_the_order_of_names(resolution_m: float) -> None:
    n_rounds, learned_from, parts = SMALL[resolution_m]
    methods = [(method, unary) for method in WITHOUT_LEARNING for unary in UNARIES]
    methods += [(method, learned_from) for method in METHODS[3:]]
    first, *others = [compared(names, resolution_m, n_rounds, methods, parts) for names in ORDERS]
    assert all(None not in method.evaluation.recall.values() for method in first.methods)
    for other in others:
        assert list(differences(first, other)) == []


def test_a_difference_is_named() -> None:
    methods = [("independent", "laser")]
    found = compared(ORDERS[0], 0.2, 5, methods, (((0, 200), (200, 400)), (100, 300)))
    [method] = found.methods
    [labeling] = method.labelings
    labels = labeling.labels.copy()
    labels[0] = (labels[0] + 1) % 3
    changed = replace(method, labelings=(replace(labeling, labels=labels),))
    other = replace(found, methods=(changed,))
    assert list(differences(found, other)) == ["independent laser: 1 labels"]
