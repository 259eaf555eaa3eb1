"""Peers for pairwise labelling: other packages' decoders and cuts behind common functions.

None of them is a dependency; packages that are not installed are left out.
PyMaxflow is GPL; it is a yardstick here and nowhere else.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Cut = Callable[[NDArray[np.int64], Floats, Floats], NDArray[np.bool_]]
"""Edges (E, 2), capacity both ways (E,), excess (N,) -> nodes on the sink's side (N,)."""

INTEGER_SCALE = 1e6
"""Solvers that want integers get the largest capacity as this many units."""


@dataclass(frozen=True)
class Model:
    """Unaries (N, K) and rewards of agreement (E, K) on edges (E, 2)."""

    name: str
    unary: Floats
    edges: NDArray[np.int64]
    agreement: Floats
    truth: NDArray[np.int64]

    def score(self, labels: NDArray[np.integer]) -> float:
        """The log-potential of a labelling."""
        first, second = labels[self.edges[:, 0]], labels[self.edges[:, 1]]
        same = np.flatnonzero(first == second)
        return float(
            self.unary[np.arange(len(labels)), labels].sum()
            + self.agreement[same, first[same]].sum()
        )

    def accuracy(self, labels: NDArray[np.integer]) -> float:
        """The share of the labelled nodes that a labelling gets right."""
        known = self.truth >= 0
        return float((labels == self.truth)[known].mean())


def cut_pymaxflow(edges: NDArray[np.int64], capacity: Floats, excess: Floats) -> NDArray[np.bool_]:
    """PyMaxflow: Boykov-Kolmogorov in C++ on floats."""
    import maxflow

    graph = maxflow.Graph[float](len(excess), len(edges))
    nodes = graph.add_nodes(len(excess))
    graph.add_edges(edges[:, 0], edges[:, 1], capacity, capacity)
    graph.add_grid_tedges(nodes, np.maximum(excess, 0.0), np.maximum(-excess, 0.0))
    graph.maxflow()
    return np.asarray(graph.get_grid_segments(nodes), np.bool_)


def _integer_arcs(
    edges: NDArray[np.int64], capacity: Floats, excess: Floats
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int64]]:
    """Tails, heads and scaled capacities; the source is node N, the sink N + 1."""
    n_nodes = len(excess)
    scale = INTEGER_SCALE / max(np.abs(excess).max(), capacity.max(initial=0.0), 1e-300)
    capacities, ends = np.rint(capacity * scale), np.rint(excess * scale)
    above, below, used = np.flatnonzero(ends > 0), np.flatnonzero(ends < 0), capacities > 0
    tails = [edges[used, 0], edges[used, 1], np.full(len(above), n_nodes), below]
    heads = [edges[used, 1], edges[used, 0], above, np.full(len(below), n_nodes + 1)]
    values = [capacities[used], capacities[used], ends[above], -ends[below]]
    return (
        np.concatenate(tails).astype(np.int32),
        np.concatenate(heads).astype(np.int32),
        np.concatenate(values).astype(np.int64),
    )


def cut_scipy(edges: NDArray[np.int64], capacity: Floats, excess: Floats) -> NDArray[np.bool_]:
    """SciPy: Dinic on scaled integers."""
    import scipy.sparse as sp
    from scipy.sparse.csgraph import breadth_first_order, maximum_flow

    n_nodes = len(excess)
    tails, heads, values = _integer_arcs(edges, capacity, excess)
    shape = (n_nodes + 2, n_nodes + 2)
    network = sp.csr_array((values.astype(np.int32), (tails, heads)), shape=shape)
    residual = sp.csr_array(network - maximum_flow(network, n_nodes, n_nodes + 1).flow)
    residual.eliminate_zeros()
    reaching = breadth_first_order(sp.csr_array(residual.T), n_nodes + 1, return_predecessors=False)
    side = np.zeros(n_nodes + 2, np.bool_)
    side[reaching] = True
    return side[:n_nodes]


def installed_cuts() -> dict[str, Cut]:
    """The minimum cuts of installed packages, by name."""
    cuts: dict[str, Cut] = {}
    if find_spec("maxflow"):
        cuts["PyMaxflow"] = cut_pymaxflow
    return cuts | {"scipy": cut_scipy}


def expand(model: Model, cut: Cut, max_sweeps: int = 20) -> tuple[NDArray[np.int64], float]:
    """Alpha-expansion in vectorised NumPy around a peer's cut; labels and seconds in the cut."""
    n_nodes, n_labels = model.unary.shape
    nodes, every = np.arange(n_nodes), np.arange(len(model.edges))
    i, j = model.edges[:, 0], model.edges[:, 1]
    labels = model.unary.argmax(axis=1)
    best, idle, inside = model.score(labels), 0, 0.0
    for move in range(max_sweeps * n_labels):
        target = move % n_labels
        agreed = np.where(labels[i] == labels[j], model.agreement[every, labels[i]], 0.0)
        gained = model.agreement[:, target]
        done_i, done_j = labels[i] == target, labels[j] == target
        both = ~done_i & ~done_j
        excess = model.unary[nodes, labels] - model.unary[:, target]
        excess[labels == target] = 0.0
        excess -= np.bincount(j[done_i & ~done_j], gained[done_i & ~done_j], n_nodes)
        excess -= np.bincount(i[done_j & ~done_i], gained[done_j & ~done_i], n_nodes)
        half = 0.5 * (agreed - gained)[both]
        excess += np.bincount(i[both], half, n_nodes) + np.bincount(j[both], half, n_nodes)
        start = time.process_time()
        sink_side = cut(model.edges[both], 0.5 * (agreed + gained)[both], excess)
        inside += time.process_time() - start
        moved = np.where(sink_side & (labels != target), target, labels)
        value = model.score(moved)
        if value > best + 1e-9 * abs(best):
            labels, best, idle = moved, value, 1
        else:
            idle += 1
        if idle >= n_labels:
            break
    return labels, inside
