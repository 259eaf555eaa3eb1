"""The report of a comparison, index.html, and its first page: the main comparison in a sentence."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pgm_places.experiment.comparison import Comparison, MethodResult
from pgm_places.experiment.evaluated_items import BLOCK_M, NODES_PER_BLOCK, STRETCH_M
from pgm_places.experiment.significance import Difference
from pgm_places.inference.labeling import Status
from pgm_places.io.atomic import write_text
from pgm_places.labelers.presets import preset_record
from pgm_places.palette import ERROR, GROUND_SWATCHES, Swatch, label_swatches, levels
from pgm_places.pictures.page import render
from pgm_places.report.comparison_tables import comparison_tables
from pgm_places.report.line_chart import Chart, Line, line_chart
from pgm_places.report.map_layers import Layer, label_layers, probability_layers, thumbnails

MOST_METHODS = 6
"""Most methods drawn; the tables have all."""

STEPS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.25, 0.5)
"""Distances between the ticks of the scale."""

PAPER = ("Relaxation", "AssociativeMarkovNetwork")
"""The two methods that the paper compares."""


@dataclass(frozen=True)
class MethodSummary:
    """A method on the first page: the 95 % interval of its accuracy, its pictures of the first map.

    ``is_best``: significantly better than all others.
    """

    method: MethodResult
    low: float
    high: float
    words: str
    learning: str
    is_best: bool
    labels: Layer
    errors: Layer


@dataclass(frozen=True)
class Summary:
    """The first page: the main comparison, and the methods, the most accurate first.

    ``n_more`` methods are not drawn.
    """

    headline: str
    cost: str
    truth: Layer
    standings: Sequence[MethodSummary]
    scale: "AccuracyAxis"
    n_more: int


def summary_of(comparison: Comparison) -> Summary | None:
    """The first page of a comparison; None for a single method."""
    ranked = sorted(comparison.methods, key=lambda item: -item.evaluation.accuracy)
    if len(ranked) < 2:
        return None
    first, second = _pair(ranked)
    shown = ranked[:MOST_METHODS]
    shown += [item for item in (first, second) if item not in shown]
    ends = [_ends(item) for item in shown]
    drawn = [end for pair in ends for end in pair]
    drawn += [found.evaluation.accuracy for item in shown for found in item.by_seed.values()]
    truth, pictures = thumbnails(comparison, [item.id for item in shown])
    standings = []
    for item, interval, layers in zip(shown, ends, pictures, strict=True):
        is_best = comparison.judgement.best("accuracy") == item.id
        words = _standing_words(comparison, ranked[0], item, is_best=is_best)
        standings.append(MethodSummary(item, *interval, words, _learning(item), is_best, *layers))
    headline, cost = _headline(comparison, first, second), f"{_cost(first)}; {_cost(second)}."
    scale = AccuracyAxis.over(min(drawn), max(drawn))
    return Summary(headline, cost, truth, standings, scale, len(ranked) - len(shown))


def _pair(ranked: Sequence[MethodResult]) -> tuple[MethodResult, MethodResult]:
    """The paper's two methods if one of them is the most accurate, else the first two."""
    kinds = {item.name: item for item in reversed(ranked)}
    if ranked[0].name in PAPER and all(kind in kinds for kind in PAPER):
        [other] = [kind for kind in PAPER if kind != ranked[0].name]
        return ranked[0], kinds[other]
    return ranked[0], ranked[1]


def _ends(method: MethodResult) -> tuple[float, float]:
    interval = method.intervals.get("accuracy")
    value = method.evaluation.accuracy
    return (value, value) if interval is None else (interval.low, interval.high)


def _headline(comparison: Comparison, first: MethodResult, second: MethodResult) -> str:
    """The difference of two methods: correct nodes, and balance over the labels."""
    found = comparison.judgement.between(first.id, second.id)
    one, other = (100 * item.evaluation.accuracy for item in (first, second))
    values = f"{one:.1f} against {other:.1f} %"
    if found.winner is None:
        text = f"No difference in accuracy is shown between {first.id} and {second.id}: "
        text += f"{values} of the {comparison.unit}s are right"
    else:
        text = f"{first.id} labels {_points(100 * found.shown)} more {comparison.unit}s correctly "
        text += f"than {second.id}: {values}"
    return f"{text} {_evidence(found)}; {_balance(comparison, first, second)}"


def _balance(comparison: Comparison, first: MethodResult, second: MethodResult) -> str:
    """The method with the higher recall of each label, with the largest difference."""
    found = comparison.judgement.between(first.id, second.id, "balanced_accuracy")
    one, other = (100 * item.evaluation.balanced_accuracy for item in (first, second))
    if found.winner is None:
        return f"balanced accuracy is {one:.1f} against {other:.1f} %, within chance"
    ahead, behind = (first, second) if found.winner == first.id else (second, first)
    recalls = [
        (name, ahead.evaluation.recall[name], behind.evaluation.recall[name])
        for name in comparison.label_names
    ]
    known = [(name, a, b) for name, a, b in recalls if a is not None and b is not None]
    name, more, less = max(known, key=lambda item: item[1] - item[2])
    return (
        f"{ahead.id} finds {100 * more:.0f} % of the {name} {comparison.unit}s, {behind.id} "
        f"{100 * less:.0f} % (balanced accuracy {one:.1f} against {other:.1f} %)"
    )


def _evidence(found: Difference) -> str:
    """The interval of a difference, and the numbers of buildings and seeds that show it."""
    text = f"(95 % interval of the difference: {_span(found)} points)"
    signs = found.buildings
    if signs.n_buildings > 1:
        text += f", ahead in {signs.better} and behind in {signs.worse} of {signs.n_buildings} "
        text += f"buildings (sign test: p = {signs.p_value:.2g})"
    if found.by_seed:
        text += f", ahead with {found.seeds.better} of {len(found.by_seed)} seeds"
    return text


def _standing_words(
    comparison: Comparison, top: MethodResult, method: MethodResult, *, is_best: bool
) -> str:
    if is_best:
        return "significantly best"
    if method is top:
        return "highest, but not significantly"
    if all(
        np.array_equal(one.labels, other.labels)
        for one, other in zip(top.labelings, method.labelings, strict=True)
    ):
        return f"the same labels as {top.id}"
    difference = comparison.judgement.between(top.id, method.id)
    behind = f"{_points(100 * difference.shown)} behind {top.id} ({_span(difference)})"
    return behind if difference.winner == top.id else f"{behind}: not significant"


def _number(value: float) -> str:
    text = f"{value:.1f}" if abs(value) >= 0.1 else f"{value:.2f}"
    return text if float(text) else "0.0"  # never -0.00


def _points(value: float) -> str:
    shown = _number(value)
    return f"{shown} point{'' if shown == '1.0' else 's'}"


def _span(found: Difference) -> str:
    """The ends of the interval of a difference, with a proper minus sign."""
    low, high = found.interval.low, found.interval.high
    return f"{_number(100 * low)} to {_number(100 * high)}".replace("-", "−")


def _cost(method: MethodResult) -> str:
    """The computing time of a method, without the scores that all methods share."""
    return f"{method.id} {_learning(method)} and labels in {_duration(method.seconds['infer'])}"


def _learning(method: MethodResult) -> str:
    if method.learned_with is not None:
        return f"learns with {method.learned_with}"
    learn = method.seconds.get("learn", 0.0)
    return f"learns in {_duration(learn)}" if learn else "needs no learning"


def _duration(seconds: float) -> str:
    if seconds < 0.01:
        return "less than 0.01 s"
    if seconds < 100:
        return f"{seconds:.2f} s" if seconds < 10 else f"{seconds:.1f} s"
    return f"{seconds / 60:.1f} minutes"


@dataclass(frozen=True)
class AccuracyAxis:
    """Shares from ``low`` to ``high`` in steps of ``step``."""

    low: float
    high: float
    step: float

    @classmethod
    def over(cls, low: float, high: float) -> "AccuracyAxis":
        """An axis of at most five steps that contains both ends."""
        for step in STEPS:
            first = np.floor(low / step + 1e-9) * step
            last = min(np.ceil(high / step - 1e-9) * step, 1.0)
            last = max(last, first + step)
            if (last - first) / step <= 5 + 1e-9:
                break
        return cls(float(first), float(last), step)

    def percent(self, value: float) -> float:
        """The position of a share, in percent of the width."""
        return 100 * (value - self.low) / (self.high - self.low)

    def ticks(self) -> list[tuple[float, str]]:
        """The place of each step, with its number at both ends and at a step in the middle."""
        n_steps = round((self.high - self.low) / self.step)
        named = {0, n_steps, n_steps / 2}  # more would overlap on a narrow page
        values = [self.low + k * self.step for k in range(n_steps + 1)]
        return [
            (self.percent(value), f"{100 * value:.0f} %" if k in named else "")
            for k, value in enumerate(values)
        ]


_SHARED_QUANTITIES = ("accuracy", "balanced_accuracy", "change", "residual")
"""Quantities that are comparable between methods, and share a chart. Energies are not."""

_MOST_LINES = 12


def reliability_chart(comparison: Comparison) -> Chart | None:
    """Accuracy over confidence, a line per method with beliefs; None without such methods."""
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
    """Objective and bound during learning, for each method that records them."""
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


def write_report(comparison: Comparison, path: Path | str) -> Path:
    """Write the complete report; the path.

    Raises
    ------
    OutputError
        The file cannot be written; an existing file is not changed.
    """
    return write_text(path, report_page(comparison))


def report_page(comparison: Comparison) -> str:
    """The report as text: the same comparison gives the same text, without a date.

    Pictures, style and script are in the file, and a content policy in its head forbids it to load
    anything else. Every text from configurations, maps and label names is escaped.
    """
    labels = label_swatches(comparison.label_names)
    units, tables = [item.unit for item in comparison.maps], comparison_tables(comparison)
    ended = {found.status for method in comparison.methods for found in method.labelings}
    most = max(tables["truth"].rows, key=lambda row: float(row.cells[-1].text))
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
        glance=summary_of(comparison),
        tables=tables,
        swatches={item.name: item for item in labels},
        blocks=_MIXED_BLOCKS if comparison.is_mixed else _BLOCKS[comparison.unit],
        most=most,
        legend=(*labels, Swatch("error", ERROR), *(GROUND_SWATCHES if {*units} - {"node"} else ())),
        map_layers=label_layers(comparison),
        reliability=reliability_chart(comparison),
        histories=history_charts(comparison),
        gradients=_GRADIENTS,
        beliefs=probability_layers(comparison),
        statuses=[(str(item), item.meaning) for item in Status if item in ended],
    )
