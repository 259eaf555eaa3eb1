"""Dual variables of MAP decoding: reparametrisation of the potentials, and the upper bound."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array
from pgm_places._core import minimum_cut_kernel
from pgm_places.solvers.adjacency import Adjacency
from pgm_places.solvers.max_flow import cut_space
from pgm_places.solvers.pairwise import PairwiseModel, pairwise_model


def dual_bound(
    unary: ArrayLike,
    edges: ArrayLike | Adjacency,
    agreement: ArrayLike | None = None,
    pairwise: ArrayLike | None = None,
    *,
    duals: ArrayLike,
) -> float:
    """Upper bound of all scores: the best of each node and edge after reparametrisation.

    ``sum_i max_k (unary_i(k) + sum_e d_ei(k)) + sum_e max_kl (table_e(k, l) - d_ei(k) - d_ej(l))``
    is a bound for any duals; the smallest one is the value of the linear relaxation.

    Parameters
    ----------
    unary, edges, agreement, pairwise
        See :func:`pgm_places.solvers.pairwise.pairwise_model`.
    duals : (2 E, K) float
        Message of each edge to its nodes: row ``2 e`` to the second, row ``2 e + 1`` to the first.
        -inf rules the label out at that node; the bound then holds for labellings without it.

    Notes
    -----
    T. Werner, "A linear programming approach to max-sum problem: a review" (PAMI 2007); D. Sontag,
    A. Globerson and T. Jaakkola, "Introduction to dual decomposition for inference" (2011).

    Examples
    --------
    >>> unary, edges, agreement = [[1.0, 0.0], [0.0, 0.4]], [(0, 1)], [[0.5, 0.5]]
    >>> dual_bound(unary, edges, agreement, duals=np.zeros((2, 2)))
    1.9
    >>> dual_bound(unary, edges, agreement, duals=[[0.5, 0.0], [0.0, 0.5]])
    1.5
    """
    model = pairwise_model(unary, edges, agreement, pairwise)
    return dual_value(model, _checked(model, duals))


def reparametrisation(
    unary: ArrayLike,
    edges: ArrayLike | Adjacency,
    agreement: ArrayLike | None = None,
    pairwise: ArrayLike | None = None,
    *,
    duals: ArrayLike,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(N, K) unaries and (E, K, K) tables after moving the duals: every labelling scores the same.

    Parameters are those of :func:`dual_bound`. Labels that the duals rule out are -inf. A node or
    an edge with a unique maximum is decided; if the bound is tight, the maxima are consistent.
    """
    model = pairwise_model(unary, edges, agreement, pairwise)
    moved = _checked(model, duals)
    to_second, to_first = moved[0::2], moved[1::2]
    tables = model.edge_tables
    if pairwise is not None:  # constants belong to the edges, not to a common offset
        tables = np.broadcast_to(np.asarray(pairwise, np.float64), tables.shape)
    with np.errstate(invalid="ignore"):
        left = tables - to_first[:, :, np.newaxis] - to_second[:, np.newaxis, :]
    barred = (to_first == -np.inf)[:, :, np.newaxis] | (to_second == -np.inf)[:, np.newaxis, :]
    return _raised(model, moved), np.where(barred, -np.inf, left)


def dual_value(model: PairwiseModel, duals: NDArray[np.float64]) -> float:
    """The bound of a checked model by its duals (2 E, K): see :func:`dual_bound`."""
    tops = _raised(model, duals).max(axis=1, initial=-np.inf)
    return float(tops.sum() + _left(model, duals).sum() + model.offset)


def cut_duals(model: PairwiseModel) -> NDArray[np.float64]:
    """(2 E, K) duals of a regular model of one or two labels, whose bound is the best score.

    An edge's potential is ``c + p a + q b - w |a - b|`` of its labels 0 and 1. A maximum flow
    through edges of capacity w moves the last term to the nodes.
    """
    duals = np.zeros((2 * model.around.n_edges, model.n_labels))
    if model.n_labels < 2:
        return duals
    unary, tables = _finite(model.unary), model.edge_tables  # regular tables are finite
    weight = 0.5 * (tables[:, 0, 0] + tables[:, 1, 1] - tables[:, 0, 1] - tables[:, 1, 0])
    weight = np.maximum(weight, 0.0)  # regular up to rounding
    duals[1::2, 1] = tables[:, 1, 0] - tables[:, 0, 0] + weight
    duals[0::2, 1] = tables[:, 0, 1] - tables[:, 0, 0] + weight
    heads = model.around.edges[:, ::-1].reshape(-1)
    excess = unary[:, 1] - unary[:, 0]
    np.add.at(excess, heads, duals[:, 1])
    capacity = np.repeat(weight, 2)
    space = cut_space(model.n_nodes)
    minimum_cut_kernel(model.n_nodes, model.around.arcs, excess, capacity, space)
    flow = 0.5 * (capacity[1::2] - capacity[0::2])  # from the first node to the second
    duals[1::2, 1] -= flow
    duals[0::2, 1] += flow
    return duals


def _finite(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """-inf replaced by a number that outweighs all others: the bound stays valid."""
    there = np.isfinite(values)
    return np.where(there, values, -2.0 * (1.0 + np.abs(values[there]).sum()))


def _checked(model: PairwiseModel, duals: ArrayLike) -> NDArray[np.float64]:
    shape = (2 * model.around.n_edges, model.n_labels)
    return finite_array("duals", duals, shape, allow_minus_inf=True)


def _raised(model: PairwiseModel, duals: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, K) the unaries plus the duals of all edges."""
    raised = model.unary.copy()
    np.add.at(raised, model.around.edges[:, ::-1].reshape(-1), duals)
    return raised


def _left(model: PairwiseModel, duals: NDArray[np.float64]) -> NDArray[np.float64]:
    """(E,) the maximum of each edge after reparametrisation, O(K) for rewards of agreement."""
    taken = np.where(duals == -np.inf, -np.inf, -duals)
    to_second, to_first = taken[0::2], taken[1::2]
    if model.agreement is None:
        left = model.edge_tables + to_first[:, :, np.newaxis] + to_second[:, np.newaxis, :]
        return np.asarray(left.max(axis=(1, 2), initial=-np.inf))
    agreed = (model.agreement + to_first + to_second).max(axis=1, initial=-np.inf)
    if model.n_labels < 2:
        return np.asarray(agreed)
    here, there = np.argmax(to_first, axis=1), np.argmax(to_second, axis=1)
    row = np.arange(len(here))
    first, second = to_first[row, here], to_second[row, there]
    others = [part.copy() for part in (to_first, to_second)]
    others[0][row, here] = others[1][row, there] = -np.inf
    next_first, next_second = (part.max(axis=1) for part in others)
    same = np.maximum(first + next_second, next_first + second)
    return np.asarray(np.maximum(agreed, np.where(here == there, same, first + second)))
