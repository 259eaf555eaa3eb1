"""Boosting decision stumps: generalised AdaBoost, 100 rounds.

One class against all others, on the 321 features of the cells of building 79 at 5 cm if the data is
available, otherwise of the generated building. Seconds are processor time on one thread and wall
clock on several. Methods marked ``*`` were run for fewer rounds and their time per round was
extrapolated. ``same stumps`` counts the rounds, among the rounds of the exhaustive sweep,
in which the stump is identical. LightGBM's stumps use 255 bins and a logistic loss: a different
model, listed for its speed. ``bytes`` is the memory per example and feature in addition to the
float32 matrix.
"""

import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import boosting_peers as peers
from benchmarks.labelling import NAMES, map_files
from experiments.page_tables import SideBySide
from pgm_places.features.extraction import extract
from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.map_server import load_map
from pgm_places.kernels.threads import thread_limit
from pgm_places.models.boosting_rounds import boost
from pgm_places.models.sorted_features import prepare
from pgm_places.sensing.ray_casting import iter_cast
from pgm_places.sensing.sensor import Sensor

Row = dict[str, Any]
Matrix = NDArray[np.float32]

SHOWN = (SideBySide(("method", "threads"), "{class}", "{all s} s ({scikit-learn's time / own})"),)
"""How long tables are made short and wide."""


def training_data(n_rows: int) -> tuple[str, Matrix, NDArray[np.int64]]:
    """A title, the features of labelled cells, and their labels."""
    with tempfile.TemporaryDirectory() as name:
        title, map_yaml, label_path = map_files(Path(name))
        grid = load_map(map_yaml).grid
        labels = load_labels(label_path, NAMES, grid=grid)
    mask = grid.free & (labels >= 0)
    sensor = Sensor()
    X = np.empty((int(mask.sum()), 321), np.float32)
    for block in iter_cast(grid, sensor, mask=mask):
        X[block.nodes] = extract(block.ranges, max_range_m=sensor.max_range_m)
    y = labels[mask].astype(np.int64)
    if len(X) < n_rows:  # the generated building is smaller: cells once more, slightly moved
        rng = np.random.default_rng(0)
        more = rng.integers(0, len(X), n_rows - len(X))
        noise = 1 + 0.01 * rng.normal(size=(len(more), 321)).astype(np.float32)
        X, y = np.concatenate([X, X[more] * noise]), np.concatenate([y, y[more]])
    picked = np.linspace(0, len(X) - 1, n_rows).astype(np.int64)
    return title, X[picked], y[picked]


def timed(work: Callable[[], Any], repeats: int, *, wall: bool = False) -> tuple[float, Any]:
    """The median seconds of some runs, and the last result."""
    clock = time.perf_counter if wall else time.process_time
    seconds = []
    for _ in range(repeats):
        start = clock()
        result = work()
        seconds.append(clock() - start)
    return statistics.median(seconds), result


def binary(X: Matrix, y: NDArray[np.int64], k: int, n_rounds: int, repeats: int) -> list[Row]:
    """All methods on one binary problem."""
    own = y == k
    wanted = peers.sweep(X, own, min(n_rounds, 10))
    rows = [ours(X, own, n_rounds, repeats, threads, wanted) for threads in (1, 2)]
    rows.append(row("scikit-learn *", 1, None, peers.scikit_learn(X, own) * n_rounds))
    if find_spec("lightgbm"):
        rows.append(row("LightGBM stumps", 1, *peers.lightgbm_stumps(X, own, n_rounds)))
    reference = next(item["all s"] for item in rows if item["method"].startswith("scikit"))
    return [
        {
            "class": NAMES[k],
            **item,
            "scikit-learn's time / own": item["all s"] and reference / item["all s"],
        }
        for item in rows
    ]


def row(
    name: str, threads: int | None, prepare_s: float | None, rounds_s: float | None, **more: Any
) -> Row:
    """One method's line."""
    return {
        "method": name,
        "threads": threads,
        "preparation s": prepare_s,
        "rounds s": rounds_s,
        "all s": None if rounds_s is None else rounds_s + (prepare_s or 0.0),
        "same stumps": more.get("same"),
        "bytes": more.get("bytes_per_value"),
    }


def ours(
    X: Matrix, own: Any, n_rounds: int, repeats: int, n_threads: int, wanted: list[peers.Stump]
) -> Row:
    """Our boosting, and how many of its first stumps agree with the exhaustive sweep."""
    part, wall = own.astype(np.int64), n_threads > 1
    seconds = []
    with thread_limit(n_threads):
        prepare_s, prepared = timed(lambda: prepare(X, part), repeats, wall=wall)
        for _ in range(repeats):
            prepared = prepare(X, part)  # a fresh one has sorted no bin yet
            rounds_s, found = timed(
                lambda fresh=prepared: boost(fresh, [1], [0], n_rounds=n_rounds), 1, wall=wall
            )
            seconds.append(rounds_s)
    stumps = list(zip(found.feature, found.threshold, found.polarity, strict=True))
    same = sum(stumps[t] == wanted[t] for t in range(len(wanted)))
    n_bytes = prepared.codes.nbytes + prepared.tables.cells.nbytes
    return row(
        "pgm_places",
        n_threads,
        prepare_s,
        statistics.median(seconds),
        same=f"{same} of {len(wanted)}",
        bytes_per_value=n_bytes / X.size,
    )


def run(quick: bool) -> list[Row]:
    """The rows of the tables."""
    n_rows, n_rounds, repeats = (4_000, 20, 3) if quick else (100_000, 100, 5)
    title, X, y = training_data(n_rows)
    print(f"{title}: {X.shape[0]} x {X.shape[1]}", file=sys.stderr, flush=True)
    warm = prepare(X[::97], (y[::97] == 1).astype(np.int64))
    boost(warm, [1], [0], n_rounds=2)
    rows = []
    for k in (1,) if quick else (1, 2):
        rows += binary(X, y, k, n_rounds, repeats)
    return rows
