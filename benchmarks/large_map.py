"""Labelling huge maps: memory and time against free cells.

Squares filled with generated floors at 5 cm, written as an image and labelled from end to end in a
fresh process: load, cast, features, classify, infer, write the label image. The lists are trained
on one floor; ``relaxation`` and ``independent`` start from laser features (AdaBoost alone),
``relaxation, context`` from the list that also sees its surroundings. Peak memory is that of the
whole process, including Python and its libraries.
"""

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.memory import peak_bytes
from benchmarks.tiling import building_tiled
from pgm_places.io.maps.label_image import save_labels
from pgm_places.io.maps.map_server import load_map, save_map
from pgm_places.labelers.place_labeler import PlaceLabeler, PlaceMethod
from pgm_places.labelling.label import label_map
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.persistence.stored import load, save
from pgm_places.simulation import generate_building

METHODS = {
    "independent": PlaceMethod("independent", "laser"),
    "relaxation": PlaceMethod("relaxation", "laser"),
    "relaxation, context": PlaceMethod("relaxation", "context"),
}
CONTEXT_M = (0.3, 0.75, 1.5, 3.0)
MEASURE = "--measure"


def measure(map_yaml: Path, model: Path, method: str, out: Path) -> dict[str, Any]:
    """Label a map in this process; what it took."""
    start, start_processor = time.perf_counter(), time.process_time()
    labeler = load(model)
    grid = load_map(map_yaml).grid
    n_free = int(np.count_nonzero(grid.free))
    result = label_map(labeler, grid, method=method)
    save_labels(out / "labels.png", result.labels, result.label_names)
    processor = time.process_time() - start_processor
    return {
        "map": f"{grid.shape[0]:,} x {grid.shape[1]:,}",
        "free cells": n_free,
        "method": method,
        "wall s": time.perf_counter() - start,
        "processor s": processor,
        "processor us a free cell": 1e6 * processor / n_free,
        "peak GB": peak_bytes() / 1e9,
    }


def save_model(folder: Path) -> Path:
    """A model with all methods, learned on one floor."""
    building = generate_building()
    labeler = PlaceLabeler(building.label_names, METHODS, context_m=CONTEXT_M, space=None)
    labeler.fit([LabelledMap(building.grid, building.labels)])
    return save(labeler, folder / "model")


def rows_of(methods_by_side: Mapping[int, Sequence[str]]) -> list[dict[str, Any]]:
    """A row for each map and method."""
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        model = save_model(folder)
        for side, methods in methods_by_side.items():
            map_yaml = save_map(building_tiled(side).grid, folder / f"map_{side}")
            for method in methods:
                command = [sys.executable, "-m", "benchmarks.large_map", MEASURE]
                command += [str(map_yaml), str(model), method, name]
                found = subprocess.run(command, check=True, capture_output=True, text=True)
                rows.append(json.loads(found.stdout))
    return rows


def run(quick: bool) -> list[dict[str, Any]]:
    """The rows of the table."""
    if quick:
        return rows_of({500: list(METHODS), 1000: list(METHODS)})
    return rows_of({2000: list(METHODS), 5000: ["relaxation"], 10000: ["relaxation"]})


def main() -> None:
    """Print the table, or measure one map for it."""
    from benchmarks.__main__ import markdown_tables

    if MEASURE in sys.argv:
        map_yaml, model, method, out = sys.argv[sys.argv.index(MEASURE) + 1 :]
        print(json.dumps(measure(Path(map_yaml), Path(model), method, Path(out))))
    else:
        print(markdown_tables(run("--quick" in sys.argv)))


if __name__ == "__main__":
    main()
