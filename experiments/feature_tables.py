"""The tables of features in the manual: ``python -m experiments.feature_tables``.

It rewrites what lies between the marks of each table in docs/features.md and docs/spaces.md.
"""

from collections.abc import Callable, Sequence
from itertools import groupby
from pathlib import Path

from pgm_places.features.laser import LASER_FEATURES, FeatureSpec
from pgm_places.spaces.space_spec import (
    CELL_FEATURES,
    GATE_FEATURES,
    PLACE_EXTRA_FEATURES,
    SEGMENT_FEATURES,
    SpaceSpec,
)

DOCS = Path(__file__).resolve().parents[1] / "docs"
SPACES: dict[str, tuple[SpaceSpec, ...]] = {
    "segments": SEGMENT_FEATURES,
    "cells": CELL_FEATURES,
    "gates": GATE_FEATURES,
    "places": PLACE_EXTRA_FEATURES,
}
END = "<!-- end of table -->"
LONG_RUN = 20


def laser_table() -> str:
    """All laser features as a Markdown table, one row for each family of neighbouring columns."""
    rows = [("columns", "name", "parameters", "definition", "source"), ("---",) * 5]
    families = groupby(
        enumerate(LASER_FEATURES), key=lambda item: (item[1].id, item[1].definition, item[1].source)
    )
    for (name, definition, source), members in families:
        numbered = list(members)
        parameters = _parameters([spec for _, spec in numbered])
        columns = _columns(numbered[0][0], numbered[-1][0])
        rows.append((columns, name, parameters, definition, source))
    return _table(rows)


def spaces_table(specs: tuple[SpaceSpec, ...]) -> str:
    """A row per definition; columns that share one, such as those of a profile, are one row."""
    rows: list[tuple[str, ...]] = [("columns", "name", "definition"), ("---",) * 3]
    for definition, group in groupby(enumerate(specs), key=lambda item: item[1].definition):
        members = list(group)
        (first, spec), (last, end) = members[0], members[-1]
        name = spec.id if first == last else f"{spec.id} to {end.id}"
        rows.append((_columns(first, last), name, definition))
    return _table(rows)


TABLES: dict[str, dict[str, Callable[[], str]]] = {
    "features.md": {"laser": laser_table},
    "spaces.md": {
        name: lambda specs=specs: spaces_table(specs)  # type: ignore[misc]
        for name, specs in SPACES.items()
    },
}
"""What writes each table of a page, by the name in its mark."""


def updated_page(name: str, text: str) -> str:
    """A page with its tables renewed.

    Raises
    ------
    ValueError
        It lacks the marks of a table.
    """
    for table, write in TABLES[name].items():
        start = f"<!-- table: {table} -->"
        before, found, rest = text.partition(start)
        _, end, after = rest.partition(END)
        if not found or not end:
            raise ValueError(f"{name} must hold the marks {start!r} and {END!r}")
        text = f"{before}{start}\n\n{write()}\n\n{END}{after}"
    return text


def _columns(first: int, last: int) -> str:
    return str(first) if first == last else f"{first}–{last}"


def _parameters(specs: Sequence[FeatureSpec]) -> str:
    """The parameters, a long run of whole numbers by its ends."""
    values = [spec.parameter for spec in specs if spec.parameter is not None]
    whole = all(isinstance(value, int) for value in values)
    if whole and len(values) > LONG_RUN and values[-1] - values[0] == len(values) - 1:
        return f"{values[0]}, {values[0] + 1}, ... {values[-1]}"
    return ", ".join(str(value) for value in values)


def _table(rows: Sequence[tuple[str, ...]]) -> str:
    heading, rule, *others = rows
    lines = ["| " + " | ".join(heading) + " |", "|" + "|".join(rule) + "|"]
    lines += ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in others]
    return "\n".join(lines)


def main() -> None:
    """Rewrite the tables of all pages."""
    for name in TABLES:
        page = DOCS / name
        page.write_text(updated_page(name, page.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
