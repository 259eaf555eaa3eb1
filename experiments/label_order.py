"""Whether figures of a comparison depend on the order of label names, with every method and unary.

``python -m experiments.label_order`` compares the methods on halves of a generated building with
cells of 0.2, 0.1 and 0.05 m under several orders, and names each figure that differs: about ten
minutes of processor time. The tests do this with fewer methods on small parts of the building.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from itertools import permutations
from math import isclose
from pathlib import Path
from typing import Any

import numpy as np

from pgm_places.experiment.comparison import Comparison
from pgm_places.experiment.config import parse_config
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.runs import compare

ORDERS = tuple(permutations(("corridor", "room", "doorway")))[::3]
UNARIES = ("laser", "context", "space")
METHODS = ("independent", "potts", "relaxation", "amn", "crf")
ALL = tuple((method, unary) for method in METHODS for unary in UNARIES)
HALVES = ((0, 200), (200, 400)), (0, 300)
"""Columns of the training and of the test part, and rows of both, in cells of 0.05 m."""


def compared(
    names: Sequence[str],
    resolution_m: float,
    n_rounds: int,
    methods: Sequence[tuple[str, str]] = ALL,
    parts: tuple[Sequence[tuple[int, int]], tuple[int, int]] = HALVES,
) -> Comparison:
    """Methods by name and unary, learned on one part of a generated building, on another part."""
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


def main() -> int:
    """Exit status 1 where a figure differs."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.parse_args()
    n_different = 0
    for resolution_m, n_rounds in ((0.2, 20), (0.1, 8), (0.05, 3)):
        first, *others = [compared(names, resolution_m, n_rounds) for names in ORDERS]
        found = [line for other in others for line in differences(first, other)]
        n_different += len(found)
        print(f"{resolution_m} m: {len(found)} figures differ", *found, sep="\n  ", flush=True)
    return min(n_different, 1)


if __name__ == "__main__":
    sys.exit(main())
