"""Messages through tables that fall with the distance of labels: in O(K), and by the table.

A grid with four neighbours each and random unaries, ``-min(0.3 |k - l|, 2)`` or
``-min(0.05 (k - l)^2, 2)`` for every edge: five iterations of ``trw-s``, five sweeps of
``max-product``, and the best labelling of the same nodes as a chain. Seconds are processor time on
one thread, the least of three runs in turn; both columns find the same labels.
"""

import time
from collections.abc import Callable
from typing import Any
from unittest.mock import patch

import numpy as np

from experiments.page_tables import SideBySide
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.solvers import pairwise
from pgm_places.solvers.belief_propagation import belief_propagation
from pgm_places.solvers.forest import forest_maximum
from pgm_places.solvers.pairwise import pairwise_model
from pgm_places.solvers.trws import trws

SHOWN = (SideBySide(("table", "solver"), "{labels} labels", "{by distance (s)} / {by table (s)}"),)
"""How long tables are made short and wide."""

SIDE = 40
BY_DISTANCE, BY_TABLE = {1.0: 0, 2.0: 0}, {1.0: 10**9, 2.0: 10**9}
"""From how many labels on distances are looked at: always, never."""


def run(quick: bool) -> list[dict[str, Any]]:
    """The rows of the table."""
    rows = []
    for n_labels in (16, 64) if quick else (16, 64, 256):
        steps = np.arange(float(n_labels))
        apart = np.abs(np.subtract.outer(steps, steps))
        tables = {
            "linear": -np.minimum(0.3 * apart, 2.0),
            "quadratic": -np.minimum(0.05 * apart**2, 2.0),
        }
        for kind, table in tables.items():
            for name, work in _solvers(n_labels, table).items():
                fast, slow = _seconds(work, BY_DISTANCE, BY_TABLE)
                numbers = {"by distance (s)": fast, "by table (s)": slow, "ratio": slow / fast}
                rows.append({"labels": n_labels, "table": kind, "solver": name, **numbers})
    return rows


def _solvers(n_labels: int, table: Any) -> dict[str, Callable[[], Any]]:
    grid = LabelGraph.from_lattice((SIDE, SIDE)).edges
    chain = LabelGraph.from_lattice((SIDE**2,)).edges
    unary = np.random.default_rng(0).normal(size=(SIDE**2, n_labels))
    return {
        "trw-s": lambda: trws(pairwise_model(unary, grid, pairwise=table), max_iterations=5),
        "max-product": lambda: belief_propagation(
            pairwise_model(unary, grid, pairwise=table), kind="max-product", max_iterations=5
        ),
        "chain": lambda: forest_maximum(pairwise_model(unary, chain, pairwise=table)),
    }


def _seconds(work: Callable[[], Any], *ways: dict[float, int]) -> list[float]:
    """The least of three runs of each way, one after the other, once warm."""
    best = [np.inf] * len(ways)
    for turn in range(4):
        labels = []
        for number, fewest in enumerate(ways):
            with patch.object(pairwise, "FEWEST_LABELS", fewest):
                start = time.process_time()
                labels.append(work().labels)
                spent = time.process_time() - start
            if turn:
                best[number] = min(best[number], spent)
        assert all((found == labels[0]).all() for found in labels)
    return best
