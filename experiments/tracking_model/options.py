"""Options of the list of trees, chosen on simulated drives in buildings left out."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from experiments.tracking_model.learning import Table, classifier
from experiments.tracking_model.unseen import ALONE, Answer, floor_answers, merged
from pgm_places.features.own import n_columns

N_LASER = n_columns(())

CANDIDATES: Mapping[str, Mapping[str, Any]] = {
    "trees, no prior in z": {"prior_weight": 0.0},
    "trees, calibrated temperatures": {"calibration": "temperature"},
    "stumps, 200 rounds": {
        "n_rounds": 200,
        "max_depth": 1,
        "shrinkage": 1.0,
        "feature_share": 1.0,
    },
}

WAYS = ("filter", "smoother")


def options_table(table: Table) -> str:
    """The mean over the kinds of building, per choice."""
    lines = ["| list | single scans | filter | smoother |", "|---|---|---|---|"]
    lines.append(_row("trees, 100 rounds (shipped)", _answers(table)))
    lines.append(_row("without the spaces around the robot", _answers(_without_spaces(table))))
    real = table.only([not item.generated for item in table.drives])
    lines.append(_row("without generated buildings", _answers(real)))
    for name, changes in CANDIDATES.items():
        lines.append(_row(name, _answers(table, **changes)))
    return "\n".join(lines)


def _answers(table: Table, **changes: Any) -> list[Answer]:
    return list(floor_answers(table, classifier(**changes), WAYS))


def _row(name: str, found: Sequence[Answer]) -> str:
    groups = sorted({item.drive.group for item in found})
    cells = []
    for way in (ALONE, *WAYS):
        scored = [merged([a for a in found if a.drive.group == group], way) for group in groups]
        accuracy = 100 * np.mean([item.accuracy for item in scored])
        balanced = 100 * np.mean([item.balanced_accuracy for item in scored])
        cells.append(f"{accuracy:.1f} / {balanced:.1f}")
    text = f"| {name} | {' | '.join(cells)} |"
    print(text, flush=True)
    return text


def _without_spaces(table: Table) -> Table:
    """The table with nothing to see in the columns of spaces."""
    drives = [replace(item, spaces=np.zeros_like(item.spaces)) for item in table.drives]
    features = [part.copy() for part in table.features]
    for part in features:
        part[:, N_LASER:] = 0
    return Table(drives, features)
