"""Laser features.

Scans of 360 beams cast from every free cell of the real map of building 79 at 5 cm if the data is
available, otherwise of the generated building, in single precision. A subset of columns is a random
selection; ``low orders`` are ``f16`` up to order 10 in both directions. ``floor`` copies the scans
and writes as many results. Microseconds are processor time on one thread and wall clock on several.
"""

import statistics
import tempfile
import time
import tracemalloc
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
FAMILIES = (
    ("f2, f8, f28, f32", ("f2", "f2_sd", "f8", "f8_sd", "f28", "f28_sd", "f32")),
    ("f3", ("f3",)),
    ("f14, f33", ("f14", "f33")),
    ("f27, f30, f34", ("f27", "f27_sd", "f30", "f34")),
    ("f25, f26", ("f25", "f26")),
    ("f5, f6, f7, f31", ("f5", "f6", "f7", "f31")),
    ("f9, f29", ("f9", "f9_sd", "f29", "f29_sd")),
    ("f21, f22, f23", ("f21", "f22", "f23")),
    ("f17 to f19_2", ("f17", "f18", "f19", "f17_2", "f18_2", "f19_2")),
    ("f16", ("f16",)),
)

Scans = NDArray[np.float32]


def map_scans(limit: int) -> tuple[str, Scans]:
    """A name and scans from a map's free cells, in their order; at most ``limit``."""
    with tempfile.TemporaryDirectory() as folder:
        title, map_yaml, _ = map_files(Path(folder))
        grid = load_map(map_yaml).grid
    scans = cast_cells(grid, Sensor(max_range_m=MAX_RANGE_M))
    start = max(0, (len(scans) - limit) // 2)
    return title, np.ascontiguousarray(scans[start : start + limit])


def columns_of(families: tuple[str, ...]) -> list[int]:
    """Columns of some families."""
    return [column for column, spec in enumerate(LASER_FEATURES) if spec.id in families]


def subsets() -> list[tuple[str, list[int] | None]]:
    """Names and columns of the choices that are measured."""
    shuffled = np.random.default_rng(0).permutation(len(LASER_FEATURES)).tolist()
    low = [
        column
        for column in columns_of(("f16",))
        if abs(int(LASER_FEATURES[column].parameter or 0)) <= 10
    ]
    return [
        ("all", None),
        *((f"random {count}", sorted(shuffled[:count])) for count in (100, 30, 10)),
        ("low orders", low),
        *((name, columns_of(families)) for name, families in FAMILIES),
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


def peak_bytes(work: Callable[[], Any]) -> int:
    """Memory allocated while working, beyond what was there."""
    tracemalloc.start()
    work()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak


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
                    "extra memory, MB": peak_bytes(work) / 1e6,
                }
            )
    rows.append(
        {
            **base,
            "columns": "floor",
            "number": len(LASER_FEATURES),
            "threads": 1,
            "us a scan": microseconds(floor, len(scans), repeats=repeats),
            "extra memory, MB": None,
        }
    )
    return rows


def scaling_rows(scans: Scans, repeats: int) -> list[dict[str, Any]]:
    """How time grows with scans and with beams; one scan alone is what a robot waits for."""
    rows = []
    for n_scans in (1, 16, 64, 1024, len(scans)):
        some = scans[:n_scans]
        taken = microseconds(
            lambda some=some: on(1, extract, some, max_range_m=MAX_RANGE_M),
            n_scans,
            repeats=repeats if n_scans > 64 else 200,
        )
        rows.append({"scans": n_scans, "beams": 360, "us a scan, all columns": taken})
    for n_beams in (180, 720, 1440):
        some = np.ascontiguousarray(
            np.repeat(scans[:1024], 4, axis=1)[:, :: 1440 // n_beams], np.float32
        )
        taken = microseconds(
            lambda some=some: on(1, extract, some, max_range_m=MAX_RANGE_M),
            len(some),
            repeats=repeats,
        )
        rows.append({"scans": len(some), "beams": n_beams, "us a scan, all columns": taken})
    return rows


def run(quick: bool) -> list[dict[str, Any]]:
    """The rows of the tables."""
    repeats = 3 if quick else 11
    title, scans = map_scans(2048 if quick else 16384)
    return [*subset_rows(title, scans, repeats), *scaling_rows(scans, repeats)]
