"""Writes the configurations of the shipped models: ``python -m experiments.default_models``.

The maps are listed in code because the floors are many; the TOML files are what ``pgm-places
train`` reads, and what the stored models name as their source.
"""

import csv
import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

HERE = Path(__file__).parent
DATA = "$PGM_PLACES_DATA"

CLASSES = '{CR = "corridor", DW = "doorway", "*" = "room"}'
PLAIN_CLASSES = '{corridor = "corridor", doorway = "doorway", room = "room"}'
FLOOR_CLASSES = (
    '{corridor = "corridor", hall = "hall", lobby = "hall", doorway = "doorway", '
    'stairs = "", entrance = "", "*" = "room"}'
)

STYLES = ("office", "varied", "school", "university", "clinic", "hotel", "hall", "ring")
STYLES += ("open-plan", "cells")
MORE_STYLES = ("home", "mall", "museum", "suite")
"""Only ``default`` has learned from these."""

Table = dict[str, str | int | bool]


def robot_maps() -> Iterator[Table]:
    """The floors that robots mapped, and the one that was redrawn."""
    for folder, name, building, domain in (
        ("freiburg079", "building 79", "Freiburg 79", {}),
        ("freiburg079_drawn", "building 79, redrawn", "Freiburg 79", {"domain": "drawn"}),
        ("freiburg052", "building 52", "Freiburg 52", {}),
    ):
        yield {
            "map": f"{DATA}/{folder}/map.yaml",
            "labels": f"{DATA}/{folder}/labels.png",
            "classes": PLAIN_CLASSES,
            "name": name,
            "building": building,
            **domain,
        }
    for town, building, count in (
        ("freiburg", "Freiburg 79", 3),
        ("saarbrucken", "Saarbruecken", 4),
    ):
        for number in range(1, count + 1):
            yield {
                "map": f"{DATA}/cold_{town}_seq{number}/map.yaml",
                "regions": f"{DATA}/cold_{town}_seq{number}/regions.geojson",
                "classes": CLASSES,
                "name": f"COLD {town} {number}",
                "building": building,
            }


def floors() -> Iterator[Table]:
    """The floors of schools and offices: as drawn, and as a robot would map them."""
    index = Path(os.environ["PGM_PLACES_DATA"]) / "floors" / "index.csv"
    with index.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for number, row in enumerate(rows):
        folder = f"{DATA}/floors/{row['floor']}"
        drawn: Table = {
            "map": f"{folder}/map.yaml",
            "labels": f"{folder}/fine.png",
            "classes": FLOOR_CLASSES,
            "name": row["floor"],
            "building": row["building"],
            "domain": "drawn",
        }
        yield drawn
        name = f"{row['floor']}, simulated"
        yield {**drawn, "name": name, "domain": "simulated", "simulated": number}


def generated(styles: Sequence[str], per_style: int) -> Iterator[Table]:
    """Generated buildings of some styles: furnished as a robot maps them, and drawn and empty."""
    seed = 1
    for style in styles:
        for number in range(per_style):
            drawn: Table = {"generated": seed, "style": style, "halls": "hall"}
            drawn["name"] = f"{style} {seed}"
            if number % 2:
                drawn |= {"furniture": False, "slam_noise": False}
            yield drawn
            seed += 1


ROUNDS = """
[space]
n_rounds = 66
"""
"""Of each of the three lists whose mean it is: together as many trees as 200 kB hold."""

METHODS = """\
[[methods]]
id = "adaboost"
name = "independent"

[[methods]]
name = "relaxation"

[[methods]]
name = "potts"
weight = 0.25
inference = "mean-field"
max_iterations = 20
temperature = 1.6
"""
"""The temperature is from buildings left out: see docs/how_good_is_it.md."""


def configuration(title: str, maps: Iterable[Table], examples: int, space: str = "") -> str:
    """The TOML text of a model; ``space`` are options of the list with spaces."""
    tables = []
    for item in maps:
        lines = [f"{key} = {_value(key, value)}" for key, value in item.items()]
        tables.append("\n".join(["[[train]]", *lines]))
    head = f"""\
# Written by python -m experiments.default_models
title = "{title}"
resolution_m = 0.05

[labels]
names = ["corridor", "room", "doorway", "hall"]

[topology]
min_width_m = 0.3

[classifier]
max_examples_per_map = {examples}
n_folds = 3
{space}"""
    return "\n\n".join([head.rstrip(), *tables, METHODS])


def _value(key: str, value: str | int | bool) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return str(value) if isinstance(value, int) or key == "classes" else f'"{value}"'


def main() -> None:
    """Write both files."""
    made = [{**item, "domain": "generated"} for item in generated(STYLES + MORE_STYLES, 4)]
    everything = [*robot_maps(), *floors(), *made]
    (HERE / "default.toml").write_text(
        configuration("All labelled buildings", everything, 1500, ROUNDS), encoding="utf-8"
    )
    (HERE / "generated.toml").write_text(
        configuration("Generated buildings", generated(STYLES, 4), 1500), encoding="utf-8"
    )


if __name__ == "__main__":
    main()
