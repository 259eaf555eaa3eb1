"""The tables of a comparison, once for the terminal, the report and ``results.json``."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from pgm_places.evaluation.bootstrap import SignTest
from pgm_places.evaluation.evaluation import Evaluation
from pgm_places.experiment.comparison import Comparison, MethodResult
from pgm_places.experiment.significance import Difference, points
from pgm_places.pictures.page import decimals, percent, spent
from pgm_places.spaces.doorways import DoorScores

NONE = "–"
MOST_PAIRS = 15
"""Most methods of which all pairs are compared; of more, each with the most accurate one."""

CERTIFIED = {"objective", "lower_bound", "certified_objective", "certified_gap"}
"""Records of methods that learn their weights by optimisation."""

_STEP_COUNTS = ("iterations", "n_iterations", "sweeps")

Figure = Callable[[Evaluation], float | None]


def _mean_iou(evaluation: Evaluation) -> float | None:
    defined = [value for value in evaluation.iou.values() if value is not None]
    return float(np.mean(defined)) if defined else None


FIGURES: dict[str, tuple[str, Figure]] = {
    "Accuracy": ("accuracy", lambda found: found.accuracy),
    "Balanced": ("balanced_accuracy", lambda found: found.balanced_accuracy),
    "Macro F1": ("macro_f1", lambda found: found.macro_f1),
    "Mean IoU": ("mean_iou", _mean_iou),
    "MCC": ("mcc", lambda found: found.mcc),
}


@dataclass(frozen=True)
class Cell:
    """A rounded value with its spread and interval, "" for none.

    ``is_sure``: significantly best, or different from 0; or the highest of a split.
    """

    text: str
    is_sure: bool = False
    spread: str = ""
    interval: str = ""

    def __str__(self) -> str:
        parts = (self.text + "*" * self.is_sure, self.spread, self.interval)
        words = " ".join(part for part in parts if part)
        return words.replace("–", "-").replace("−", "-").replace(" / ", "/")


@dataclass(frozen=True)
class Row:
    """A row with a head; ``kind`` is the class of a method if its id differs."""

    head: str
    cells: tuple[Cell, ...]
    kind: str = ""


@dataclass(frozen=True)
class Table:
    """A table as text; ``groups`` are titles of equal groups of the columns after the first."""

    caption: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]
    groups: tuple[str, ...] = ()

    @property
    def group_size(self) -> int:
        """Columns in each group."""
        return (len(self.columns) - 1) // max(len(self.groups), 1)

    def as_words(self) -> list[list[str]]:
        """The heading and the rows, one word per column: for terminals."""
        columns = list(self.columns)
        for k, name in enumerate(self.groups):
            columns[1 + k * self.group_size] = f"{name} {columns[1 + k * self.group_size]}"
        return [columns, *([row.head, *map(str, row.cells)] for row in self.rows)]

    def to_dict(self) -> dict[str, object]:
        """As plain data: texts as all readers see them."""
        rows = [[row.head, *(cell.text for cell in row.cells)] for row in self.rows]
        return {"caption": self.caption, "columns": self.columns, "groups": self.groups} | {
            "rows": rows
        }


def comparison_tables(comparison: Comparison) -> dict[str, Table]:
    """The tables of a comparison, by name."""
    found = {
        "results": _results(comparison),
        "differences": _differences(comparison),
        "by_unit": _by_unit(comparison),
        "by_label": _by_label(comparison),
        "by_split": _by_split(comparison),
        "by_map": _by_map(comparison),
        "doors": _doors(comparison),
        "truth": _truth(comparison),
        "certificates": _certificates(comparison),
        "learned_certificates": _learned_certificates(comparison),
    }
    return {name: table for name, table in found.items() if table.rows}


def _results(comparison: Comparison) -> Table:
    kinds = {"cell": "test maps", "step": "test drives"}
    graphs = any(item.unit == "node" for item in comparison.maps)
    what = kinds.get(comparison.unit, "test graphs" if graphs else "nodes")
    rows = []
    for method in comparison.methods:
        cells = [_figure(comparison, method, *pair) for pair in FIGURES.values()]
        cells.append(Cell(percent(method.evaluation.expected_calibration_error)))
        shared = method.learned_with
        learn = spent(method.seconds.get("learn")) if shared is None else f"with {shared}"
        cells += [Cell(learn), Cell(spent(method.seconds.get("infer")))]
        kind = "" if method.name == method.id else method.name
        rows.append(Row(method.id, tuple(cells), kind))
    columns = ("Method", *FIGURES, "ECE", "Learn (s)", "Infer (s)")
    return Table(f"All {what} together, in percent", columns, tuple(rows))


def _figure(comparison: Comparison, method: MethodResult, key: str, figure: Figure) -> Cell:
    spread, interval = method.spread(figure), method.intervals.get(key)
    return Cell(
        percent(figure(method.evaluation)),
        comparison.judgement.best(key) == method.id,
        "" if spread is None else f"±{percent(spread, 2)}",
        "" if interval is None else f"{percent(interval.low)}–{percent(interval.high)}",
    )


def _differences(comparison: Comparison) -> Table:
    """Differences of (balanced) accuracy between pairs of methods, the more accurate first."""
    ranked = sorted(comparison.methods, key=lambda item: -item.evaluation.accuracy)
    pairs = list(combinations([item.id for item in ranked], 2))
    if len(pairs) > MOST_PAIRS:
        pairs = pairs[: len(ranked) - 1]
    columns = ["First", "Second", "Accuracy", "95 %", "Balanced", "95 %"]
    rows, seeds = [], comparison.seeds
    for pair in pairs:
        accuracy = comparison.judgement.between(*pair)
        balanced = comparison.judgement.between(*pair, "balanced_accuracy")
        cells = [Cell(accuracy.second), *_points(accuracy), *_points(balanced)]
        if accuracy.buildings.n_buildings > 1:
            cells += [_signs(accuracy.buildings), Cell(f"{accuracy.buildings.p_value:,.3f}")]
        if seeds:
            cells += [_signs(accuracy.seeds), Cell(percent(accuracy.spread, 2))]
        rows.append(Row(accuracy.first, tuple(cells)))
    if pairs and accuracy.buildings.n_buildings > 1:
        columns += ["Buildings: ahead / even / behind", "Sign test p"]
    columns += ["Seeds: ahead / even / behind", "± over seeds"] if seeds else []
    return Table("Differences between methods, in points", tuple(columns), tuple(rows))


def _points(found: Difference) -> list[Cell]:
    ends = (points(end) for end in (found.interval.low, found.interval.high))
    texts = (points(found.shown), " to ".join(ends))
    shown, interval = (text.replace("-", "−") for text in texts)
    return [Cell(shown, found.winner is not None), Cell(interval)]


def _signs(found: SignTest) -> Cell:
    return Cell(f"{found.better} / {found.even} / {found.worse}")


def _by_unit(comparison: Comparison) -> Table:
    units = dict.fromkeys(item.unit for item in comparison.maps) if comparison.is_mixed else ()
    rows = [
        Row(method.id, tuple(_both(parts[unit]) for unit in units))
        for method in comparison.methods
        if units
        for parts in (comparison.by_unit(method),)
    ]
    columns = ("Method", *(f"{unit}s".capitalize() for unit in units))
    caption = "Cells and steps apart: accuracy / balanced accuracy, in percent"
    return Table(caption, columns, tuple(rows))


def _by_label(comparison: Comparison) -> Table:
    kinds, names = ("recall", "precision", "IoU"), comparison.label_names
    best = comparison.judgement.best
    rows = [
        Row(
            method.id,
            tuple(
                Cell(
                    percent(getattr(method.evaluation, kind.lower())[name]),
                    best(f"{kind.lower()} of {name}") == method.id,
                )
                for name in names
                for kind in kinds
            ),
        )
        for method in comparison.methods
    ]
    return Table("By label, in percent", ("Method", *kinds * len(names)), tuple(rows), names)


def _by_split(comparison: Comparison) -> Table:
    """Accuracies in each split; the highest is highlighted."""
    split_scores = [comparison.by_split(method) for method in comparison.methods]
    rows = []
    for name in comparison.splits:
        top = max(of[name].accuracy for of in split_scores)
        cells = tuple(_both(of[name], of[name].accuracy == top) for of in split_scores)
        rows.append(Row(name, cells))
    columns = ("Tested on", *(method.id for method in comparison.methods))
    return Table("Accuracy / balanced accuracy by split, in percent", columns, tuple(rows))


def _by_map(comparison: Comparison) -> Table:
    several = len(comparison.maps) > 1 and len(comparison.maps) != len(comparison.splits)
    rows = [
        Row(method.id, tuple(_both(found) for found in method.evaluations))
        for method in comparison.methods
        if several
    ]
    what = "graph" if any(item.unit == "node" for item in comparison.maps) else "map"
    caption = f"Accuracy / balanced accuracy by {what}, in percent"
    return Table(caption, ("Method", *(item.name for item in comparison.maps)), tuple(rows))


def _both(found: Evaluation, is_sure: bool = False) -> Cell:
    return Cell(f"{percent(found.accuracy)} / {percent(found.balanced_accuracy)}", is_sure)


def _doors(comparison: Comparison) -> Table:
    """The doors of each method, then the doors that gates match."""
    rows, several = [], len(comparison.maps) > 1
    counted = [(method.id, method.doors) for method in comparison.methods]
    for name, by_map in (*counted, ("gates, before any method", comparison.gates)):
        total = DoorScores.total(by_map)
        cells = [_found(total), Cell(percent(total.recall)), Cell(percent(total.precision))]
        cells += [_found(item) for item in by_map] if several else []
        rows += [Row(name, tuple(cells))] if by_map else []
    columns = ["Method", "All maps", "Recall (%)", "Precision (%)"]
    columns += [item.name for item in comparison.maps] if several else []
    return Table("Doors: found / missed / invented", tuple(columns), tuple(rows))


def _found(doors: DoorScores) -> Cell:
    return Cell(f"{doors.found} / {doors.missed} / {doors.invented}")


def _truth(comparison: Comparison) -> Table:
    """The share of each label, which is the accuracy of a constant labelling."""
    names, unit = comparison.label_names, comparison.unit
    counts, areas_m2 = np.zeros(len(names), np.int64), np.zeros(len(names))
    for item in comparison.maps:
        truth = item.node_truth
        on_map = np.bincount(truth[truth >= 0], minlength=len(counts))
        counts += on_map
        areas_m2 += on_map * item.grid.resolution_m**2
    shares = counts / max(int(counts.sum()), 1)
    of_cells = unit == "cell"
    rows = [
        Row(name, (Cell(f"{n:,}"), *([Cell(f"{area:.1f}")] * of_cells), Cell(percent(share))))
        for name, n, area, share in zip(names, counts.tolist(), areas_m2, shares, strict=True)
    ]
    columns = ("Label", f"{unit}s".capitalize(), *(["Area (m²)"] * of_cells), "Share (%)")
    return Table(f"Ground truth of the evaluated {unit}s", columns, tuple(rows))


def _certificates(comparison: Comparison) -> Table:
    rows = []
    for method in comparison.methods:
        for item, found in zip(comparison.maps, method.labelings, strict=True):
            name = f"{method.id}, {item.name}" if len(comparison.maps) > 1 else method.id
            texts = [decimals(value) for value in (found.score, found.bound, found.gap)]
            share = NONE
            if found.gap is not None and found.score is not None:
                share = f"{100 * found.gap / max(abs(found.score), 1e-12):.3g}"
            steps = next((found.info[key] for key in _STEP_COUNTS if key in found.info), NONE)
            texts = [str(found.status), *texts, share, str(steps)]
            rows.append(Row(name, tuple(map(Cell, texts))))
    columns = ("Method", "Status", "Score", "Upper bound", "Gap", "Gap (%)", "Iterations")
    return Table("Distance of each labelling from the optimum", columns, tuple(rows))


def _learned_certificates(comparison: Comparison) -> Table:
    rows = []
    for method in comparison.methods:
        found = method.learned
        if found.keys() >= CERTIFIED:
            keys = ("objective", "certified_objective", "lower_bound")
            texts = [str(found.get("status", NONE)), *(decimals(found[key]) for key in keys)]
            texts += [percent(found["certified_gap"], 2), str(found.get("iterations", NONE))]
            rows.append(Row(method.id, tuple(map(Cell, texts))))
    columns = ("Method", "Status", "Objective", "Upper bound", "Lower bound", "Gap (%)", "Steps")
    return Table("Distance of the learned weights from the optimum", columns, tuple(rows))
