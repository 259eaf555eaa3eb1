"""The report's charts: confusion matrices, reliability of beliefs, histories of the iterations."""

from collections.abc import Sequence

from pgm_places.evaluation.evaluation import Evaluation
from pgm_places.experiment.comparison import Comparison, MethodResult
from pgm_places.palette import label_colours
from pgm_places.report.line_chart import Series, line_chart
from pgm_places.report.markup import Markup, element
from pgm_places.report.report_maps import swatch

__all__ = ["confusions_section", "histories_section", "reliability_section"]

_SHARED_QUANTITIES = ("accuracy", "balanced_accuracy", "change", "residual")
"""Quantities that mean the same for every method: drawn in one chart. Energies are not."""

_MOST_LINES = 12


def confusions_section(comparison: Comparison) -> Markup:
    """A confusion matrix per method: shares of each true label, and counts."""
    tables = [_confusion(method.id, method.evaluation) for method in comparison.methods]
    return element("div", *tables, class_="confusions")


def _confusion(name: str, evaluation: Evaluation) -> Markup:
    labels = evaluation.label_names
    names = [
        element("span", swatch(colour), label)
        for label, colour in zip(labels, label_colours(labels), strict=True)
    ]
    rows = []
    for true, counts in enumerate(evaluation.confusion):
        total = int(counts.sum())
        cells = [_share(int(count), total) for count in counts]
        rows.append(element("tr", element("th", names[true], scope="row"), *cells))
    head = [element("td", "true ↓ predicted →", class_="muted")]
    head += [element("th", label, scope="col") for label in names]
    table = element(
        "table",
        element("caption", f"{name}: percent of each true label, and cells"),
        element("thead", element("tr", *head)),
        element("tbody", *rows),
        class_="confusion",
    )
    words = f"Confusion matrix of {name}"
    return element("div", table, class_="scroll", tabindex="0", role="region", aria_label=words)


def _share(count: int, total: int) -> Markup:
    share = count / total if total else 0.0
    words = f"{100 * share:.1f}" if total else "–"
    return element(
        "td",
        words,
        element("small", f"{count:,}"),
        style=f"background:rgba(var(--heat),{0.05 + 0.95 * share:.3f})",
        class_="dark" if share > 0.5 else None,
    )


def reliability_section(comparison: Comparison) -> Markup:
    """How often predictions of a given confidence are right."""
    series = []
    for style, method in enumerate(comparison.methods):
        table = method.evaluation.reliability
        if table is None:
            continue
        error = 100 * table.expected_calibration_error
        name = f"{method.id} (ECE {error:.1f} %)"
        confidence, right = table.mean_confidence.tolist(), table.accuracy.tolist()
        series.append(Series(name, confidence, right, style))
    if not series:
        return element("p", "No method of this comparison gives probabilities.", class_="muted")
    chart = line_chart(
        series,
        x_name="confidence",
        y_name="share that is right",
        limits=(0.0, 1.0),
        diagonal=True,
        markers=True,
    )
    note = "On the dotted line beliefs say what they mean; below it they are too sure."
    return element("div", element("p", note, class_="muted"), chart)


def histories_section(comparison: Comparison) -> Markup:
    """Accuracy, change, score and bound over the iterations, and learning, where they are told."""
    charts = []
    for name, series in _charts(comparison).items():
        quantity = name[-1]
        chart = line_chart(
            series[:_MOST_LINES], x_name="iteration", y_name=quantity.replace("_", " ")
        )
        if chart:
            title = ": ".join(part.replace("_", " ") for part in name)
            charts.append(element("div", element("h4", title), chart))
    charts += _learning_charts(comparison)
    if not charts:
        return element("p", "No method of this comparison tells a history.", class_="muted")
    return element("div", *charts, class_="charts")


def _charts(comparison: Comparison) -> dict[tuple[str, ...], list[Series]]:
    """The series of each chart, by the chart's title."""
    charts: dict[tuple[str, ...], list[Series]] = {}
    for at, method in enumerate(comparison.methods):
        for index, quantity, values in _lines(method):
            shared = quantity in _SHARED_QUANTITIES
            title = (quantity,) if shared else (method.id, quantity)
            place = comparison.maps[index].name if len(comparison.maps) > 1 else ""
            name = ", ".join(part for part in (method.id if shared else "", place) if part)
            line = charts.setdefault(title, [])
            style = len(line) if place else at  # a method looks the same in every chart
            steps = list(range(1, len(values) + 1))
            line.append(Series(name or method.id, steps, values, style))
    return charts


def _lines(method: MethodResult) -> list[tuple[int, str, Sequence[float]]]:
    return [
        (index, quantity, values)
        for index, history in enumerate(method.histories)
        for quantity, values in history.items()
    ]


def _learning_charts(comparison: Comparison) -> list[Markup]:
    """How learning closed in on the optimum from both sides, per method that tells it."""
    charts = []
    for method in comparison.methods:
        series = [
            Series(name, list(range(1, len(values) + 1)), values, at)
            for at, (name, values) in enumerate(method.learning.items())
        ]
        if series:
            chart = line_chart(series, x_name="step of learning", y_name="objective")
            charts.append(element("div", element("h4", f"{method.id}: learning"), chart))
    return charts
