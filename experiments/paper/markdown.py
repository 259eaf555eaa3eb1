"""Finished sections as Markdown, with or without their pictures."""

from collections.abc import Sequence

from experiments.paper.figures import percent
from experiments.paper.section import Finding, Section, Table
from experiments.paper.setting import WAYS

PAPER_COLUMN = "paper"

OVERVIEW = "Comparison with the paper"

STAND_IN_WARNING = (
    "The real maps are not available: generated buildings stand in for them. These figures only "
    "show that everything runs; do not compare them with the paper's."
)


def overview_table(sections: Sequence[Section]) -> Table:
    """A row per experiment; ablations are left out where there are sections of the paper."""
    shown = [item for item in sections if item.paper] or sections
    found = {item.way for section in shown for item in section.findings}
    ways = [way for way in WAYS if way in found]
    rows: dict[tuple[str, str], dict[str, str]] = {}
    for section in shown:
        for item in section.findings:
            kind = "real" if section.real else "generated"
            row = rows.setdefault((f"{section.id} {item.what}", kind), {})
            row[item.way] = _figures(item)
            if item.paper is not None:
                row[PAPER_COLUMN] = (
                    item.paper if isinstance(item.paper, str) else percent(item.paper)
                )
    columns = (PAPER_COLUMN, *ways)
    return Table(
        "Accuracy / balanced accuracy in percent: the paper's, with the paper's options, and by "
        "default",
        ("experiment", "buildings", *columns),
        tuple((*key, *(row.get(name, "-") for name in columns)) for key, row in rows.items()),
    )


def _figures(item: Finding) -> str:
    return item.counts or f"{percent(item.accuracy)} / {percent(item.balanced_accuracy)}"


def markdown_page(sections: Sequence[Section]) -> str:
    """The page; each section's pictures are expected in a folder next to it."""
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
