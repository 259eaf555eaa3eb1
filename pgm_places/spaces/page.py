"""The manual's tables of features of spaces: ``python -m pgm_places.spaces.page docs/spaces.md``.

Rewrites the parts of the page between the marks of a table.
"""

import sys
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

from pgm_places.errors import InputError
from pgm_places.spaces.space_spec import (
    CELL_FEATURES,
    GATE_FEATURES,
    PLACE_EXTRA_FEATURES,
    SEGMENT_FEATURES,
    SpaceSpec,
)

__all__ = ["TABLES", "updated_page"]

TABLES: dict[str, tuple[SpaceSpec, ...]] = {
    "segments": SEGMENT_FEATURES,
    "cells": CELL_FEATURES,
    "gates": GATE_FEATURES,
    "places": PLACE_EXTRA_FEATURES,
}
END = "<!-- end of table -->"


def updated_page(text: str) -> str:
    """The page with its tables renewed.

    Raises
    ------
    InputError
        If the page lacks the marks of a table.
    """
    for name, specs in TABLES.items():
        start = f"<!-- table: {name} -->"
        before, found, rest = text.partition(start)
        _, end, after = rest.partition(END)
        if not found or not end:
            raise InputError(f"the page must contain the marks {start!r} and {END!r}")
        text = f"{before}{start}\n\n{_table(specs)}\n\n{END}{after}"
    return text


def _table(specs: tuple[SpaceSpec, ...]) -> str:
    """A row per definition; columns that share one, such as those of a profile, are one row."""
    lines = ["| columns | name | definition |", "|---|---|---|"]
    for definition, group in groupby(enumerate(specs), key=lambda item: item[1].definition):
        (first, spec), *others = group
        last, end = others[-1] if others else (first, spec)
        columns = f"{first}–{last}" if others else str(first)
        name = f"{spec.id} to {end.id}" if others else spec.id
        escaped = definition.replace("|", "\\|")
        lines.append(f"| {columns} | {name} | {escaped} |")
    return "\n".join(lines)


def main(arguments: Sequence[str]) -> None:
    """Rewrite the tables of the given page."""
    if len(arguments) != 1:
        raise InputError("give one page: python -m pgm_places.spaces.page docs/spaces.md")
    page = Path(arguments[0])
    page.write_text(updated_page(page.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
