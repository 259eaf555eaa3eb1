"""The report's tables: results, labels, optimality, learning, time, versions and inputs."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from pgm_places.evaluation.evaluation import Evaluation
from pgm_places.experiment.comparison import Comparison, MethodResult
from pgm_places.inference.labeling import Labeling
from pgm_places.palette import label_colours
from pgm_places.report.markup import Markup, data_table, element, joined
from pgm_places.report.report_maps import swatch

__all__ = [
    "certificates_table",
    "learned_section",
    "mean_iou",
    "percent",
    "plain_table",
    "results_table",
    "scores_by_label_table",
    "truth_table",
]

_NONE = "–"


def percent(value: float | None, digits: int = 1) -> str:
    """The share in percent, a dash where there is none."""
    return _NONE if value is None else f"{100 * value:.{digits}f}"


def mean_iou(evaluation: Evaluation) -> float | None:
    """Mean over the labels of nodes true and predicted over nodes true or predicted."""
    defined = [value for value in evaluation.iou.values() if value is not None]
    return float(np.mean(defined)) if defined else None


_FIGURES: tuple[tuple[str, Callable[[Evaluation], float | None]], ...] = (
    ("Accuracy", lambda found: found.accuracy),
    ("Balanced", lambda found: found.balanced_accuracy),
    ("Macro F1", lambda found: found.macro_f1),
    ("Mean IoU", mean_iou),
    ("MCC", lambda found: found.mcc),
)


def results_table(methods: Sequence[MethodResult]) -> Markup:
    """One row per method: whole figures in percent, calibration, seconds."""
    columns = [[figure(method.evaluation) for method in methods] for _, figure in _FIGURES]
    heading = ["Method", *(name for name, _ in _FIGURES), "ECE", "Learn s", "Infer s"]
    best = [_best(values) for values in columns]
    rows = []
    for at, method in enumerate(methods):
        cells = [
            _cell(
                joined([percent(values[at]), _interval(method, name)]),
                best=len(methods) > 1 and values[at] == top,
            )
            for (name, _), values, top in zip(_FIGURES, columns, best, strict=True)
        ]
        cells.append(_cell(percent(method.evaluation.expected_calibration_error)))
        cells += [_cell(_seconds(method.seconds.get(key))) for key in ("learn", "infer")]
        rows.append(element("tr", element("th", _method_name(method), scope="row"), *cells))
    note = (
        "Balanced is the mean recall, IoU is intersection over union, MCC is Matthews’ "
        "correlation, ECE the expected calibration error of the beliefs. A dot marks the best. "
        "Small figures are 95 % confidence intervals: squares of the maps drawn anew."
    )
    head = [[element("th", name, scope="col") for name in heading]]
    table = _table("All test maps together, in percent", head, rows)
    return joined([table, element("p", note, class_="muted")])


def scores_by_label_table(comparison: Comparison) -> Markup:
    """One row per method: recall, precision and IoU of every label."""
    methods, names = comparison.methods, comparison.label_names
    kinds = ("recall", "precision", "iou")
    top = [element("th", "Method", scope="col", rowspan=2)]
    top += [
        element("th", swatch(colour), name, colspan=3, scope="colgroup", class_="group")
        for name, colour in zip(names, label_colours(names), strict=True)
    ]
    words = {"recall": "Recall", "precision": "Precision", "iou": "IoU"}
    under = [
        element("th", words[kind], scope="col", class_="group" if kind == "recall" else None)
        for _ in names
        for kind in kinds
    ]
    values = {
        (kind, name): [getattr(method.evaluation, kind)[name] for method in methods]
        for kind in kinds
        for name in names
    }
    rows = []
    for at, method in enumerate(methods):
        cells = []
        for name in names:
            for kind in kinds:
                column = values[kind, name]
                best = len(methods) > 1 and column[at] is not None and column[at] == _best(column)
                cells.append(_cell(percent(column[at]), best=best, group=kind == "recall"))
        rows.append(element("tr", element("th", method.id, scope="row"), *cells))
    return _table("By label, in percent", [top, under], rows)


def truth_table(comparison: Comparison) -> Markup:
    """How the evaluated cells are shared among the labels: what a constant answer would score."""
    counts = np.zeros(len(comparison.label_names), np.int64)
    areas = np.zeros(len(comparison.label_names))
    for item in comparison.maps:
        truth = item.layout.from_raster(item.truth)
        on_map = np.bincount(truth[truth >= 0], minlength=len(counts))
        counts += on_map
        areas += on_map * item.grid.resolution_m**2
    total = max(int(counts.sum()), 1)
    colours = label_colours(comparison.label_names)
    rows = [
        [joined([swatch(colour), name]), f"{count:,}", f"{area:.1f}", percent(count / total)]
        for name, colour, count, area in zip(
            comparison.label_names, colours, counts, areas, strict=True
        )
    ]
    most = comparison.label_names[int(counts.argmax())]
    note = f"Always answering “{most}” would be right in {percent(counts.max() / total)} % of them."
    table = data_table(
        "True labels of the evaluated cells",
        ["Label", "Cells", "Area m²", "Share %"],
        rows,
    )
    return joined([table, element("p", note, class_="muted")])


def certificates_table(comparison: Comparison) -> Markup:
    """Per method and map: score, bound and how far from the best the answer may be."""
    rows = []
    for method in comparison.methods:
        for item, labeling in zip(comparison.maps, method.labelings, strict=True):
            name = f"{method.id}, {item.name}" if len(comparison.maps) > 1 else method.id
            rows.append(
                [
                    name,
                    str(labeling.status),
                    _figure(labeling.score),
                    _figure(labeling.bound),
                    _figure(labeling.gap),
                    _relative_gap(labeling),
                    _steps(labeling.info),
                ]
            )
    heading = ["Method", "Ended", "Score", "Upper bound", "Gap", "Gap %", "Iterations"]
    note = (
        "The score is the log-potential of the labels under the method’s own model, larger is "
        "better; scores of different methods are not comparable. A gap of 0 is proved best."
    )
    table = data_table("How far from the best each labelling may be", heading, rows)
    return joined([table, element("p", note, class_="muted"), _learned_certificates(comparison)])


def _learned_certificates(comparison: Comparison) -> Markup:
    """Per method that learned by optimisation: how far from the best its weights may be."""
    keys = ("objective", "lower_bound", "certified_objective", "certified_gap")
    rows = []
    for method in comparison.methods:
        if not all(key in method.learned for key in keys):
            continue
        objective, lower, certified, gap = (method.learned[key] for key in keys)
        rows.append(
            [
                method.id,
                str(method.learned.get("status", _NONE)),
                _figure(objective),
                _figure(certified),
                _figure(lower),
                percent(gap, 2),
                str(method.learned.get("iterations", _NONE)),
            ]
        )
    if not rows:
        return Markup("")
    heading = ["Method", "Ended", "Objective", "At most", "At least", "Gap %", "Steps"]
    note = (
        "Learning makes the objective small. No weights reach less than “at least”; the learned "
        "ones are proved to cost no more than “at most”."
    )
    table = data_table("How far from the best the learned weights may be", heading, rows)
    return joined([table, element("p", note, class_="muted")])


def learned_section(comparison: Comparison) -> Markup:
    """What each method says about its learning, and its options."""
    parts = []
    for method in comparison.methods:
        tables = [plain_table("Options", method.options)]
        if method.learned:
            tables.append(plain_table("Learned", method.learned))
        summary = element("summary", f"{method.id} ({method.name})")
        parts.append(element("details", summary, *tables))
    return joined(parts)


def plain_table(caption: str, values: Mapping[str, Any]) -> Markup:
    """Names and values as they are."""
    rows = [
        element("tr", element("th", key, scope="row"), element("td", _text(value)))
        for key, value in values.items()
    ]
    if not rows:
        return element("p", f"{caption}: none", class_="muted")
    return _table(caption, [], rows, kind="facts")


def _table(
    caption: str, heading: Sequence[Sequence[Markup]], rows: Sequence[Markup], kind: str = "figures"
) -> Markup:
    head = element("thead", *(element("tr", *line) for line in heading)) if heading else ""
    table = element(
        "table", element("caption", caption), head, element("tbody", *rows), class_=kind
    )
    return element("div", table, class_="scroll", tabindex="0", role="region", aria_label=caption)


def _interval(method: MethodResult, figure: str) -> Markup:
    """The confidence interval of a figure that has one."""
    key = {"Accuracy": "accuracy", "Balanced": "balanced_accuracy"}.get(figure, "")
    found = method.intervals.get(key)
    if found is None:
        return Markup("")
    return element("small", f"{percent(found.low)}–{percent(found.high)}", class_="interval")


def _cell(text: str, *, best: bool = False, group: bool = False) -> Markup:
    classes = [name for name, wanted in (("best", best), ("group", group)) if wanted]
    return element("td", text, class_=" ".join(classes) or None)


def _best(values: Sequence[float | None]) -> float | None:
    return max((value for value in values if value is not None), default=None)


def _method_name(method: MethodResult) -> Markup:
    if method.name == method.id:
        return element("span", method.id)
    return joined([method.id, element("span", method.name, class_="kind")])


def _seconds(value: float | None) -> str:
    if value is None:
        return _NONE
    return f"{value:.2f}" if value < 10 else f"{value:.1f}"


def _figure(value: float | None) -> str:
    return _NONE if value is None else f"{value:,.3f}"


def _relative_gap(labeling: Labeling) -> str:
    if labeling.gap is None or labeling.score is None:
        return _NONE
    return f"{100 * labeling.gap / max(abs(labeling.score), 1e-12):.3g}"


def _steps(info: Mapping[str, Any]) -> str:
    found = next((info[k] for k in ("iterations", "n_iterations", "sweeps") if k in info), None)
    return _NONE if found is None else f"{found}"


def _text(value: Any) -> str:
    """A value as a reader likes it: short numbers, long arrays by their shape."""
    if isinstance(value, float | np.floating):
        return f"{float(value):.6g}"
    if isinstance(value, np.ndarray) and value.size > 12:
        return f"array of shape {value.shape}"
    if isinstance(value, np.ndarray):
        return _text(value.tolist())
    if isinstance(value, list | tuple):
        shown = ", ".join(_text(item) for item in value[:24])
        return f"{shown} … ({len(value)} values)" if len(value) > 24 else shown
    return str(value)
