"""Laser features.

Scans of 360 beams cast from every free cell of the real map of building 79 at 5 cm if the data is
available, otherwise of the generated building, in single precision. A subset of columns is a random
selection. ``floor`` copies the scans and writes as many results. Microseconds are processor time on
one thread and wall clock on several.
"""

import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.labelling import map_files
from experiments.page_tables import SideBySide
from pgm_places.features.extraction import extract
from pgm_places.features.laser import LASER_FEATURES
from pgm_places.io.maps.map_server import load_map
from pgm_places.sensing.ray_casting import cast_cells
from pgm_places.sensing.sensor import Sensor
from tests.on_threads import on

SHOWN = (SideBySide(("columns", "number"), "threads: {threads}", "{us a scan} us"),)
"""How long tables are made short and wide."""

MAX_RANGE_M = 80.0

Scans = NDArray[np.float32]


def map_scans(limit: int) -> tuple[str, Scans]:
    """A name and scans from a map's free cells, in their order; at most ``limit``."""
    with tempfile.TemporaryDirectory() as folder:
        title, map_yaml, _ = map_files(Path(folder))
        grid = load_map(map_yaml).grid
    scans = cast_cells(grid, Sensor(max_range_m=MAX_RANGE_M))
    start = max(0, (len(scans) - limit) // 2)
    return title, np.ascontiguousarray(scans[start : start + limit])


def subsets() -> list[tuple[str, list[int] | None]]:
    """Names and columns of the choices that are measured."""
    shuffled = np.random.default_rng(0).permutation(len(LASER_FEATURES)).tolist()
    return [
        ("all", None),
        *((f"random {count}", sorted(shuffled[:count])) for count in (100, 30, 10)),
    ]


def microseconds(
    work: Callable[[], Any], n_scans: int, *, threads: int = 1, repeats: int = 9
) -> float:
    """Median time for each scan, after one call to warm up."""
    clock = time.process_time if threads == 1 else time.perf_counter
    work()
    taken = []
    for _ in range(repeats):
        start = clock()
        work()
        taken.append(clock() - start)
    return statistics.median(taken) / n_scans * 1e6


def subset_rows(title: str, scans: Scans, repeats: int) -> list[dict[str, Any]]:
    """Choices of columns and numbers of threads."""
    floor_out = np.empty((len(scans), len(LASER_FEATURES)), np.float32)

    def floor() -> None:
        floor_out[:, :1] = scans.copy()[:, :1]
        floor_out.fill(0.0)

    base = {"map": title, "scans": len(scans)}
    rows: list[dict[str, Any]] = []
    for name, columns in subsets():
        for threads in (1, 2) if columns is None else (1,):
            width = len(LASER_FEATURES) if columns is None else len(columns)
            out = np.empty((len(scans), width), np.float32)

            def work(
                columns: list[int] | None = columns,
                threads: int = threads,
                out: NDArray[np.float32] = out,
            ) -> None:
                on(threads, extract, scans, max_range_m=MAX_RANGE_M, columns=columns, out=out)

            taken = microseconds(work, len(scans), threads=threads, repeats=repeats)
            rows.append(
                {
                    **base,
                    "columns": name,
                    "number": width,
                    "threads": threads,
                    "us a scan": taken,
                }
            )
    rows.append(
        {
            **base,
            "columns": "floor",
            "number": len(LASER_FEATURES),
            "threads": 1,
            "us a scan": microseconds(floor, len(scans), repeats=repeats),
        }
    )
    return rows


def run(quick: bool) -> list[dict[str, Any]]:
    """The rows of the tables."""
    repeats = 3 if quick else 11
    title, scans = map_scans(2048 if quick else 16384)
    return subset_rows(title, scans, repeats)
