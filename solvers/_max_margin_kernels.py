"""Compiled sums for max-margin learning."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit
from pgm_places.kernels.lane_access import FOUR, load_four, store_four


@njit
def add_feature_difference(
    labels: NDArray[np.int64],
    truth: NDArray[np.int64],
    node_features: NDArray[np.float64],
    edges: NDArray[np.int32],
    edge_features: NDArray[np.float64],
    nodes_out: NDArray[np.float64],
    edges_out: NDArray[np.float64],
) -> None:
    """Add phi(truth) - phi(labels) to ``nodes_out`` (D, K) and ``edges_out`` (F, K).

    Only nodes and edges where the labellings differ are looked at, which are few near the end.
    """
    for i in range(len(labels)):
        k, t = labels[i], truth[i]
        if k != t:
            for d in range(node_features.shape[1]):
                value = node_features[i, d]
                nodes_out[d, t] += value
                nodes_out[d, k] -= value
    for e in range(len(edges)):
        i, j = edges[e, 0], edges[e, 1]
        k, t = labels[i], truth[i]
        if k == t and labels[j] == truth[j]:
            continue
        if truth[j] == t:
            for f in range(edge_features.shape[1]):
                edges_out[f, t] += edge_features[e, f]
        if labels[j] == k:
            for f in range(edge_features.shape[1]):
                edges_out[f, k] -= edge_features[e, f]


@njit
def multiply_rows(
    rows: NDArray[np.float64], weights: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    """Write the products of ``rows`` (N, D) and ``weights`` (D, K) one after the other to ``out``.

    ``weights`` (D, P) are padded to P, a multiple of four; what that writes behind a row is
    overwritten by the next, so that ``out`` (1, N K + P) ends with some room.
    """
    n_columns = (out.shape[1] - weights.shape[1]) // max(rows.shape[0], 1)
    zero = load_four(out, 0, 0) * 0.0
    for i in range(rows.shape[0]):
        for g in range(0, weights.shape[1], FOUR):
            total = zero
            for d in range(rows.shape[1]):
                total = total + load_four(weights, d, g) * rows[i, d]
            store_four(out, 0, i * n_columns + g, total)
