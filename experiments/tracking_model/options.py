"""Options of the list of trees, chosen on simulated drives in buildings left out."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from experiments.tracking_model.learning import Table, classifier
from experiments.tracking_model.unseen import Answer, floor_answers, merged
from pgm_places.features.own import n_columns

__all__ = ["options_table"]

N_LASER = n_columns(())

CANDIDATES: Mapping[str, Mapping[str, Any]] = {
    "as shipped": {},
    "200 rounds": {"n_rounds": 200},
    "no prior in z": {"prior_weight": 0.0},
    "calibrated temperatures": {"calibration": "temperature"},
    "stumps, 200 rounds": {
        "n_rounds": 200,
        "max_depth": 1,
        "shrinkage": 1.0,
        "feature_share": 1.0,
    },
}


def options_table(table: Table) -> str:
    """The mean over the kinds of building, per choice."""
    lines = ["| list | single scans | filter | smoother |", "|---|---|---|---|"]
    for name, changes in CANDIDATES.items():
        lines.append(_row(name, list(floor_answers(table, classifier(**changes)))))
        print(lines[-1], flush=True)
    without = table.only([not item.generated for item in table.drives])
    lines.append(_row("without generated buildings", list(floor_answers(without))))
    scans = _without_spaces(table)
    lines.append(_row("without the spaces around the robot", list(floor_answers(scans))))
    print("\n".join(lines[-2:]), flush=True)
    return "\n".join(lines)


def _row(name: str, found: list[Answer]) -> str:
    groups = sorted({item.drive.group for item in found})
    cells = []
    for mode in ("alone", "filter", "smooth"):
        scored = [merged([a for a in found if a.drive.group == group], mode) for group in groups]
        accuracy = 100 * np.mean([item.accuracy for item in scored])
        balanced = 100 * np.mean([item.balanced_accuracy for item in scored])
        cells.append(f"{accuracy:.1f} / {balanced:.1f}")
    return f"| {name} | {' | '.join(cells)} |"


def _without_spaces(table: Table) -> Table:
    """The table with nothing to see in the columns of spaces."""
    drives = [replace(item, spaces=np.zeros_like(item.spaces)) for item in table.drives]
    features = [part.copy() for part in table.features]
    for part in features:
        part[:, N_LASER:] = 0
    return Table(drives, features)
