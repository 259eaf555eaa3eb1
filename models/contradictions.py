"""Locating contradictions: a node without a possible label, for error messages."""

import contextlib
from collections.abc import Iterator

import numpy as np

from pgm_places.errors import InfeasibleError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.potentials import Potentials


def node_without_labels(graph: LabelGraph, potentials: Potentials) -> int | None:
    """A node without a possible label by arc consistency (Mackworth 1977).

    None if there is no such node, although every labelling may still be forbidden.

    Examples
    --------
    >>> unlike = np.where(np.eye(2) > 0, -np.inf, 0.0)
    >>> potentials = Potentials(np.zeros((2, 2)), unlike).with_known([1, 1])
    >>> node_without_labels(LabelGraph.from_edges(2, [(0, 1)]), potentials)
    0
    """
    allowed = potentials.unary > -np.inf
    fits = potentials.edge_tables(graph) > -np.inf
    first, second = graph.edges.T
    while allowed.any(axis=1).all():
        before = int(allowed.sum())
        for here, there, table in ((first, second, fits), (second, first, fits.transpose(0, 2, 1))):
            supported = (table & allowed[there][:, np.newaxis]).any(axis=2)
            np.logical_and.at(allowed, here, supported)
        if int(allowed.sum()) == before:
            return None
    return int(np.flatnonzero(~allowed.any(axis=1))[0])


@contextlib.contextmanager
def naming_the_node(graph: LabelGraph, potentials: Potentials) -> Iterator[None]:
    """Add the name of a contradictory node, if one is found, to an InfeasibleError of the block.

    Raises
    ------
    InfeasibleError
        Raised by the block.
    """
    try:
        yield
    except InfeasibleError as error:
        node = None if "node" in str(error) else node_without_labels(graph, potentials)
        if node is None:
            raise
        names = graph.node_names
        raise InfeasibleError(
            f"no label is left for node {node if names is None else repr(names[node])}: known or "
            "forbidden labels (-inf) at this node and its neighbours contradict; allow more labels"
        ) from None
