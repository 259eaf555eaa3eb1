"""Learning an associative Markov network.

The left half of building 79 at 20 cm and at 5 cm if the data is available, otherwise the generated
building; scores and features come from a boosted list, options are the defaults. ``objective`` is
rigorous for every method: that of the QPs is made feasible, that of the others is bounded by TRW-S
at the learned weights. ``gap`` compares it with the lower bound of the same row, ``over best`` with
the largest lower bound of all rows. Seconds are processor time, without features and certificate.
``peak`` is the memory of a fresh process after learning. The compact QP is omitted where it would
take minutes and gigabytes.
"""

import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.labelling import NAMES, map_files
from benchmarks.memory import peak_bytes
from pgm_places.inference.problem import LabelingProblem
from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.map_server import load_map
from pgm_places.maps.coarsening import coarsen, coarsen_labels
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.models.amn import AssociativeMarkovNetwork
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.sensing.sensor import Sensor
from pgm_places.solvers.cutting_plane import cutting_plane
from pgm_places.solvers.margin_solution import LearnedWeights
from pgm_places.solvers.max_margin import MaxMarginProblem
from pgm_places.solvers.max_margin_qp import max_margin_qp
from pgm_places.solvers.max_oracle import certify_weights, graph_cut_oracle
from pgm_places.unary.learning import UnaryLearner

TRAINING_COLUMNS = 366
PENALTY = 100.0
ARRAYS = ("node_features", "edges", "edge_features", "labels", "loss")
QP_NODES = 5_000
"""Most nodes for which the compact QP is solved."""


def training_problem(resolution_m: float, *, quick: bool) -> tuple[str, MaxMarginProblem]:
    """A name and the learning problem of the default network at a resolution."""
    with tempfile.TemporaryDirectory() as name:
        title, map_yaml, label_path = map_files(Path(name))
        grid = load_map(map_yaml).grid
        labels = load_labels(label_path, NAMES, grid=grid)
    share = TRAINING_COLUMNS * grid.resolution_m if title == "building 79" else np.inf
    if resolution_m > grid.resolution_m:
        coarse = coarsen(grid, resolution_m)
        labels, grid = coarsen_labels(labels, grid, coarse), coarse
    window = np.broadcast_to(np.arange(grid.shape[1]) * grid.resolution_m < share, grid.shape)
    known = LabelledMap(grid, labels, window)
    classifier = DecisionListClassifier(n_rounds=30 if quick else 100)
    learned = UnaryLearner(Sensor(), classifier, len(NAMES), learn_on="in-sample").fit([known])
    graph = known.graph(labelled_only=True)
    assert learned.scores is not None  # asked for by default
    scores = learned.scores
    problem = LabelingProblem(
        graph, NAMES, scores[0].laser, np.asarray(scores[0].node_features, np.float64)
    )
    truth = known.truth(graph)
    task = AssociativeMarkovNetwork(C=PENALTY).learning_problem([problem], [truth])
    return f"{title}, {100 * grid.resolution_m:.0f} cm", task


def learned(task: MaxMarginProblem, **options: Any) -> LearnedWeights:
    """The default learner: each cut starts from the last one's, until these find no more."""
    quick = graph_cut_oracle(task.n_nodes, task.edges, from_last=True)
    thorough = graph_cut_oracle(task.n_nodes, task.edges)
    return cutting_plane(task, quick, thorough=thorough, **options)


def learners(task: MaxMarginProblem) -> dict[str, Callable[[], LearnedWeights]]:
    """The methods by name."""
    oracle = graph_cut_oracle(task.n_nodes, task.edges)
    found: dict[str, Callable[[], LearnedWeights]] = {
        "cutting plane": lambda: learned(task),
        "cutting plane, each cut from scratch": lambda: cutting_plane(task, oracle),
    }
    if task.n_nodes <= QP_NODES:
        found["compact QP, Clarabel"] = lambda: max_margin_qp(task, solver="clarabel")
        found["compact QP, OSQP"] = lambda: max_margin_qp(task, solver="osqp", tolerance=1e-4)
    return found


def peak_gib(file: Path) -> float:
    """Memory of this process when the default learner has run on a stored problem."""
    with np.load(file) as stored:
        arrays = {field: stored[field] for field in ARRAYS}
    task = MaxMarginProblem(**arrays, n_labels=len(NAMES), penalty=PENALTY)
    learned(task)
    return peak_bytes() / 2**30


def memory_row(title: str, task: MaxMarginProblem) -> dict[str, Any]:
    """Peak memory of a fresh process that learns."""
    with tempfile.TemporaryDirectory() as name:
        file = Path(name) / "task.npz"
        np.savez(file, **{field: getattr(task, field) for field in ARRAYS})
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
            peak = pool.submit(peak_gib, file).result()
    return {"map": title, "nodes": task.n_nodes, "peak GiB": peak}


def compare(title: str, task: MaxMarginProblem) -> list[dict[str, Any]]:
    """The rows of one map."""
    learned(task, max_iterations=2)
    certify_weights(task, np.zeros(task.n_weights))
    results = {}
    for name, learn in learners(task).items():
        start = time.process_time()
        solution = learn()
        seconds = time.process_time() - start
        objective = certify_weights(task, solution.weights).objective
        if name.startswith("compact QP"):
            objective = min(objective, solution.objective)
        results[name] = (seconds, objective, solution.lower_bound, solution.iterations)
    best = max(lower for _, _, lower, _ in results.values())
    qp_seconds = results.get("compact QP, Clarabel", (None,))[0]
    return [
        {
            "map": title,
            "nodes": task.n_nodes,
            "method": name,
            "seconds": seconds,
            "times Clarabel": None if qp_seconds is None else qp_seconds / seconds,
            "iterations": iterations,
            "objective": objective,
            "gap %": 100 * (objective - lower) / objective,
            "over best %": 100 * (objective - best) / objective,
        }
        for name, (seconds, objective, lower, iterations) in results.items()
    ]


def run(quick: bool) -> list[dict[str, Any]]:
    """The rows of the table."""
    title, task = training_problem(0.2, quick=quick)
    rows = compare(title, task)
    if not quick:
        title, task = training_problem(0.05, quick=quick)
        rows += compare(title, task)
    return [*rows, memory_row(title, task)]
