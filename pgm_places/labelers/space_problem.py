"""The labelling problem of a map's cells, gates and places together."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.graph.edge_kind import EdgeKind
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.layout import GridLayout
from pgm_places.graph.node_kind import NodeKind
from pgm_places.inference.problem import LabelingProblem
from pgm_places.unary.space_model import MapSpaces, without_gates

__all__ = ["space_problem"]

_SURE = 1e-3
"""Probabilities of gates are kept this far from 0 and 1: lists know nothing for certain."""


def space_problem(
    cells: LabelingProblem, layout: GridLayout, spaces: MapSpaces, doorway: int
) -> LabelingProblem:
    """The problem of the cells, followed by that of the gates and of the places.

    Places are the segments of the finest scale. Each cell is linked to its place and to the gates
    that it lies at, each gate to the two places beside it. What the scores of the cells at gates
    owe to them is taken out again, since the nodes of the gates have it.

    Parameters
    ----------
    cells : LabelingProblem
        Its unary (N, K) is that of lists that see spaces; node and edge features are left behind,
        known labels are kept.
    layout : GridLayout
        The cells in the order of the nodes.
    spaces : MapSpaces
        Those of the map, with G gates and P segments of the finest scale.
    doorway : int
        The label of doorways.

    Returns
    -------
    LabelingProblem
        Of N + G + P nodes. The unary of a gate is the logarithm of its probability, that of a place
        forbids doorways and nothing else.
    """
    assert cells.unary is not None
    places = spaces.gates.segmentation.scales[0]
    n, n_gates = cells.graph.n_nodes, len(spaces.gates)
    place = places.at(layout.cells_rc)
    inside = np.flatnonzero(place >= 0)
    gate = np.arange(n_gates)
    kinds = cells.graph.edge_kind
    groups = (
        (cells.graph.edges, EdgeKind.AXIS if kinds is None else kinds),
        (spaces.nodes_and_gates(layout) + np.array([0, n]), EdgeKind.CELL_GATE),
        (np.stack([inside, place[inside] + n + n_gates], axis=1), EdgeKind.CELL_PLACE),
        *(
            (np.stack([n + gate, side + n + n_gates], axis=1), EdgeKind.GATE_PLACE)
            for side in spaces.gates.segments.T
        ),
    )
    counts = {NodeKind.CELL: n, NodeKind.GATE: n_gates, NodeKind.PLACE: places.count}
    graph = LabelGraph.from_edges(
        sum(counts.values()),
        np.concatenate([pairs for pairs, _ in groups]),
        edge_kind=np.concatenate([np.broadcast_to(kind, len(pairs)) for pairs, kind in groups]),
        node_kind=np.repeat(list(counts), list(counts.values())),
    )
    unary = (
        without_gates(cells.unary, spaces.nodes_at_gates(layout), doorway),
        _of_gates(spaces.probability, cells.n_labels, doorway),
        _of_places(places.count, cells.n_labels, doorway),
    )
    known = None
    if cells.known is not None:
        known = np.append(cells.known, np.full(n_gates + places.count, -1))
    return LabelingProblem(graph, cells.label_names, np.concatenate(unary), known=known)


def _of_gates(probability: NDArray[np.float64], n_labels: int, doorway: int) -> NDArray[np.float64]:
    p = np.clip(probability, _SURE, 1 - _SURE)
    found = np.repeat(np.log(1 - p)[:, None], n_labels, axis=1)
    found[:, doorway] = np.log(p)
    return found


def _of_places(n_places: int, n_labels: int, doorway: int) -> NDArray[np.float64]:
    found = np.zeros((n_places, n_labels))
    found[:, doorway] = -np.inf
    return found
