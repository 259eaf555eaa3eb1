"""Places of a labelled map: regions, corrections, outlines, connections.

The labels are those of the real building 79 at 5 cm if the data is available, otherwise of the
generated building, with 2 % of the cells given a random label so that there is something to
correct. The large map is the generated building, repeated many times. SciPy's ``label``, called
once per class, is listed for comparison: it finds the connected components only. Processor seconds
on one thread; memory is the peak of the process.
"""

import resource
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from benchmarks.labelling import NAMES, map_files
from pgm_places.datasets import generate_building
from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.map_server import load_map
from pgm_places.maps.components import connected_components
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.topology.corrections import correct_regions
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.outlines import outlines


def seconds(work: Callable[[], object], repeats: int) -> float:
    """Median processor seconds after a call that warms up."""
    if repeats > 1:
        work()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return statistics.median(times)


def noisy(labels: NDArray[np.int16], share: float) -> NDArray[np.int16]:
    """Labels with a share of the cells labelled at random."""
    generator = np.random.default_rng(5)
    hit = (generator.random(labels.shape, np.float32) < share) & (labels >= 0)
    changed = labels.copy()
    changed[hit] = generator.integers(0, len(NAMES), int(hit.sum()))
    return changed


def rows_of(title: str, grid: OccupancyGrid, labels: NDArray[np.int16], n: int) -> dict[str, Any]:
    """One map's row."""
    pieces = connected_components(labels)
    clean, log = correct_regions(labels, NAMES, grid.resolution_m)
    found = topological_map(grid, labels, NAMES)
    eight = np.ones((3, 3))
    regions = connected_components(clean)
    return {
        "map": title,
        "cells": labels.size,
        "pieces before": pieces.count,
        "corrections": len(log),
        "places": len(found.regions),
        "SciPy label s": seconds(
            lambda: [ndimage.label(labels == k, eight) for k in range(len(NAMES))], n
        ),
        "components s": seconds(lambda: connected_components(labels), n),
        "corrections s": seconds(lambda: correct_regions(labels, NAMES, grid.resolution_m), n),
        "outlines s": seconds(lambda: outlines(regions.piece, regions.count), n),
        "all s": seconds(lambda: topological_map(grid, labels, NAMES), n),
        "memory GB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6,
    }


def run(quick: bool) -> list[dict[str, Any]]:
    """The rows of the table."""
    rows = []
    with tempfile.TemporaryDirectory() as name:
        title, map_yaml, label_path = map_files(Path(name))
        grid = load_map(map_yaml).grid
        labels = load_labels(label_path, NAMES, grid=grid)
    rows.append(rows_of(title, grid, noisy(labels, 0.02), 3 if quick else 9))
    building = generate_building()
    side = 1000 if quick else 10000
    height, width = building.labels.shape
    times = (-(-side // height), -(-side // width))
    order = [building.label_names.index(label) for label in NAMES]
    table = np.array([*np.argsort(order), -1], np.int16)
    labels = np.ascontiguousarray(np.tile(table[building.labels], times)[:side, :side])
    cells = np.tile(building.grid.cells, times)[:side, :side]
    grid = OccupancyGrid(cells, building.grid.resolution_m)
    rows.append(rows_of("generated, tiled", grid, noisy(labels, 0.001), 1))
    return rows
