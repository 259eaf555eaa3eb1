"""The charts of a comparison: reliability of beliefs, iterations of methods, learning."""

from collections.abc import Iterator

from pgm_places.experiment.comparison import Comparison
from pgm_places.report.line_chart import Chart, Line, line_chart

__all__ = ["history_charts", "reliability_chart"]

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
