"""The shipped tracking model and its tables: ``python -m experiments.tracking_model``.

``PGM_PLACES_DATA=DATA python -m experiments.tracking_model --kept FOLDER`` simulates a drive in
every labelled map, keeps what it shows in the folder, writes the model to
pgm_places/trained/tracking and the tables in docs/results.md; with ``--model`` only the model,
or only the named tables. ``--networks FOLDER``, that of ``python -m
experiments.floor_network``, has networks that were not trained on a town, for a table of their own.
"""

import argparse
import os
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

from experiments.array_cache import ArrayCache
from experiments.floor_network.floors import all_floors, fold_of
from experiments.floor_network.held_out import networks
from experiments.known_maps import known_maps
from experiments.page_tables import show_table, with_write_docs
from experiments.tracking_model.drives import BEAMS, EVERY_M, LENGTH_M, simulated_drives
from experiments.tracking_model.learning import OPTIONS, Table, learned
from experiments.tracking_model.unseen import (
    SHARE,
    TOWNS,
    floor_answers,
    floors_table,
    lasers_table,
    real_table,
)
from pgm_places.experiment.runs import versions
from pgm_places.io.input_file import sha256_of
from pgm_places.options import plain_values
from pgm_places.persistence.stored import save
from pgm_places.trained import trained_floor
from pgm_places.unary.floor_model import FloorModel

HERE = Path(__file__).resolve().parent
MODEL = HERE.parents[1] / "pgm_places" / "trained" / "tracking"
PARTS = ("floors", "lasers", "real", "real_networks")
TABLES = tuple(f"tracking_{part}" for part in PARTS)


def write_model(table: Table, data: Path) -> None:
    """Learn from all drives and write the shipped model."""
    folders = [data / "floors", *sorted(data.glob("freiburg0*")), *sorted(data.glob("cold_*"))]
    files = [
        path
        for folder in folders
        for path in sorted(folder.rglob("*"))
        if path.suffix in (".yaml", ".png", ".geojson") and "partial" not in path.parts[-2]
    ]
    record = {
        "config": {
            "train": [
                {
                    "drive": item.name,
                    "building": item.building,
                    "laser": plain_values(item.laser),
                    "steps": len(item.labels),
                }
                for item in table.drives
            ],
            "classifier": OPTIONS,
            "length_m": LENGTH_M,
            "every_m": EVERY_M,
            "beams": plain_values(BEAMS),
        },
        "inputs": {
            f"$PGM_PLACES_DATA/{path.relative_to(data).as_posix()}": sha256_of(path)
            for path in files
        },
        "versions": dict(versions()),
        "warnings": [],
    }
    labeler = learned(table).labeler().with_options(floor=floor_of_drives())
    save(labeler, MODEL, record=record)
    print(f"wrote {MODEL}")


def floor_of_drives() -> FloorModel:
    """The shipped networks as they look at what a robot has mapped so far, each from one side."""
    return replace(trained_floor(), views_per_network=1, share=SHARE, doorway_share=SHARE)


def networks_of_towns(data: Path, folder: Path) -> dict[str, FloorModel]:
    """For each of the campaign's buildings, the network that was trained without it."""
    fold, items = fold_of(list(all_floors(data))), networks(folder)
    return {name: FloorModel(items[fold[name]], views_per_network=1) for name in TOWNS.values()}


def tables(
    table: Table, data: Path, store: ArrayCache, folder: Path | None
) -> Mapping[str, Callable[[], str]]:
    """The tables by their names; every figure is from buildings left out."""
    found = cache(lambda: list(floor_answers(table)))
    written = {
        "floors": lambda: floors_table(found()),
        "lasers": lambda: lasers_table(found()),
        "real": lambda: real_table(table, data, store),
    }
    if folder is None:
        return written
    known = networks_of_towns(data, folder)
    return written | {"real_networks": lambda: real_table(table, data, store, networks=known)}


def parser() -> argparse.ArgumentParser:
    """What the command takes."""
    result = with_write_docs(argparse.ArgumentParser(prog="python -m experiments.tracking_model"))
    result.add_argument("--kept", type=Path, help="folder for cached features of drives")
    result.add_argument("--networks", type=Path, help="folder of experiments.floor_network")
    result.add_argument("--model", action="store_true", help="only the model")
    result.add_argument(
        "parts", nargs="*", choices=[*PARTS, []], metavar="table", help=", ".join(PARTS)
    )
    return result


def main() -> None:
    """Simulate the drives and write what is asked for."""
    chosen = parser().parse_args()
    data = os.environ.get("PGM_PLACES_DATA")
    if not data:
        sys.exit("set PGM_PLACES_DATA to the folder that holds the real maps")
    if "real_networks" in chosen.parts and chosen.networks is None:
        sys.exit(
            "the table real_networks needs --networks FOLDER, that of experiments.floor_network"
        )
    if chosen.kept is not None:
        chosen.kept.mkdir(parents=True, exist_ok=True)
    store = ArrayCache(chosen.kept)
    maps = known_maps(Path(data), store)
    table = Table.of(simulated_drives(maps, store))
    if chosen.model or not chosen.parts:
        write_model(table, Path(data))
    written = tables(table, Path(data), store, chosen.networks)
    for name in chosen.parts or (() if chosen.model else written):
        text = written[name]()
        show_table(f"tracking_{name}", text, write=chosen.write_docs)


if __name__ == "__main__":
    main()
