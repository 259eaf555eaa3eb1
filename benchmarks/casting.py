"""Ray casting.

360 beams from every free cell, up to 30 m, of the drawn and the real map of building 79 at 5 cm if
the data is available, otherwise of the generated building. ``sweep`` is what the package does,
writing rows (cell, beam) to a buffer that is reused as in streaming; ``sweep, one row`` is the same
work written over a single row, without memory traffic; ``cast_cells`` is the public function, which
returns new memory. ``DDA`` follows each ray from cell to cell, timed on a sample of the cells;
``floor`` writes as many bytes. Millions of rays per second refer to processor time on one thread
and to wall clock on several; errors are in cells, relative to the DDA, over the sample.
"""

import os
import statistics
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.page_tables import SideBySide
from pgm_places.io.maps.map_server import load_map
from pgm_places.kernels.threads import run_tasks, thread_limit
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.sensing._cell_caster import Box, CellCaster, Cells, NodeNumbers, blocked_window
from pgm_places.sensing.ray_casting import cast_cells
from pgm_places.sensing.sensor import Sensor
from pgm_places.simulation import generate_building

SHOWN = (SideBySide(("method",), "{map}, threads: {threads}", "{Mrays/s} ({times DDA})"),)
"""How long tables are made short and wide."""

ROOT = Path(__file__).resolve().parent.parent
SAMPLE = 16  # every so manieth cell is enough for the DDA

Work = Callable[[], Any]


def maps() -> Iterator[tuple[str, OccupancyGrid]]:
    """Names and maps."""
    base = Path(os.environ.get("PGM_PLACES_DATA") or ROOT.parent / "shared" / "data")
    real = {"building 79, drawn": "freiburg079_drawn", "building 79": "freiburg079"}
    for title, folder in real.items():
        if (base / folder).is_dir():
            yield title, load_map(base / folder / "map.yaml").grid
    if not (base / "freiburg079").is_dir():
        yield "generated building", generate_building().grid


class OneBox:
    """All cells of a map cast as one block, into memory that is reused."""

    def __init__(self, grid: OccupancyGrid, sensor: Sensor, n_threads: int) -> None:
        self._box = Box(0, grid.shape[0], 0, grid.shape[1])
        with thread_limit(n_threads):
            self._caster = CellCaster(grid, sensor)
        nodes, self.rows, self.columns = NodeNumbers(grid.free).of(self._box)
        self._nodes = nodes.astype(np.int32)
        self.out = np.zeros((len(nodes), sensor.n_beams), np.float32)

    def sweep(self) -> None:
        """Cast to the rows of ``out``."""
        self._caster.cast(self._box, self.rows, self.columns, self._nodes, self.out)

    def sweep_over_one_row(self) -> None:
        """Do the same work, but write every scan over the first row."""
        first = np.zeros_like(self._nodes)
        self._caster.cast(self._box, self.rows, self.columns, first, self.out[:1])


class RayByRay:
    """The same scans for a sample of the cells, each ray followed from border to border."""

    def __init__(self, grid: OccupancyGrid, sensor: Sensor, every: int) -> None:
        self._grid, self._sensor = grid, sensor
        self._box = Box(0, grid.shape[0], 0, grid.shape[1])
        self._blocked = blocked_window(grid, self._box, sensor.stop_at_unknown)
        _, rows, columns = NodeNumbers(grid.free).of(self._box)
        self._rows, self._columns = rows[::every] + 1, columns[::every] + 1
        self._nodes = np.arange(len(self._rows), dtype=np.int32)
        self.out = np.zeros((len(self._rows), sensor.n_beams), np.float32)

    def follow(self, n_threads: int) -> None:
        """Cast to the rows of ``out``."""
        with thread_limit(n_threads):
            caster = CellCaster(self._grid, self._sensor)
        caster.follow(self._blocked, Cells(self._rows, self._columns, self._nodes), self.out)


def seconds(work: Work, threads: int, repeats: int) -> float:
    """Median time after one call to warm up."""
    clock = time.process_time if threads == 1 else time.perf_counter
    work()
    taken = []
    for _ in range(repeats):
        start = clock()
        work()
        taken.append(clock() - start)
    return statistics.median(taken)


def fill(out: NDArray[np.float32], n_threads: int) -> None:
    """Write all of ``out``."""
    parts = np.array_split(out, max(n_threads, 1))
    run_tasks(lambda task: parts[task].fill(1.0), len(parts), n_threads=n_threads)


def cast_on(n_threads: int, grid: OccupancyGrid, sensor: Sensor) -> NDArray[np.float32]:
    """The scans of all free cells, cast by ``n_threads`` threads."""
    with thread_limit(n_threads):
        return cast_cells(grid, sensor)


def method_rows(title: str, grid: OccupancyGrid, repeats: int) -> list[dict[str, Any]]:
    """A row per method."""
    sensor = Sensor()
    slow = RayByRay(grid, sensor, SAMPLE)
    slow.follow(2)
    exact = slow.out / grid.resolution_m
    rows: list[dict[str, Any]] = []
    for count in (1, 2):
        box = OneBox(grid, sensor, count)
        n_rays, n_slow = box.out.size, slow.out.size
        works: dict[str, tuple[Work, int]] = {
            "DDA": (partial(slow.follow, count), n_slow),
            "sweep, one row": (box.sweep_over_one_row, n_rays),
            "sweep": (box.sweep, n_rays),
            "cast_cells": (partial(cast_on, count, grid, sensor), n_rays),
        }
        taken = {name: seconds(work, count, repeats) / n for name, (work, n) in works.items()}
        swept = box.out[::SAMPLE] / grid.resolution_m
        floor = seconds(partial(fill, box.out, count), count, repeats) / n_rays
        off = {"DDA": np.zeros(1), "sweep": np.abs(swept - exact)}
        for name, each in [*taken.items(), ("floor", floor)]:
            rows.append(
                {
                    "map": title,
                    "cells": len(box.rows),
                    "method": name,
                    "threads": count,
                    "Mrays/s": 1e-6 / each,
                    "times DDA": taken["DDA"] / each,
                    "of the floor": floor / each,
                    "mean error": float(off[name].mean()) if name in off else None,
                    "largest error": float(off[name].max()) if name in off else None,
                }
            )
    return rows


def run(quick: bool) -> list[dict[str, Any]]:
    """The rows of the table."""
    repeats = 3 if quick else 5
    return [row for title, grid in maps() for row in method_rows(title, grid, repeats)]
