"""Relaxation labelling, 100 iterations.

Building 79 at 5 cm if the data is available, otherwise the generated building, and the same floor
tiled into a larger map; 3 labels and walls, with a third of the labels wrong at the start. All
methods perform the same 100 updates in single precision. ``floor: planes`` reads and writes the
raster's planes of beliefs once per iteration, a limit for updates of complete planes; ``floor:
nodes`` reads and writes only the beliefs of the free cells. Seconds are processor time on one
thread and wall clock on several; ``difference`` is the largest difference of any belief from the
first method.
"""

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
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.problem import LabelingProblem
from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.map_server import load_map
from pgm_places.kernels.threads import thread_limit
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.models.relaxation import Relaxation
from pgm_places.solvers.grid_relaxation import relax_grid
from pgm_places.solvers.relaxation import relax_graph, starting_beliefs

ITERATIONS = 100
WRONG = 0.3

Planes = NDArray[np.float32]


class Case:
    """A map with noisy beliefs, and the learned coefficients."""

    def __init__(self, grid: OccupancyGrid, labels: NDArray[np.int16], tiles: int) -> None:
        rng = np.random.default_rng(0)
        self.free = np.tile(grid.free, (tiles, tiles))
        self.walls = np.tile(grid.occupied, (tiles, tiles))
        self.cells = np.argwhere(self.free).astype(np.int32)
        truth = np.tile(labels, (tiles, tiles))[self.free].astype(np.int64)
        observed = np.where(rng.random(len(truth)) < WRONG, rng.integers(0, 3, len(truth)), truth)
        z = np.full((len(truth), 3), 0.125)
        z[np.arange(len(truth)), np.maximum(observed, 0)] = 0.75
        self.unary = np.log(z)
        graph = LabelGraph.from_grid(grid)
        problem = LabelingProblem(graph, NAMES, unary=np.zeros((graph.n_nodes, 3)))
        known = labels[grid.free].astype(np.int64)
        fitted = Relaxation().fit([problem], [known])
        assert fitted.compatibility is not None
        self.r = fitted.compatibility

    def compiled(self, threads: int) -> NDArray[np.float64]:
        """Ours."""
        with thread_limit(threads):
            return relax_grid(
                self.unary,
                self.cells,
                self.free.shape,
                self.r,
                walls=self.walls,
                max_iterations=ITERATIONS,
                tolerance=0,
            ).beliefs

    def planes(self) -> Planes:
        """(4, H + 2, W + 2): three labels and the wall, with a border of nothing."""
        height, width = self.free.shape
        planes = np.zeros((4, height + 2, width + 2), np.float32)
        inner = planes[:, 1:-1, 1:-1]
        inner[:3, self.free] = starting_beliefs(self.unary).T
        inner[3, self.walls] = 1
        return planes

    def by_planes(self, neighbour_sum: Callable[[Planes], Planes]) -> NDArray[np.float64]:
        """The update as NumPy arithmetic on planes."""
        planes = self.planes()
        inner = planes[:3, 1:-1, 1:-1]
        table = (self.r[0, :3] / 8).astype(np.float32)
        for _ in range(ITERATIONS):
            grown = np.tensordot(table, neighbour_sum(planes), axes=1)
            grown += 1
            np.maximum(grown, 0, out=grown)
            grown *= inner
            total = grown.sum(axis=0)
            total[total < 1e-12] = 1
            np.divide(grown, total, out=inner)
        return inner[:, self.free].T.astype(np.float64)

    def on_graph(self) -> NDArray[np.float64]:
        """Our kernel for any graph, on the same cells; it knows no walls."""
        graph = LabelGraph.from_grid(self.free)
        near = graph.neighbours
        with thread_limit(1):
            return relax_graph(
                self.unary,
                near.start,
                near.node,
                self.r[:, :3, :3],
                weight=np.full(len(near.node), 1 / 8),
                max_iterations=ITERATIONS,
                tolerance=0,
            ).beliefs


def slices(planes: Planes) -> Planes:
    """Sums over the 8 neighbours by adding shifted views."""
    rows, columns = planes.shape[1] - 2, planes.shape[2] - 2
    total = np.zeros((len(planes), rows, columns), np.float32)
    for dy in range(3):
        for dx in range(3):
            if (dy, dx) != (1, 1):
                total += planes[:, dy : dy + rows, dx : dx + columns]
    return total


def convolved(planes: Planes) -> Planes:
    """Sums over the 8 neighbours by scipy's convolution."""
    kernel = np.ones((1, 3, 3), np.float32)
    kernel[0, 1, 1] = 0
    found: Planes = ndimage.correlate(planes, kernel, mode="constant")[:, 1:-1, 1:-1]
    return found


def copied(shape: tuple[int, ...]) -> None:
    """Read one block of single-precision numbers and write another, once per iteration."""
    old, new = np.ones(shape, np.float32), np.ones(shape, np.float32)
    for _ in range(ITERATIONS):
        np.copyto(new, old)
        old, new = new, old


def seconds(work: Callable[[], Any], clock: Callable[[], float], repeats: int) -> float:
    """Median duration of ``work``."""
    taken = []
    for _ in range(repeats):
        start = clock()
        work()
        taken.append(clock() - start)
    return statistics.median(taken)


def run(quick: bool) -> list[dict[str, Any]]:
    """The rows of the table."""
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        title, map_yaml, label_path = map_files(Path(folder))
        grid = load_map(map_yaml).grid
        labels = load_labels(label_path, NAMES, grid=grid)
    for tiles in (1, 2) if quick else (1, 6):
        case = Case(grid, labels, tiles)
        name = title if tiles == 1 else f"{title}, {tiles} x {tiles}"
        rows += measured(name, case, quick=quick, peers=tiles == 1)
    return rows


def measured(name: str, case: Case, *, quick: bool, peers: bool) -> list[dict[str, Any]]:
    """All methods on one map."""
    raster = (3, *case.free.shape)
    methods: list[tuple[str, int, Callable[[], Any]]] = [
        ("ours, raster kernel", 1, lambda: case.compiled(1)),
        ("ours, raster kernel", 2, lambda: case.compiled(2)),
    ]
    if peers:
        methods += [
            ("ours, kernel for any graph (no walls)", 1, case.on_graph),
            ("NumPy slices", 1, lambda: case.by_planes(slices)),
            ("scipy.ndimage", 1, lambda: case.by_planes(convolved)),
        ]
    methods += [
        ("floor: planes", 1, lambda: copied(raster)),
        ("floor: nodes", 1, lambda: copied((3, len(case.cells)))),
    ]
    expected = case.compiled(1)
    rows, floor = [], seconds(lambda: copied(raster), time.process_time, 3)
    for method, threads, work in methods:
        got = work()
        clock = time.process_time if threads == 1 else time.perf_counter
        taken = seconds(work, clock, 3 if quick or not peers else 7)
        exact = got is not None and "no walls" not in method
        rows.append(
            {
                "map": name,
                "cells": len(case.cells),
                "method": method,
                "threads": threads,
                "seconds": taken,
                "ns a cell and iteration": taken / ITERATIONS / len(case.cells) * 1e9,
                "times the floor of planes": taken / floor,
                "difference": float(np.abs(got - expected).max()) if exact else None,
            }
        )
    return rows
