"""Kernels of exact sums on a forest in probability space, where nothing needs an exponential.

A node's message to its parent is scaled to sum to one. ``inner`` (N, K) is what a node and all
below it say of its label, ``outer`` (N, K) what the rest says of its parent's; their product and
the exponential of the edge's potential is the probability of a pair of labels.
"""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import fused, njit
from pgm_places.solvers._adjacency_kernels import REVERSE, Arcs
from pgm_places.solvers._belief_kernels import NO_ARC

__all__ = ["collect", "distribute", "subtract_peaks"]

_ONE = np.uint32(1)


@njit
def subtract_peaks(
    unary: NDArray[np.float64], out: NDArray[np.float64], peak: NDArray[np.float64]
) -> float:
    """Rows (N, K) less their largest entry, which goes to ``peak``; how deep finite ones go."""
    deepest = 0.0
    for i in range(unary.shape[0]):
        peak[i] = unary[i, 0]
        for k in range(1, unary.shape[1]):
            peak[i] = max(peak[i], unary[i, k])
        for k in range(unary.shape[1]):
            out[i, k] = unary[i, k] - peak[i]
            if deepest > out[i, k] > -np.inf:
                deepest = out[i, k]
    return deepest


@fused
def _pass(
    gain: NDArray[np.float64], along: np.uint32, sent: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    """``out[b] = sum_a sent[a] exp(potential(a, b))`` along an arc, from its owner to its head."""
    n_labels = sent.shape[0]
    if gain.ndim == 2:
        total = 0.0
        for k in range(n_labels):
            total += sent[k]
        for k in range(n_labels):
            out[k] = total + gain[along >> _ONE, k] * sent[k]
        return
    at = along if gain.shape[0] > 2 else along & _ONE
    for b in range(n_labels):
        out[b] = sent[0] * gain[at, 0, b]
    for a in range(1, n_labels):
        for b in range(n_labels):
            out[b] += sent[a] * gain[at, a, b]


@njit
def collect(
    gain: NDArray[np.float64],
    arcs: Arcs,
    order: NDArray[np.uint32],
    parent: NDArray[np.uint32],
    inner: NDArray[np.float64],
    message: NDArray[np.float64],
    scale: NDArray[np.float64],
) -> None:
    """Messages (N, K) from each node to its parent, from the leaves to the roots.

    ``gain`` is ``exp(potential)`` by arc, (2 E, K, K) or (2, K, K) for all edges, owner's label
    first; or ``exp(agreement) - 1``, (E, K). ``inner`` starts as the exponentials of the unary. The
    product of all ``scale`` (N,) is the sum over all labellings.
    """
    n_labels = inner.shape[1]
    for step in range(order.shape[0]):
        i = order[order.shape[0] - 1 - step]
        along = parent[i]
        total = 0.0
        if along == NO_ARC:
            for k in range(n_labels):
                total += inner[i, k]
            scale[i] = total
            continue
        _pass(gain, along, inner[i], message[i])
        for k in range(n_labels):
            total += message[i, k]
        scale[i] = total
        above, factor = arcs.ends[along ^ REVERSE], 1.0 / total
        for k in range(n_labels):
            message[i, k] *= factor
            inner[above, k] *= message[i, k]


@njit
def distribute(
    gain: NDArray[np.float64],
    arcs: Arcs,
    order: NDArray[np.uint32],
    parent: NDArray[np.uint32],
    inner: NDArray[np.float64],
    message: NDArray[np.float64],
    belief: NDArray[np.float64],
) -> None:
    """Beliefs (N, K) from the roots to the leaves, after :func:`collect`.

    ``message`` becomes ``outer``; it stays what it is at roots.
    """
    n_labels = inner.shape[1]
    back = np.empty(n_labels)
    for step in range(order.shape[0]):
        i = order[step]
        along = parent[i]
        back[:] = 1.0
        if along != NO_ARC:
            above = arcs.ends[along ^ REVERSE]
            for k in range(n_labels):
                message[i, k] = belief[above, k] / message[i, k]
            _pass(gain, along ^ REVERSE, message[i], back)
        total = 0.0
        for k in range(n_labels):
            belief[i, k] = inner[i, k] * back[k]
            total += belief[i, k]
        factor = 1.0 / total
        for k in range(n_labels):
            belief[i, k] *= factor
            message[i, k] *= factor
