"""The order of label names changes the order of tables and no figure."""

from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pgm_places.experiment.comparison import Comparison
from pgm_places.experiment.config import parse_config
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.runs import compare

NAMES = ("corridor", "room", "doorway")
UNARIES = ("laser", "context", "space")
METHODS = ("independent", "potts", "relaxation", "amn", "crf")


def compared(names: tuple[str, ...], resolution_m: float, rounds: int) -> Comparison:
    halves = [
        {"generated": 3, "columns": list(part), "rows": [0, 300], "name": f"from {part[0]}"}
        for part in ((0, 200), (200, 400))
    ]
    config = {
        "resolution_m": resolution_m,
        "labels": {"names": list(names)},
        "train": halves[:1],
        "test": halves[1:],
        "classifier": {"n_rounds": rounds, "n_folds": 2},
        "context": {"half_widths_m": [0.5]},
        "space": {"n_rounds": rounds},
        "methods": [
            {"id": f"{method} {unary}", "name": method, "unary": unary}
            for method in METHODS
            for unary in UNARIES
        ],
    }
    return compare(Experiment(parse_config(config), Path()))


def figures(found: Comparison) -> dict[str, Any]:
    """All that a table shows of each method, and the name of each cell's label."""
    names = np.array(found.label_names)
    return {
        method.id: {
            "labels": names[method.labelings[0].labels].tolist(),
            "accuracy": method.evaluation.accuracy,
            "balanced": pytest.approx(method.evaluation.balanced_accuracy, rel=1e-12),
            "recall": method.evaluation.recall,
            "precision": method.evaluation.precision,
            "doors": method.doors,
        }
        for method in found.methods
    }


@pytest.mark.parametrize(("resolution_m", "rounds"), [(0.2, 20), (0.1, 8), (0.05, 3)])
def test_figures_do_not_depend_on_the_order_of_names(resolution_m: float, rounds: int) -> None:
    orders = list(permutations(NAMES))
    first, *others = orders[::3]
    expected = figures(compared(first, resolution_m, rounds))
    for names in others:
        found = figures(compared(names, resolution_m, rounds))
        for method, figure in found.items():
            for key, value in figure.items():
                assert value == expected[method][key], (names, method, key)
