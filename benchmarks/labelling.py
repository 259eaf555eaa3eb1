"""Labelling a complete map: load, cast, features, classify.

The real map of building 79 at 5 cm if the data is available, otherwise the generated building; the
lists are trained on the same map: stumps on laser features, or trees that also see the segments,
gates and places around a cell.
"""

import os
import statistics
import tempfile
import time
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from pgm_places.io.maps.label_image import load_labels, save_labels
from pgm_places.io.maps.map_server import load_map, save_map
from pgm_places.labelers.place_labeler import PlaceLabeler, PlaceMethod
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.persistence.stored import load, save
from pgm_places.simulation import generate_building
from pgm_places.unary.options import SpaceOptions

ROOT = Path(__file__).resolve().parent.parent
NAMES = ("corridor", "room", "doorway")


def map_files(folder: Path) -> tuple[str, Path, Path]:
    """A name, a map and its labels: the real building, or the generated one written aside."""
    base = Path(os.environ.get("PGM_PLACES_DATA") or ROOT.parent / "shared" / "data")
    real = base / "freiburg079"
    if real.is_dir():
        return "building 79", real / "map.yaml", real / "labels.png"
    building = generate_building()
    save_map(building.grid, folder / "map")
    save_labels(folder / "labels.png", building.labels, building.label_names)
    return "generated building", folder / "map.yaml", folder / "labels.png"


def median_seconds(work: Any, repeats: int) -> tuple[float, float]:
    """Median wall and processor seconds."""
    wall, processor = [], []
    for _ in range(repeats):
        start, start_processor = time.perf_counter(), time.process_time()
        work()
        wall.append(time.perf_counter() - start)
        processor.append(time.process_time() - start_processor)
    return statistics.median(wall), statistics.median(processor)


def run(quick: bool) -> list[dict[str, Any]]:
    """The rows of the table."""
    repeats = 3 if quick else 9
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        title, map_yaml, label_path = map_files(folder)
        grid = load_map(map_yaml).grid
        labels = load_labels(label_path, NAMES, grid=grid)
        methods = {
            "stumps, laser": PlaceMethod("independent", "laser"),
            "trees, laser and spaces": PlaceMethod("independent", "space"),
        }
        labeler = PlaceLabeler(NAMES, methods, space=SpaceOptions())
        labeler.fit([LabelledMap(grid, labels)])
        labeler = load(save(labeler, folder / "model"))

        for method, threads in product(methods, (1, 2)):

            def label(method: str = method, threads: int = threads) -> None:
                loaded = load_map(map_yaml).grid
                labeler.label(loaded, method=method, n_threads=threads)

            label()
            wall, processor = median_seconds(label, repeats)
            rows.append(
                {
                    "map": title,
                    "list": method,
                    "free cells": int(np.count_nonzero(grid.free)),
                    "threads": threads,
                    "wall s": wall,
                    "processor s": processor,
                    "cells a second": grid.free.sum() / wall,
                }
            )
    return rows
