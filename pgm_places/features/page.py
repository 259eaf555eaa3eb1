"""The manual's table of features: ``python -m pgm_places.features.page docs/features.md``.

It rewrites the part of the page between two marks from ``LASER_FEATURES``.
"""

import sys
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

from pgm_places.errors import InputError
from pgm_places.features.laser import LASER_FEATURES, FeatureSpec

__all__ = ["feature_table", "updated_page"]

START = "<!-- table: python -m pgm_places.features.page docs/features.md -->"
END = "<!-- end of table -->"
LONG_RUN = 20


def feature_table() -> str:
    """All features as a Markdown table, one row for each family of neighbouring columns."""
    lines = [
        "| columns | name | parameters | definition | source |",
        "|---|---|---|---|---|",
    ]
    families = groupby(
        enumerate(LASER_FEATURES), key=lambda item: (item[1].id, item[1].definition, item[1].source)
    )
    for (name, definition, source), members in families:
        numbered = list(members)
        first, last = numbered[0][0], numbered[-1][0]
        cells = (
            str(first) if first == last else f"{first}–{last}",
            name,
            _parameters([spec for _, spec in numbered]),
            definition,
            source,
        )
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(lines)


def _parameters(specs: Sequence[FeatureSpec]) -> str:
    """The parameters, a long run of whole numbers by its ends."""
    values = [spec.parameter for spec in specs if spec.parameter is not None]
    whole = all(isinstance(value, int) for value in values)
    if whole and len(values) > LONG_RUN and values[-1] - values[0] == len(values) - 1:
        return f"{values[0]}, {values[0] + 1}, ... {values[-1]}"
    return ", ".join(str(value) for value in values)


def updated_page(text: str) -> str:
    """The page with its table renewed.

    Raises
    ------
    InputError
        If the page does not hold the two marks in order.
    """
    before, start, rest = text.partition(START)
    _, end, after = rest.partition(END)
    if not start or not end:
        raise InputError(f"the page must hold the marks {START!r} and {END!r}")
    return f"{before}{START}\n\n{feature_table()}\n\n{END}{after}"


def main(arguments: Sequence[str]) -> None:
    """Rewrite the table of the page that is named."""
    if len(arguments) != 1:
        raise InputError("name one page: python -m pgm_places.features.page docs/features.md")
    page = Path(arguments[0])
    page.write_text(updated_page(page.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
