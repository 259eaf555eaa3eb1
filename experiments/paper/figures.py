"""The formatting of numbers in the tables of the paper's experiments."""

from collections.abc import Mapping
from typing import TypeVar

from experiments.paper.borders import border_tolerant_mask
from experiments.paper.section import Finding, Table
from experiments.paper.setting import BY_DEFAULT
from pgm_places.evaluation.bootstrap import Interval
from pgm_places.evaluation.evaluation import Evaluation
from pgm_places.experiment.comparison import Comparison, MethodResult

T = TypeVar("T")
DOORWAY = "doorway"
BORDER_M = 0.3
"""Half the width of the strip left out along borders, whose exact position is a matter of taste."""


def percent(value: float | None) -> str:
    """A share as a percentage with one decimal; a dash for None."""
    return "-" if value is None else f"{100 * value:.1f}"


def finding(
    what: str, method: MethodResult, *, paper: float | None = None, way: str = BY_DEFAULT
) -> Finding:
    """The overview's line of a method."""
    interval = method.intervals.get("accuracy")
    return finding_of(what, method.evaluation, interval, paper=paper, way=way)


def method_findings(
    comparisons: Mapping[str, Comparison],
    paper: Mapping[str, float] | None = None,
    way: str = BY_DEFAULT,
) -> tuple[Finding, ...]:
    """A line of the overview per comparison and method; ``paper`` has the paper's by line."""
    return tuple(
        finding(what, method, paper=(paper or {}).get(what), way=way)
        for words, comparison in comparisons.items()
        for method in comparison.methods
        for what in [f"{words}, {method.id}"]
    )


def by_way(found: Mapping[str, Mapping[str, T]]) -> dict[str, T]:
    """What was found in each way, by the way and its name there."""
    return {
        f"{way}, {words}": item for way, items in found.items() for words, item in items.items()
    }


def finding_of(
    what: str,
    found: Evaluation,
    interval: Interval | None,
    *,
    paper: float | None = None,
    way: str = BY_DEFAULT,
) -> Finding:
    """The overview's line of an evaluation and the interval of its accuracy."""
    return Finding(
        what,
        found.accuracy,
        found.balanced_accuracy,
        doorway_f1(found),
        paper,
        None if interval is None else (interval.low, interval.high),
        way=way,
    )


def doorway_f1(found: Evaluation) -> float | None:
    """F1 of the doorways, None where there is no such label."""
    return found.f1.get(DOORWAY)


def method_table(caption: str, comparisons: dict[str, Comparison]) -> Table:
    """A row per comparison and method: accuracy, balance, doorways, seconds."""
    heading = (
        "",
        "method",
        "accuracy",
        "95 %",
        "balanced",
        "doorway recall",
        "doorway precision",
        "doorway F1",
        f"over {BORDER_M:g} m from a border",
        "learn s",
        "infer s",
    )
    rows = [
        (name, *_cells(comparison, method))
        for name, comparison in comparisons.items()
        for method in comparison.methods
    ]
    return Table(caption, heading, tuple(rows))


def away_from_borders(comparison: Comparison, method: MethodResult) -> float | None:
    """The accuracy on cells that are not close to a border between two true labels."""
    right = total = 0
    for item, labeling in zip(comparison.maps, method.labelings, strict=True):
        inside = border_tolerant_mask(item.truth, item.grid.resolution_m, tolerance_m=BORDER_M)
        truth = item.node_truth
        chosen = item.layout.from_raster(inside) & (truth >= 0)
        right += int((labeling.labels[chosen] == truth[chosen]).sum())
        total += int(chosen.sum())
    return right / total if total else None


def _cells(comparison: Comparison, method: MethodResult) -> tuple[str, ...]:
    found = method.evaluation
    interval = method.intervals.get("accuracy")
    return (
        method.id,
        percent(found.accuracy),
        "-" if interval is None else f"{percent(interval.low)} to {percent(interval.high)}",
        percent(found.balanced_accuracy),
        percent(found.recall.get(DOORWAY)),
        percent(found.precision.get(DOORWAY)),
        percent(found.f1.get(DOORWAY)),
        percent(away_from_borders(comparison, method)),
        f"{method.seconds.get('learn', 0.0):.1f}",
        f"{method.seconds.get('infer', 0.0):.2f}",
    )
