"""The picture of the theory: the terms that each method adds up, on the same few cells."""

from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap
from numpy.typing import NDArray

from experiments.pictures.kept import COLOURS, NAMES, figure, keep, legend, plain
from pgm_places import LabelGraph, LabelingProblem, LabelledMap, PlaceLabeler, build
from pgm_places.datasets import generate_building
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.models.hmm import HiddenMarkovModel
from pgm_places.palette import WALL
from pgm_places.sensing.simulated_moves import simulate_moves

CELL_M = 0.2
TRAINING, TESTED = (0, 3, 4), 2
METHODS: dict[str, Any] = {
    "independent": build("independent"),
    "relaxation": build("relaxation", {"max_iterations": 10}),
    "amn": build("amn", {"class_weight": "cube-root"}),
}
WINDOW = (slice(14, 26), slice(20, 33))
"""Rows from the bottom and columns of a doorway between a corridor and a room."""
WAY = ((24, 20), (24, 26), (20, 26), (19, 27), (17, 27), (14, 24))
"""The corners of a path through it."""
FOR, AGAINST = "#2b4bb8", "#b5482a"

Terms = tuple[NDArray[Any], NDArray[np.float64]]
"""Pairs of nodes (E, 2), and the term of each (E,)."""


def energies() -> None:
    """Cells alone, a chain through them, the support of neighbours, and learned rewards."""
    known = [generate_building(seed, size="small", resolution_m=CELL_M) for seed in TRAINING]
    maps = [LabelledMap(item.grid, item.labels) for item in known]
    list_ = DecisionListClassifier(20, order="rarest-first")
    labeler = PlaceLabeler(NAMES, METHODS, classifier=list_, context_m=(), space=None).fit(maps)
    made = generate_building(TESTED, size="small", resolution_m=CELL_M)
    graph, scores = labeler.scores(made.grid)
    found = {name: labeler.infer(graph, scores, method=name) for name in METHODS}
    belief = np.asarray(found["independent"].beliefs)
    alone, relaxed, network = (np.asarray(item.labels) for item in found.values())
    cells = graph.layout.cells_rc
    way = graph.layout.nodes_at(_way())
    steps, moves = _chain(maps, cells[way] * CELL_M, belief[way])
    tables = np.asarray(labeler.method("relaxation").backend.compatibility)
    amn = labeler.method("amn")
    potentials = amn.backend.potentials(labeler.problem_of(graph, scores, amn))
    every, edges = np.arange(len(cells)), graph.edges
    picture = figure(8.6, 7.3)
    axes = picture.subplots(2, 2).ravel()
    for axis, title, nodes, labels, terms in (
        (axes[0], "each cell alone", every, alone, (edges[:0], np.empty(0))),
        (axes[1], "HMM: transitions", way, steps, (np.stack([way[:-1], way[1:]], 1), moves)),
        (axes[2], "relaxation: compatibility", every, relaxed,
         (edges, tables[0][tuple(relaxed[edges].T)])),
        (axes[3], "AMN: rewards", every, network, (edges, _rewards(potentials, edges, network))),
    ):  # fmt: skip
        _draw_terms(axis, made.grid.occupied, cells, terms)
        sizes = 16 + 90 * belief[nodes, labels]
        axis.scatter(*cells[nodes, ::-1].T, s=sizes, c=np.array(COLOURS)[labels], zorder=3)
        plain(axis, title)
        print(title, np.unique(np.round(terms[1], 2)))
    words = ("a term for these labels", "a term against")
    legend(picture, (*NAMES, *words), (*COLOURS, FOR, AGAINST))
    keep("theory", picture)


def _way() -> NDArray[np.int64]:
    """(n, 2) cells of the path."""
    lengths = [int(np.abs(np.subtract(a, b)).max()) for a, b in pairwise(WAY)]
    pieces = [
        np.linspace(a, b, n, endpoint=False)
        for (a, b), n in zip(pairwise(WAY), lengths, strict=True)
    ]
    return np.concatenate([*pieces, WAY[-1:]]).astype(np.int64)


def _chain(maps: list[LabelledMap], positions_m: Any, belief: Any) -> tuple[Any, Any]:
    """Labels of the steps, and by how much their transitions are likelier than chance (log)."""
    moves = simulate_moves(maps, len(NAMES))
    shares = np.bincount(np.concatenate([item.labels[item.labels >= 0] for item in maps]))
    model = HiddenMarkovModel("viterbi").with_counts(confusions=np.diag(shares), moves=moves)
    chain = LabelingProblem(LabelGraph.from_trajectory(positions_m), NAMES, np.log(belief))
    labels = model.infer(chain).labels
    return labels, np.log(len(NAMES) * np.asarray(model.transition)[labels[:-1], labels[1:]])


def _rewards(potentials: Any, edges: Any, labels: NDArray[np.int64]) -> NDArray[np.float64]:
    """(E,) what each edge earns."""
    one, other = labels[edges].T
    return np.where(one == other, potentials.agreement[np.arange(len(edges)), one], 0.0)


def _draw_terms(axis: Axes, walls: NDArray[np.bool_], cells: NDArray[Any], terms: Terms) -> None:
    """The walls of the window, and a line for each term, thicker for larger ones."""
    rows, columns = WINDOW
    axis.imshow(np.where(walls, 1.0, np.nan), cmap=ListedColormap([WALL]), origin="lower")
    pairs, values = terms
    largest = np.abs(values).max(initial=1e-9)
    lines = LineCollection(
        list(cells[pairs][:, :, ::-1]),
        linewidths=3.0 * np.sqrt(np.abs(values) / largest),
        colors=np.where(values >= 0, FOR, AGAINST).tolist(),
    )
    axis.add_collection(lines)
    axis.set_xlim(columns.start - 0.5, columns.stop - 0.5)
    axis.set_ylim(rows.start - 0.5, rows.stop - 0.5)
