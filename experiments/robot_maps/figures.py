"""The figures of a map and of a kind of building: cells, doors, and spaces cut in two."""

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.known_maps import DOORWAY, NAMES, KnownMap
from experiments.robot_maps.sources import Found
from pgm_places.evaluation.evaluation import Evaluation, evaluate
from pgm_places.maps.components import connected_components
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.spaces.doorways import DoorMatch, DoorScores, match_gates, match_painted

_LEAST_SPACE_M2 = 2.0
_CUT = (0.1, 0.9)
HEADER = (
    "maps",
    "number",
    "accuracy / balanced / doorway F1",
    "halls not counted",
    "worst",
    "painted doors: recall / precision",
    "gates: recall / precision",
    "spaces cut",
    "error of confidence",
)


@dataclass(frozen=True, eq=False)
class MapFigures:
    """What is measured of one map.

    Parameters
    ----------
    known : KnownMap
    weight : float
        What it counts in the mean of its kind.
    cells : Evaluation
    no_halls : Evaluation or None
        Of the cells that are no halls in truth; None without any.
    painted, gates : DoorScores
        Door by door: of doorways as they are painted, and of accepted gates.
    cut, spaces : int
        True spaces of at least 2 m2 with between a tenth and nine tenths of their cells right, and
        all true spaces of that size.
    """

    known: KnownMap
    weight: float
    cells: Evaluation
    no_halls: Evaluation | None
    painted: DoorScores
    gates: DoorScores
    cut: int
    spaces: int

    def to_row(self) -> dict[str, Any]:
        """The map's row of the CSV table."""
        counts = {
            f"{part}_{name}": value
            for part in ("painted", "gates")
            for name, value in vars(getattr(self, part)).items()
        }
        return {
            "kind": self.known.group,
            "map": self.known.item.name,
            "building": self.known.building,
            "weight": self.weight,
            "cells": self.cells.n,
            "accuracy": f"{self.cells.accuracy:.4f}",
            "balanced_accuracy": f"{self.cells.balanced_accuracy:.4f}",
            "doorway_f1": _text(self.cells.f1["doorway"]),
            "accuracy_without_halls": _text(self.no_halls and self.no_halls.accuracy),
            "confidence_error": _text(self.cells.expected_calibration_error),
            **counts,
            "cut": self.cut,
            "spaces": self.spaces,
        }


def measured(known: KnownMap, weight: float, found: Found) -> MapFigures:
    """The figures of a map that a source has labelled."""
    item, doorways = known.item, found.doorways
    on_cells = found.labels >= 0
    truth, label, beliefs = item.labels[on_cells], found.labels[on_cells], found.labeling.beliefs
    cells, no_halls = evaluate(truth, label, NAMES, beliefs=beliefs), None
    truth = np.where(known.finer[on_cells] == len(NAMES), -1, truth)
    if (truth >= 0).any():
        no_halls = evaluate(truth, label, NAMES, beliefs=beliefs)
    painted = match_painted(found.labels, item.grid, item.labels, DOORWAY)
    gates = match_gates(doorways.gates if doorways else (), item.grid, item.labels, DOORWAY)
    cut, spaces = cut_spaces(item, found.labels)
    return MapFigures(known, weight, cells, no_halls, _all_of(painted), _all_of(gates), cut, spaces)


def cut_spaces(item: LabelledMap, labels: NDArray[np.int64]) -> tuple[int, int]:
    """How many true spaces, rooms or stretches of corridor, are cut by labels, and how many are.

    Cells that are painted as doorways are not counted: they lie at the rim of a space.
    """
    truth = np.where(item.labelled_cells & (item.labels != DOORWAY), item.labels, -1)
    pieces = connected_components(truth)
    inside = (pieces.piece >= 0) & (labels != DOORWAY) & (labels >= 0)
    right = inside & (labels == truth)
    all_cells = np.bincount(pieces.piece[inside], minlength=pieces.count)
    share = np.bincount(pieces.piece[right], minlength=pieces.count) / np.maximum(all_cells, 1)
    large = pieces.size * item.grid.resolution_m**2 >= _LEAST_SPACE_M2
    cut = large & (share > _CUT[0]) & (share < _CUT[1])
    return int(cut.sum()), int(large.sum())


def row(name: str, maps: Sequence[MapFigures]) -> str:
    """A kind's line: means of maps by their weight; counts of doors and spaces added up."""
    every = _means([(item.cells, item.weight) for item in maps])
    no_halls = _means([(item.no_halls, item.weight) for item in maps if item.no_halls is not None])
    worst = min(maps, key=lambda item: item.cells.accuracy)
    error = Evaluation.merged([item.cells for item in maps]).expected_calibration_error
    entries = [
        name,
        str(len(maps)),
        every,
        no_halls,
        f"{100 * worst.cells.accuracy:.1f} ({worst.known.item.name})",
        _doors([item.painted for item in maps]),
        _doors([item.gates for item in maps]),
        f"{sum(item.cut for item in maps)} of {sum(item.spaces for item in maps)}",
        "-" if error is None else f"{100 * error:.1f}",
    ]
    return f"| {' | '.join(entries)} |"


def table(figures: Sequence[MapFigures]) -> str:
    """All kinds, and all maps together."""
    kinds: dict[str, list[MapFigures]] = {}
    for item in figures:
        kinds.setdefault(item.known.group, []).append(item)
    lines = [f"| {' | '.join(HEADER)} |", "|---" * len(HEADER) + "|"]
    lines += [row(kind, maps) for kind, maps in kinds.items()]
    return "\n".join([*lines, row("**all**", figures)])


def write_figures(path: Path, figures: Sequence[MapFigures]) -> None:
    """A line of CSV for each map."""
    rows: list[Mapping[str, Any]] = [item.to_row() for item in figures]
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def _means(maps: Sequence[tuple[Evaluation, float]]) -> str:
    """Accuracy, balanced accuracy and F1 of doorways, as means of maps by their weight."""
    doorway = [(cells.f1["doorway"], weight) for cells, weight in maps]
    means = (
        _mean([(cells.accuracy, weight) for cells, weight in maps]),
        _mean([(cells.balanced_accuracy, weight) for cells, weight in maps]),
        _mean([(f1, weight) for f1, weight in doorway if f1 is not None]),
    )
    return " / ".join(f"{100 * value:.1f}" for value in means)


def _all_of(match: DoorMatch) -> DoorScores:
    return match.scores(np.ones(len(match.door), np.bool_))


def _doors(scores: Sequence[DoorScores]) -> str:
    total = DoorScores.total(scores)
    return (
        f"{total.found} of {total.doors} = {_percent(total.recall)} / "
        f"{total.right} of {total.accepted} = {_percent(total.precision)}"
    )


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.1f}"


def _mean(weighted: Sequence[tuple[float, float]]) -> float:
    if not weighted:
        return float("nan")
    values, weights = np.transpose(weighted)
    return float(np.average(values, weights=weights))


def _text(value: float | None) -> str:
    return "" if value is None else f"{value:.4f}"
