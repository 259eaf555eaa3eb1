"""Tables as plain text, for terminals and logs."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pgm_places.experiment.comparison import Comparison


def text_table(rows: Sequence[Sequence[str]]) -> str:
    """Rows as aligned columns, the first left, the others right; the first row is the heading."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = []
    for index, row in enumerate(rows):
        cells = [row[0].ljust(widths[0])]
        cells += [cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True)]
        lines.append("  ".join(cells).rstrip())
        if index == 0:
            lines.append("  ".join("-" * width for width in widths))
    return "\n".join(lines)


_IN_TERMINALS = ("results", "differences", "by_label", "doors", "by_split", "by_unit")


def comparison_table(comparison: "Comparison") -> str:
    """The main tables of a comparison, then the options chosen on training data, as text."""
    from pgm_places.report.comparison_tables import comparison_tables

    tables = comparison_tables(comparison)
    parts = [
        f"{tables[name].caption}\n\n{text_table(tables[name].as_words())}"
        for name in _IN_TERMINALS
        if name in tables
    ]
    stages = ", ".join(f"{name} {value:.1f} s" for name, value in comparison.stage_seconds.items())
    note = "* significantly better, or the highest of a split; ranges: 95 % intervals"
    n_seeds = len(comparison.seeds)
    note += f"; ±: standard deviation over {n_seeds} seeds" if n_seeds else ""
    parts.append(f"({note}; stages: {stages})")
    chosen = [f"{option}: {words}" for option, words in comparison.all_choices.items()]
    return "\n" + "\n\n".join(parts) + "".join(f"\n{line}" for line in chosen)


def shares_line(fractions: "tuple[float, float, float]") -> str:
    """The shares of free, occupied and unknown cells."""
    free, occupied, unknown = fractions
    return (
        f"map: {100 * free:.1f} % free, {100 * occupied:.1f} % occupied, "
        f"{100 * unknown:.1f} % unknown"
    )
