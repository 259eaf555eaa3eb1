"""From a stroke of paint to new labels: teaching on top of the shipped model.

The map is the real building 79 at 5 cm if the data is available, otherwise the generated building.
Strokes of 0.6 m are painted one after the other, each in turn as corridor and as room; after each
one the model learns from all of them and labels the whole map again. "clamp" labels without
learning. Wall-clock seconds on all cores, after a first labelling.
"""

import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.labelling import map_files
from pgm_places.io.maps.map_server import load_map
from pgm_places.teaching.paint import Paint
from pgm_places.teaching.teacher import Teacher
from pgm_places.trained import trained_labeler

HALF_WIDTH = 6


def seconds(work: Callable[[], object]) -> float:
    """Wall-clock seconds of one call."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def run(quick: bool) -> list[dict[str, Any]]:
    """The row of the table."""
    with tempfile.TemporaryDirectory() as name:
        title, map_yaml, _ = map_files(Path(name))
        grid = load_map(map_yaml).grid
    teacher = Teacher(grid, trained_labeler())
    labels = np.full(grid.shape, -1, np.int16)
    first = seconds(lambda: teacher.label(Paint(labels, teacher.classes)))
    free = np.argwhere(grid.free)
    taught, clamped = [], []
    for number, (row, column) in enumerate(free[:: len(free) // (4 if quick else 10)][1:]):
        stroke = (
            slice(max(row - HALF_WIDTH, 0), row + HALF_WIDTH),
            slice(max(column - HALF_WIDTH, 0), column + HALF_WIDTH),
        )
        labels[stroke] = number % 2
        paint = Paint(labels.copy(), teacher.classes)
        taught.append(seconds(lambda paint=paint: teacher.teach(paint)))  # type: ignore[misc]
        clamped.append(seconds(lambda paint=paint: teacher.label(paint)))  # type: ignore[misc]
    return [
        {
            "map": title,
            "free cells": len(free),
            "strokes": len(taught),
            "first labelling s": first,
            "teach s": statistics.median(taught[1:]),
            "teach, slowest s": max(taught[1:]),
            "clamp s": statistics.median(clamped[1:]),
        }
    ]
