"""A comparison as one HTML file that needs nothing else: to read, to print, to send."""

import json
from collections.abc import Mapping
from pathlib import Path

from pgm_places.experiment.comparison import Comparison, MethodResult
from pgm_places.io.atomic import write_text
from pgm_places.report.markup import Markup, data_table, element, joined
from pgm_places.report.page_head import page_head
from pgm_places.report.page_script import SCRIPT
from pgm_places.report.report_charts import (
    confusions_section,
    histories_section,
    reliability_section,
)
from pgm_places.report.report_maps import maps_section, probabilities_section
from pgm_places.report.report_tables import (
    certificates_table,
    learned_section,
    percent,
    plain_table,
    results_table,
    scores_by_label_table,
    truth_table,
)

__all__ = ["report_page", "write_report"]


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
    sections = [
        ("results", "Results", _results(comparison)),
        ("maps", "Maps", maps_section(comparison)),
        ("confusion", "Confusion", confusions_section(comparison)),
        ("reliability", "Reliability", reliability_section(comparison)),
        ("iterations", "Iterations", histories_section(comparison)),
        ("probabilities", "Probabilities", probabilities_section(comparison)),
        ("optimality", "Optimality", certificates_table(comparison)),
        ("setup", "Set-up", _setup(comparison)),
    ]
    links = [element("li", element("a", title, href=f"#{key}")) for key, title, _ in sections]
    body = element(
        "body",
        element(
            "header",
            element("h1", comparison.title),
            element("p", _summary(comparison), class_="muted"),
            element("nav", element("ul", *links), aria_label="Sections"),
        ),
        element(
            "main",
            _warnings(comparison),
            _cards(comparison),
            *(
                element("section", element("h2", title), content, id=key)
                for key, title, content in sections
            ),
        ),
        element("footer", _footer(comparison)),
        _viewer(),
        Markup(f"<script>{SCRIPT}</script>"),
    )
    page = element("html", page_head(comparison.title, SCRIPT), body, lang="en")
    return f"<!DOCTYPE html>\n{page}\n"


def _summary(comparison: Comparison) -> str:
    n_cells = sum(method.evaluation.n for method in comparison.methods[:1])
    maps = _counted(len(comparison.maps), "test map")
    methods = _counted(len(comparison.methods), "method")
    names = ", ".join(comparison.label_names)
    return f"{methods} on {maps}; {n_cells:,} cells evaluated; labels: {names}."


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def _warnings(comparison: Comparison) -> Markup:
    if not comparison.warnings:
        return Markup("")
    items = [element("li", message) for message in comparison.warnings]
    title = element("strong", _counted(len(items), "warning"))
    return element("div", title, element("ul", *items), class_="warnings", role="note")


def _cards(comparison: Comparison) -> Markup:
    """The figures most readers come for."""
    methods = comparison.methods
    if not methods:
        return Markup("")

    def best(name: str, key: str) -> Markup:
        top = max(methods, key=lambda method: float(getattr(method.evaluation, key)))
        return _card(f"{percent(getattr(top.evaluation, key))} %", f"{name}: {top.id}")

    cards = [best("best accuracy", "accuracy"), best("best balanced accuracy", "balanced_accuracy")]
    cards += _rarest(comparison)
    total = sum(comparison.stage_seconds.values()) + sum(
        m.seconds.get("infer", 0.0) for m in methods
    )
    cards.append(_card(f"{total:.1f} s", "everything together"))
    return element("ul", *cards, class_="cards")


def _rarest(comparison: Comparison) -> list[Markup]:
    """The best recall of the rarest label, where methods differ most."""
    counts = comparison.methods[0].evaluation.confusion.sum(axis=1)
    present = [k for k in range(len(counts)) if counts[k]]
    if len(present) < 2:
        return []
    name = comparison.label_names[min(present, key=lambda k: int(counts[k]))]

    def recall(method: MethodResult) -> float:
        return method.evaluation.recall[name] or 0.0

    top = max(comparison.methods, key=recall)
    return [_card(f"{percent(recall(top))} %", f"best recall of {name}, the rarest: {top.id}")]


def _card(figure: str, words: str) -> Markup:
    return element("li", element("b", figure), words)


def _results(comparison: Comparison) -> Markup:
    parts = [results_table(comparison.methods), scores_by_label_table(comparison)]
    if len(comparison.maps) > 1:
        parts.append(_by_map(comparison))
    parts.append(truth_table(comparison))
    parts.append(_seconds(comparison.stage_seconds))
    return joined(parts)


def _by_map(comparison: Comparison) -> Markup:
    rows = [
        [
            method.id,
            *(
                f"{percent(found.accuracy)} / {percent(found.balanced_accuracy)}"
                for found in method.evaluations
            ),
        ]
        for method in comparison.methods
    ]
    heading = ["Method", *(item.name for item in comparison.maps)]
    return data_table("Accuracy / balanced accuracy by map, in percent", heading, rows)


def _seconds(stages: Mapping[str, float]) -> Markup:
    if not stages:
        return Markup("")
    words = " · ".join(f"{name} {value:.2f} s" for name, value in stages.items())
    return element("p", f"Shared stages: {words}", class_="muted")


def _setup(comparison: Comparison) -> Markup:
    config = json.dumps(comparison.config, indent=2, ensure_ascii=False, default=str)
    return joined(
        [
            learned_section(comparison),
            element(
                "details",
                element("summary", "Configuration, every default written out"),
                element("pre", element("code", config)),
            ),
            element(
                "details",
                element("summary", "Versions"),
                plain_table("What computed this", comparison.versions),
            ),
            element(
                "details",
                element("summary", "Inputs"),
                plain_table("SHA-256 of every file that was read", comparison.inputs),
            ),
        ]
    )


def _footer(comparison: Comparison) -> str:
    version = comparison.versions.get("pgm-places", "")
    return f"Written by pgm-places {version}".strip() + "."


_CONTROLS = (
    ("previous", "‹", "Previous layer"),
    ("next", "›", "Next layer"),
    ("smaller", "−", "Smaller"),
    ("larger", "+", "Larger"),
    ("fit", "Fit", None),
    ("close", "Close", None),
)


def _viewer() -> Markup:
    """The dialog that shows a map large; it stays empty and closed without the script."""
    controls = [
        element("button", text, type="button", data_action=action, aria_label=label)
        for action, text, label in _CONTROLS
    ]
    layers = element("select", aria_label="Layer")
    return element(
        "dialog",
        element("div", layers, *controls, class_="bar"),
        element("div", element("img", alt="", src="data:,"), class_="stage"),
        aria_label="Map, enlarged",
    )
