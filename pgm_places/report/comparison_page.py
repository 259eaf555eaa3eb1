"""A comparison as one self-contained HTML file: to read, to print, to send."""

import json
from collections.abc import Iterator
from pathlib import Path

from pgm_places.experiment.comparison import Comparison
from pgm_places.experiment.evaluated_items import BLOCK_M, NODES_PER_BLOCK, STRETCH_M
from pgm_places.inference.labeling import Status
from pgm_places.io.atomic import write_text
from pgm_places.labelers.presets import preset_record
from pgm_places.palette import ERROR, GROUND_SWATCHES, Swatch, label_swatches, levels
from pgm_places.pictures.page import render
from pgm_places.report.comparison_tables import comparison_tables
from pgm_places.report.line_chart import Chart, Line, line_chart
from pgm_places.report.map_layers import label_layers, probability_layers
from pgm_places.report.summary import summary_of

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
