"""Finished sections as Markdown, with or without their pictures."""

from collections.abc import Sequence

from experiments.paper.figures import percent
from experiments.paper.section import Finding, Section, Table

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


def markdown_page(sections: Sequence[Section]) -> str:
    """The whole page; each section's pictures are expected in a folder beside it."""
    parts = ["# The paper's experiments\n"]
    if not all(section.real for section in sections):
        parts.append(f"**{STAND_IN_WARNING}**\n")
    parts.append(markdown_table(overview_table(sections)))
    parts += [markdown_section(section, with_pictures=True) for section in sections]
    return "\n".join(parts)


def markdown_section(section: Section, *, with_pictures: bool) -> str:
    """A section under a second-level heading."""
    lines = [f"## {section.heading}\n", f"{section.setting}\n"]
    if section.paper:
        lines.insert(1, f"The paper: {section.paper}\n")
    if not section.real:
        lines.append("Generated buildings, not the paper's.\n")
    for table in section.tables:
        lines.append(f"{table.caption}:\n")
        lines.append(markdown_table(table))
    lines += [f"{text}\n" for text in section.remarks]
    if with_pictures:
        lines += [
            f"![{item.caption}]({section.id}/{item.file})\n\n*{item.caption}*\n"
            for item in section.pictures
        ]
    lines.append(f"It took {section.seconds:.0f} s.\n")
    return "\n".join(lines)


def markdown_table(table: Table) -> str:
    """The table as a pipe table, followed by an empty line."""
    lines = [_line(table.heading), "|" + "---|" * len(table.heading)]
    lines += [_line(row) for row in table.rows]
    return "\n".join(lines) + "\n"


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
