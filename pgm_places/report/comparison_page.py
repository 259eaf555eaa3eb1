"""A comparison as one self-contained HTML file: to read, to print, to send."""

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np

from pgm_places.evaluation.bootstrap import Interval
from pgm_places.evaluation.evaluation import Evaluation
from pgm_places.experiment.comparison import Comparison, MethodResult
from pgm_places.experiment.config_presets import preset_record
from pgm_places.experiment.judgement import Difference
from pgm_places.experiment.labelled_items import BLOCK_M, NODES_PER_BLOCK, STRETCH_M
from pgm_places.inference.labeling import Labeling, Status
from pgm_places.io.atomic import write_text
from pgm_places.palette import ERROR, GROUND_SWATCHES, Swatch, label_swatches, levels
from pgm_places.report.glance import glance_of
from pgm_places.report.line_chart import Chart, Line, line_chart
from pgm_places.report.map_layers import label_layers, probability_layers
from pgm_places.report.page import render
from pgm_places.spaces.door_truth import DoorScores

_SHARED_QUANTITIES = ("accuracy", "balanced_accuracy", "change", "residual")
"""Quantities that mean the same for every method: drawn in one chart. Energies are not."""

_MOST_LINES = 12


def reliability_chart(comparison: Comparison) -> Chart | None:
    """Accuracy over confidence, a line per method with beliefs; None where there is none."""
    lines = []
    for style, method in enumerate(comparison.methods):
        table = method.evaluation.reliability
        if table is not None:
            name = f"{method.id} (ECE {100 * table.expected_calibration_error:.1f} %)"
            confidence, accuracy = table.mean_confidence.tolist(), table.accuracy.tolist()
            lines.append(Line(name, confidence, accuracy, style))
    return line_chart(lines, x_name="confidence", y_name="accuracy", shares=True)


def history_charts(comparison: Comparison) -> list[tuple[str, Chart]]:
    """Charts with their titles: each quantity over the iterations, then learning."""
    found = []
    for title, lines in _by_title(comparison).items():
        y_name = title[-1].replace("_", " ")
        chart = line_chart(lines[:_MOST_LINES], x_name="iteration", y_name=y_name)
        found.append((": ".join(title).replace("_", " "), chart))
    found += _learning_charts(comparison)
    return [(title, chart) for title, chart in found if chart is not None]


def _by_title(comparison: Comparison) -> dict[tuple[str, ...], list[Line]]:
    """The lines of each chart; a method looks the same in every chart."""
    charts: dict[tuple[str, ...], list[Line]] = {}
    several = len(comparison.maps) > 1
    for at, method in enumerate(comparison.methods):
        for item, history in zip(comparison.maps, method.histories, strict=True):
            for quantity, values in history.items():
                shared = quantity in _SHARED_QUANTITIES
                lines = charts.setdefault((quantity,) if shared else (method.id, quantity), [])
                names = [method.id] * (shared or not several) + [item.name] * several
                style = len(lines) if several else at
                lines.append(Line.over_steps(", ".join(names), values, style))
    return charts


def _learning_charts(comparison: Comparison) -> Iterator[tuple[str, Chart | None]]:
    """How learning closed in on the optimum from both sides, per method that records it."""
    for method in comparison.methods:
        lines = [
            Line.over_steps(name, values, style)
            for style, (name, values) in enumerate(method.learning.items())
        ]
        chart = line_chart(lines, x_name="learning step", y_name="objective")
        yield f"{method.id}: learning", chart


_GRADIENTS = (
    ("probability", ("0", "1"), levels("probability", 9)),
    ("entropy", ("0 (certain)", "1 (undecided)"), levels("entropy", 9)),
)

_BLOCKS = {
    "cell": f"{BLOCK_M:g} m squares",
    "step": f"{STRETCH_M:g} m stretches of the path",
    "node": f"single nodes, or {NODES_PER_BLOCK} that lie side by side",
}

_MIXED_BLOCKS = f"{BLOCK_M:g} m squares and {STRETCH_M:g} m stretches of paths"

_CERTIFIED = {"objective", "lower_bound", "certified_objective", "certified_gap"}
"""What methods that learn by optimisation say of their weights."""

_STEP_COUNTS = ("iterations", "n_iterations", "sweeps")


def write_report(comparison: Comparison, path: Path | str) -> Path:
    """The path, once the file holds the whole report.

    Raises
    ------
    OutputError
        The file cannot be written; what stood there before is then untouched.
    """
    return write_text(path, report_page(comparison))


def report_page(comparison: Comparison) -> str:
    """The report as text: the same comparison gives the same text, without a date.

    Pictures, style and script are in the file, and a content policy in its head forbids it to load
    anything else. Every text from configurations, maps and label names is escaped.
    """
    labels = label_swatches(comparison.label_names)
    units, certificates = [item.unit for item in comparison.maps], [*_certificates(comparison)]
    ended = {item.labeling.status for item in certificates}
    config = json.dumps(comparison.config, indent=2, ensure_ascii=False, default=str)
    return render(
        "comparison.html",
        script="viewer.js",
        **vars(comparison) | {"config": config},
        preset=preset_record(comparison.config),
        labels=labels,
        n_maps=units.count("cell"),
        n_drives=units.count("step"),
        n_graphs=units.count("node"),
        unit=comparison.unit,
        n_nodes=comparison.n_evaluated,
        seeds=comparison.seeds,
        all_choices=comparison.all_choices,
        by_split=_by_split(comparison),
        glance=glance_of(comparison),
        differences=_differences(comparison),
        figures=_FIGURES,
        results=[(method, _row(method, comparison)) for method in comparison.methods],
        results_by_label=[(item, _row_by_label(item, comparison)) for item in comparison.methods],
        doors=[
            (name, DoorScores.total(by_map), by_map)
            for name, by_map in (
                *((method.id, method.doors) for method in comparison.methods),
                ("gates, before any method", comparison.gates),
            )
            if by_map
        ],
        by_unit=[
            (method, comparison.by_unit(method))
            for method in comparison.methods
            if comparison.is_mixed
        ],
        blocks=_MIXED_BLOCKS if comparison.is_mixed else _BLOCKS[comparison.unit],
        truth=_truth(comparison, labels),
        legend=(*labels, Swatch("error", ERROR), *(GROUND_SWATCHES if {*units} - {"node"} else ())),
        map_layers=label_layers(comparison),
        reliability=reliability_chart(comparison),
        histories=history_charts(comparison),
        gradients=_GRADIENTS,
        beliefs=probability_layers(comparison),
        certificates=certificates,
        statuses=[(str(item), item.meaning) for item in Status if item in ended],
        learned_certificates=[
            (method.id, method.learned)
            for method in comparison.methods
            if method.learned.keys() >= _CERTIFIED
        ],
    )


def _mean_iou(evaluation: Evaluation) -> float | None:
    defined = [value for value in evaluation.iou.values() if value is not None]
    return float(np.mean(defined)) if defined else None


Figure = Callable[[Evaluation], float | None]

_FIGURES: dict[str, tuple[str, Figure]] = {
    "Accuracy": ("accuracy", lambda found: found.accuracy),
    "Balanced": ("balanced_accuracy", lambda found: found.balanced_accuracy),
    "Macro F1": ("macro_f1", lambda found: found.macro_f1),
    "Mean IoU": ("mean_iou", _mean_iou),
    "MCC": ("mcc", lambda found: found.mcc),
}


@dataclass(frozen=True)
class _Cell:
    """A figure of a method, with whether it is better than that of all others beyond chance."""

    value: float | None
    best: bool
    interval: Interval | None = None
    spread: float | None = None


def _row(method: MethodResult, comparison: Comparison) -> list[_Cell]:
    best = comparison.judgement.best
    return [
        _Cell(
            figure(method.evaluation),
            best(key) == method.id,
            method.intervals.get(key),
            method.spread(figure),
        )
        for key, figure in _FIGURES.values()
    ]


def _row_by_label(method: MethodResult, comparison: Comparison) -> list[_Cell]:
    """Recall, precision and IoU of each label in turn."""
    best = comparison.judgement.best
    return [
        _Cell(getattr(method.evaluation, kind)[name], best(f"{kind} of {name}") == method.id)
        for name in comparison.label_names
        for kind in ("recall", "precision", "iou")
    ]


def _by_split(comparison: Comparison) -> list[tuple[str, list[tuple[Evaluation, bool]]]]:
    """By split, each method's evaluation and whether no other one is more accurate there."""
    found = {method.id: comparison.by_split(method) for method in comparison.methods}
    rows = []
    for name in comparison.splits:
        top = max(of[name].accuracy for of in found.values())
        rows.append((name, [(of[name], of[name].accuracy == top) for of in found.values()]))
    return rows


_MOST_PAIRS = 15
"""Of more methods, each one is compared with the most accurate alone."""


def _differences(comparison: Comparison) -> list[tuple[Difference, Difference]]:
    """Accuracy and balanced accuracy of pairs of methods: the more accurate one first."""
    ranked = sorted(comparison.methods, key=lambda item: -item.evaluation.accuracy)
    pairs = list(combinations([item.id for item in ranked], 2))
    if len(pairs) > _MOST_PAIRS:
        pairs = pairs[: len(ranked) - 1]
    between = comparison.judgement.between
    return [(between(*pair), between(*pair, "balanced_accuracy")) for pair in pairs]


@dataclass(frozen=True)
class _Share:
    """How much of the ground truth is one label."""

    label: Swatch
    n_nodes: int
    area_m2: float
    share: float


def _truth(comparison: Comparison, labels: Sequence[Swatch]) -> list[_Share]:
    """The score of a constant labelling."""
    counts = np.zeros(len(labels), np.int64)
    areas_m2 = np.zeros(len(labels))
    for item in comparison.maps:
        truth = item.node_truth
        on_map = np.bincount(truth[truth >= 0], minlength=len(counts))
        counts += on_map
        areas_m2 += on_map * item.grid.resolution_m**2
    total = max(int(counts.sum()), 1)
    return [
        _Share(label, int(count), float(area), count / total)
        for label, count, area in zip(labels, counts, areas_m2, strict=True)
    ]


@dataclass(frozen=True)
class _Certificate:
    """How far from the best a labelling may be."""

    name: str
    labeling: Labeling

    @property
    def gap_percent(self) -> str:
        """The gap as a share of the score."""
        found = self.labeling
        if found.gap is None or found.score is None:
            return "–"
        return f"{100 * found.gap / max(abs(found.score), 1e-12):.3g}"

    @property
    def iterations(self) -> str:
        """How many there were, whatever the method calls them."""
        info = self.labeling.info
        return str(next((info[key] for key in _STEP_COUNTS if key in info), "–"))


def _certificates(comparison: Comparison) -> Iterator[_Certificate]:
    for method in comparison.methods:
        for item, labeling in zip(comparison.maps, method.labelings, strict=True):
            name = f"{method.id}, {item.name}" if len(comparison.maps) > 1 else method.id
            yield _Certificate(name, labeling)
