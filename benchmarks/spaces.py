"""Spaces: segments, gates, places, and what cells see of them.

The real map of building 79 at 5 cm if the data is available, otherwise the generated building, and
a square of 10,000 m2 filled with generated floors; every second gate is accepted. Processor time on
one thread. Cells are looked up row by row, as when a map is labelled, and in random order.
"""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.labelling import map_files, median_seconds
from benchmarks.tiling import building_tiled
from experiments.page_tables import SideBySide
from pgm_places.io.maps.map_server import load_map
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.spaces.cell_features import CellFeatures
from pgm_places.spaces.gates import gate_candidates, gate_features
from pgm_places.spaces.places import places_between
from pgm_places.spaces.segmentation import Segmentation
from tests.on_threads import on

SHOWN = (
    SideBySide(("step",), "{map}", "{ms} ({ms a million cells})"),
    SideBySide(("order", "columns"), "{map}", "{ms} ({us a cell})"),
)
"""How long tables are made short and wide."""

MOST_CELLS = 200_000
"""Free cells that are looked up at most."""


def division_rows(title: str, grid: OccupancyGrid, repeats: int) -> list[dict[str, Any]]:
    """What it takes to divide a map, step by step."""
    segmentation = Segmentation.of(grid)
    gates = gate_candidates(segmentation)
    places = places_between(gates, np.arange(len(gates)) % 2 == 0)
    steps: dict[str, Callable[[], Any]] = {
        "segments at three scales": lambda: Segmentation.of(grid),
        "candidates for gates": lambda: gate_candidates(segmentation),
        "features of gates": lambda: gate_features(gates),
        "places": lambda: places_between(gates, places.accepted),
        "features of segments and places": lambda: CellFeatures.of(segmentation, places),
    }
    rows = []
    for name, work in steps.items():
        work()
        seconds = median_seconds(work, repeats)[1]
        million = grid.cells.size / 1e6
        rows.append(
            {
                "map": title,
                "cells": grid.cells.size,
                "gates": len(gates),
                "step": name,
                "ms": 1e3 * seconds,
                "ms a million cells": 1e3 * seconds / million,
            }
        )
    return rows


def lookup_rows(title: str, grid: OccupancyGrid, repeats: int) -> list[dict[str, Any]]:
    """What it takes to look up what cells see."""
    gates = gate_candidates(Segmentation.of(grid))
    places = places_between(gates, np.arange(len(gates)) % 2 == 0)
    features = CellFeatures.of(gates.segmentation, places)
    cells = np.argwhere(grid.free)[:MOST_CELLS].astype(np.int32)
    shuffled = np.random.default_rng(0).permutation(cells)
    columns = np.arange(len(features.names))
    rows = []
    for order, those in (("rows", cells), ("random", shuffled)):
        for chosen in (columns, columns[::4]):

            def work(those: Any = those, chosen: Any = chosen) -> None:
                on(1, features.lookup, those, chosen)

            work()
            seconds = median_seconds(work, repeats)[1]
            rows.append(
                {
                    "map": title,
                    "cells looked up": len(those),
                    "order": order,
                    "columns": len(chosen),
                    "ms": 1e3 * seconds,
                    "us a cell": 1e6 * seconds / len(those),
                }
            )
    return rows


def run(quick: bool) -> list[dict[str, Any]]:
    """The rows of both tables."""
    repeats = 3 if quick else 9
    with tempfile.TemporaryDirectory() as name:
        title, map_yaml, _ = map_files(Path(name))
        maps = {title: load_map(map_yaml).grid}
    maps["generated floors"] = building_tiled(500 if quick else 2000).grid
    divided = [row for title, grid in maps.items() for row in division_rows(title, grid, repeats)]
    looked_up = [row for title, grid in maps.items() for row in lookup_rows(title, grid, repeats)]
    return divided + looked_up
