"""Decoding pairwise models: every decoder, and alternatives from other packages.

``AMN`` is the associative Markov network trained on the left half of building 79 and decoded on all
of it; ``noise`` is the same graph with hard random unaries and one reward for all labels, where
neighbours matter more than the classifier. None of them is a tree or chain, so ``exact`` is not
included. Without the data, the generated building is used.
Seconds are processor time on one thread, with compiled kernels; ``gap`` is the share of the score
by which the best known bound exceeds the method's score. The peers' expansions are NumPy code
around their cut, with the time of the cut listed separately; ``ratio`` is relative to ours.
The minimum cuts are those of a square of a million cells with eight neighbours each, noise alone
and noise on smooth hills; each starts from the list of edges, and ``same`` is the share of the
nodes that are on the same side as ours.
"""

import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from scipy.ndimage import gaussian_filter

from benchmarks.inference_peers import Model, expand, installed_cuts
from benchmarks.labelling import NAMES, map_files
from experiments.page_tables import SideBySide
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.raster_edges import EdgeKind
from pgm_places.inference.potentials import Potentials
from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.map_server import load_map
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.maps.coarsening import coarsen, coarsen_labels
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.models.amn import AssociativeMarkovNetwork
from pgm_places.models.decoders import DECODERS
from pgm_places.models.decoding import decode
from pgm_places.solvers.adjacency import adjacency
from pgm_places.solvers.elimination import reduce_model
from pgm_places.solvers.graph_cut import MoveSpace, alpha_expansion, minimum_cut
from pgm_places.solvers.pairwise import pairwise_model
from pgm_places.solvers.trws import trws

SHOWN = (
    SideBySide(("decoder",), "{instance}", "{processor s} s / {gap} / {accuracy %} %"),
    SideBySide(("expansion by",), "{instance}", "{processor s} ({ratio})"),
    SideBySide(("TRW-S to a gap of 1e-5",), "{instance}", "{processor s} s ({iterations})"),
    SideBySide(("minimum cut by",), "{instance}", "{processor s} ({ratio})"),
)
"""How long tables are made short and wide."""

TRAINING_COLUMNS = 366
LP_NODES = 20_000
"""Most undecided nodes for which HiGHS solves the linear relaxation."""
ENOUGH_SECONDS = 2.0
"""A measurement that takes longer (s) is not repeated."""
R = TypeVar("R")


def instances(resolution_m: float) -> list[Model]:
    """The learned model of a building at a resolution, and a random one on the same graph."""
    with tempfile.TemporaryDirectory() as name:
        title, map_yaml, label_path = map_files(Path(name))
        grid = load_map(map_yaml).grid
        labels = load_labels(label_path, NAMES, grid=grid)
    share = TRAINING_COLUMNS * grid.resolution_m if title == "building 79" else np.inf
    if resolution_m > grid.resolution_m:
        coarse = coarsen(grid, resolution_m)
        labels, grid = coarsen_labels(labels, grid, coarse), coarse
    window = np.broadcast_to(np.arange(grid.shape[1]) * grid.resolution_m < share, grid.shape)
    network = AssociativeMarkovNetwork(certify_learning=False)
    labeler = PlaceLabeler(NAMES, {"amn": network}, learn_on="in-sample", space=None)
    labeler = labeler.fit([LabelledMap(grid, labels, window)])
    problem = labeler.problem(grid)
    potentials = labeler.method("amn").backend.potentials(problem)
    truth = LabelledMap(grid, labels).truth(problem.graph)
    edges = problem.graph.edges.astype(np.int64)
    where = f"{title}, {100 * grid.resolution_m:.0f} cm"
    learned = Model(f"AMN, {where}", potentials.unary, edges, potentials.agreement, truth)
    return [learned, noise(f"noise, {where}", problem.graph, truth)]


def noise(name: str, graph: LabelGraph, truth: np.ndarray[Any, np.dtype[np.int64]]) -> Model:
    """Unaries that say little and a reward that is the same for all labels."""
    rng = np.random.default_rng(0)
    unary = 2.0 * rng.normal(size=(graph.n_nodes, len(NAMES)))
    unary[np.arange(graph.n_nodes), np.maximum(truth, 0)] += 0.7
    diagonal = np.asarray(graph.edge_kind) == EdgeKind.DIAGONAL
    reward = np.where(diagonal, np.sqrt(0.5), 1.0)[:, None] * np.full(len(NAMES), 0.6)
    return Model(name, unary, graph.edges.astype(np.int64), reward, truth)


def timed(work: Callable[[], R], repeats: int) -> tuple[float, R]:
    """Median processor seconds after a first run, and what came back.

    What takes long is repeated less, down to the one run after the first.
    """
    result = work()
    seconds: list[float] = []
    while len(seconds) < repeats and sum(seconds) < ENOUGH_SECONDS:
        start = time.process_time()
        result = work()
        seconds.append(time.process_time() - start)
    return statistics.median(seconds), result


def decoder_rows(model: Model, repeats: int) -> list[dict[str, Any]]:
    """Every decoder that can take the model."""
    graph = LabelGraph.from_edges(len(model.unary), model.edges)
    potentials = Potentials(model.unary, agreement=model.agreement)
    bound = trws(pairwise_model(*_arrays(model)), max_iterations=500, tolerance=1e-9).bound
    n_open = len(reduce_model(pairwise_model(*_arrays(model))).nodes)
    rows = []
    for name in DECODERS:
        if name == "exact" or (name == "lp" and n_open > LP_NODES):
            continue
        seconds, found = timed(lambda name=name: decode(graph, potentials, name), repeats)
        rows.append(
            {
                "instance": model.name,
                "decoder": name,
                "processor s": seconds,
                "score": round(found.score or 0.0, 3),
                "gap": max(bound - (found.score or 0.0), 0.0) / abs(found.score or 1.0),
                "accuracy %": 100 * model.accuracy(found.labels),
                "status": str(found.status),
                "iterations": found.info["iterations"],
            }
        )
    return rows


def expansion_rows(model: Model, repeats: int) -> list[dict[str, Any]]:
    """One full alpha-expansion, ours and the peers'."""
    ours, found = timed(lambda: alpha_expansion(pairwise_model(*_arrays(model))), repeats)
    around = adjacency(len(model.unary), model.edges)
    space = MoveSpace(around)
    again, _ = timed(
        lambda: alpha_expansion(pairwise_model(model.unary, around, model.agreement), space=space),
        repeats,
    )

    def row(name: str, seconds: float, score: float, inside: float | None) -> dict[str, Any]:
        return {
            "instance": model.name,
            "expansion by": name,
            "processor s": seconds,
            "ratio": seconds / ours,
            "in the cut s": inside,
            "score": round(score, 3),
        }

    rows = [
        row("pgm_places", ours, found.score, None),
        row("pgm_places, prepared graph", again, found.score, None),
    ]
    for name, cut in installed_cuts().items():
        seconds, (labels, inside) = timed(lambda cut=cut: expand(model, cut), repeats)
        rows.append(row(name, seconds, model.score(labels), inside))
    return rows


def bound_rows(model: Model, repeats: int) -> list[dict[str, Any]]:
    """Tree-reweighted message passing to a gap, and what an iteration costs."""
    rows = []
    for eliminate in (True, False):
        seconds, found = timed(
            lambda eliminate=eliminate: trws(
                pairwise_model(*_arrays(model)), tolerance=1e-5, eliminate=eliminate
            ),
            repeats,
        )
        rows.append(
            {
                "instance": model.name,
                "TRW-S to a gap of 1e-5": "labels eliminated" if eliminate else "plain",
                "processor s": seconds,
                "iterations": len(found.history),
                "ms an iteration": 1e3 * seconds / len(found.history),
                "gap": (found.bound - found.score) / abs(found.score),
            }
        )
    return rows


def cut_rows(size: int, repeats: int) -> list[dict[str, Any]]:
    """Minimum cuts of a square of ``size`` x ``size`` cells, ours and the peers'."""
    rng = np.random.default_rng(0)
    noise_alone = 2.0 * rng.normal(size=(size, size))
    hills = gaussian_filter(rng.normal(size=(size, size)), size / 125)
    graph = LabelGraph.from_grid(np.ones((size, size), np.bool_))
    edges = graph.edges.astype(np.int64)
    diagonal = np.asarray(graph.edge_kind) == EdgeKind.DIAGONAL
    capacity = 0.6 * np.where(diagonal, np.sqrt(0.5), 1.0)
    fields = {"noise": noise_alone, "hills": hills / hills.std() + 0.5 * noise_alone}
    return [
        row
        for name, field in fields.items()
        for row in _cuts(f"{name}, {size} x {size}", edges, capacity, field.ravel(), repeats)
    ]


def _cuts(name: str, edges: Any, capacity: Any, excess: Any, repeats: int) -> list[dict[str, Any]]:
    def own() -> Any:
        source, sink = np.maximum(excess, 0.0), np.maximum(-excess, 0.0)
        return ~minimum_cut(source, sink, edges, capacity, capacity).source_side

    seconds, side = timed(own, repeats)
    found = [("pgm_places", seconds, side)]
    for peer, cut in installed_cuts().items():
        found.append((peer, *timed(lambda cut=cut: cut(edges, capacity, excess), repeats)))
    return [
        {
            "instance": name,
            "minimum cut by": method,
            "processor s": taken,
            "ratio": taken / seconds,
            "same": float((answer == side).mean()),
        }
        for method, taken, answer in found
    ]


def _arrays(model: Model) -> tuple[Any, Any, Any]:
    return model.unary, model.edges, model.agreement


def run(quick: bool) -> list[dict[str, Any]]:
    """The rows of the tables; ``quick`` leaves out the native resolution."""
    repeats = 3 if quick else 7
    models = [model for size in ((0.2,) if quick else (0.2, 0.05)) for model in instances(size)]
    tables = (decoder_rows, expansion_rows, bound_rows)
    rows = [row for table in tables for model in models for row in table(model, repeats)]
    return rows + cut_rows(200 if quick else 1000, repeats)
