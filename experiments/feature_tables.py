"""The tables of features in docs/features.md and docs/gates.md, from the code's definitions."""

import re
from collections.abc import Callable, Sequence
from itertools import groupby

from experiments.page_tables import write_table
from pgm_places.features.laser import LASER_FEATURES, FeatureSpec
from pgm_places.spaces.space_spec import (
    CELL_FEATURES,
    GATE_FEATURES,
    PLACE_EXTRA_FEATURES,
    SEGMENT_FEATURES,
    SpaceSpec,
)

SPACES: dict[str, tuple[SpaceSpec, ...]] = {
    "segments": SEGMENT_FEATURES,
    "cells": CELL_FEATURES,
    "gates": GATE_FEATURES,
    "places": PLACE_EXTRA_FEATURES,
}
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
    """A row per definition; columns that share one are one row, and so are copies of others.

    Columns of a profile share a definition. Copies are named after what they copy: ``small_area``
    is the "area of the side of the smaller radius".
    """
    rows: list[tuple[str, ...]] = [("columns", "name", "definition"), ("---",) * 3]
    for (name, definition), group in groupby(enumerate(specs), key=lambda item: _row(item[1])):
        members = list(group)
        (first, spec), (last, end) = members[0], members[-1]
        if name.endswith("_X"):
            copied = [item.id.removeprefix(name[:-1]) for _, item in members]
            definition = f"{definition}, for X = {', '.join(copied)}"
        elif first != last:
            name = f"{spec.id} to {end.id}"
        else:
            name = spec.id
        rows.append((_columns(first, last), name, definition))
    return _table(rows)


def _row(spec: SpaceSpec) -> tuple[str, str]:
    """The name and definition of the row of a feature; copies have a name that ends in ``_X``."""
    copy = re.fullmatch(r"(\w+)( of (?:the side|its largest neighbour).*)", spec.definition)
    if copy and spec.id.endswith(f"_{copy[1]}"):
        return f"{spec.id.removesuffix(copy[1])}X", f"X{copy[2]}"
    return "", spec.definition


TABLES: dict[str, Callable[[], str]] = {
    "laser": laser_table,
    **{
        name: lambda specs=specs: spaces_table(specs)  # type: ignore[misc]
        for name, specs in SPACES.items()
    },
}
"""What writes each table, by the name in its mark."""


def _columns(first: int, last: int) -> str:
    return str(first) if first == last else f"{first}–{last}"


def _parameters(specs: Sequence[FeatureSpec]) -> str:
    """The parameters, a long run of integers by its ends."""
    values = [spec.parameter for spec in specs if spec.parameter is not None]
    are_integers = all(isinstance(value, int) for value in values)
    if are_integers and len(values) > LONG_RUN and values[-1] - values[0] == len(values) - 1:
        return f"{values[0]}, {values[0] + 1}, ... {values[-1]}"
    return ", ".join(str(value) for value in values)


def _table(rows: Sequence[tuple[str, ...]]) -> str:
    heading, rule, *others = rows
    lines = ["| " + " | ".join(heading) + " |", "|" + "|".join(rule) + "|"]
    lines += ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in others]
    return "\n".join(lines)


def main() -> None:
    """Rewrite all tables."""
    for name, table in TABLES.items():
        print(write_table(name, table()))


if __name__ == "__main__":
    main()
