"""The overview table, shown first everywhere: the paper's figures compared with ours."""

from collections.abc import Sequence

from pgm_places.reproduce.figures import percent
from pgm_places.reproduce.section import Finding, Section, Table

__all__ = ["OVERVIEW", "PAPER_COLUMN", "STAND_IN_WARNING", "overview_table"]

PAPER_COLUMN = "paper"
OVERVIEW = "Comparison with the paper"
STAND_IN_WARNING = (
    "The real maps are not available: generated buildings stand in for them. These figures only "
    "show that everything runs; do not compare them with the paper's."
)


def overview_table(sections: Sequence[Section]) -> Table:
    """A row per finding; ablations are left out where there are sections of the paper."""
    heading = ("experiment", "buildings", PAPER_COLUMN, "ours", "95 %", "balanced", "doorway F1")
    rows = [
        (f"{section.id} {item.what}", "real" if section.real else "generated", *_figures(item))
        for section in [item for item in sections if item.paper] or sections
        for item in section.findings
    ]
    return Table("Accuracy in percent: the paper's and ours", heading, tuple(rows))


def _figures(item: Finding) -> tuple[str, ...]:
    interval = item.interval
    return (
        item.paper if isinstance(item.paper, str) else percent(item.paper),
        item.counts or percent(item.accuracy),
        "-" if interval is None else f"{percent(interval[0])} to {percent(interval[1])}",
        percent(item.balanced_accuracy),
        percent(item.doorway_f1),
    )
