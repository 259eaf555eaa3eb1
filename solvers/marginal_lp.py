"""The LP relaxation of MAP decoding: its optimum, an upper bound of all scores, and its duals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array, frozen_copy
from pgm_places._core import decode_beliefs, minimum_cut_kernel
from pgm_places.errors import InfeasibleError, SolverError
from pgm_places.solvers.adjacency import Adjacency
from pgm_places.solvers.elimination import lifted_duals, reduce_model
from pgm_places.solvers.graph_cut import cut_space
from pgm_places.solvers.local_search import improved_modes
from pgm_places.solvers.pairwise import PairwiseModel, pairwise_model, total_score


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
    is a bound for any duals; the smallest one is the value of the linear relaxation. ``duals``
    (2 E, K) are messages of each edge to its nodes: row ``2 e`` to the second, ``2 e + 1`` to the
    first. -inf rules a label out at a node; the bound then holds for labellings without it.

    T. Werner, "A linear programming approach to max-sum problem: a review" (PAMI 2007); D. Sontag,
    A. Globerson and T. Jaakkola, "Introduction to dual decomposition for inference" (2011).

    Examples
    --------
    >>> unary, edges, agreement = [[1.0, 0.0], [0.0, 0.4]], [(0, 1)], [[0.5, 0.5]]
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

    Parameters as of :func:`dual_bound`. A node or an edge with a unique maximum is decided; if the
    bound is tight, the maxima are consistent.
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


_INTEGRAL = 1e-6
"""A marginal this close to 0 or 1 counts as integral: ten times the solver's own tolerance."""


@dataclass(frozen=True, eq=False)
class LPDecoding:
    """A labelling with the relaxation's bound."""

    labels: NDArray[np.int64]
    """(N,) the label with the largest marginal at each node, improved by local search where
    marginals are fractional."""
    score: float
    """Their log-potential."""
    bound: float
    """The relaxation's value: no labelling scores more."""
    integral: bool
    """Whether all node marginals are 0 or 1; then ``labels`` is optimal."""
    node_marginals: NDArray[np.float64]
    """(N, K) the relaxation's solution; rows sum to one."""
    duals: NDArray[np.float64]
    """(2 E, K) the dual variables that give the bound
    (:func:`pgm_places.solvers.marginal_lp.dual_bound`)."""


def solve_marginal_lp(model: PairwiseModel, *, eliminate: bool = True) -> LPDecoding:
    """The linear relaxation solved by HiGHS, and its rounding, improved by local search.

    For ``agreement >= 0`` one variable per edge and label, ``y_ij^k <= y_i^k`` and
    ``y_ij^k <= y_j^k`` (Taskar, Chatalbashev and Koller, ICML 2004); else the local polytope, whose
    edge marginals sum to their nodes'. Two labels with associative potentials, and forests, always
    come out integral. For large grids :func:`pgm_places.solvers.trws.trws` comes close to the same
    bound in a fraction of the time. InputError if no labelling is allowed, SolverError if HiGHS
    ends without an optimum.

    Examples
    --------
    >>> from pgm_places.solvers.pairwise import pairwise_model
    >>> model = pairwise_model([[1.0, 0.0], [0.0, 0.4]], [(0, 1)], [[0.5, 0.5]])
    >>> relaxed = solve_marginal_lp(model)
    >>> relaxed.labels.tolist(), round(relaxed.bound, 6), relaxed.integral
    ([0, 0], 1.5, True)
    """
    left, nodes = model, np.arange(model.n_nodes)
    marginals = np.zeros(model.unary.shape)
    if eliminate:
        reduced = reduce_model(model)
        left, nodes = reduced.model, reduced.nodes
        marginals[np.arange(model.n_nodes), reduced.labels] = 1.0
    marginals[nodes], duals = _solve(left)
    value = dual_value(left, duals)
    if eliminate:
        duals = lifted_duals(model, reduced, duals)
    labels, score = _rounded(model, marginals)
    integral = bool((np.minimum(marginals, 1.0 - marginals) <= _INTEGRAL).all())
    return LPDecoding(
        labels=frozen_copy(labels.astype(np.int64)),
        score=score,
        bound=max(value, score),
        integral=integral,
        node_marginals=frozen_copy(marginals),
        duals=frozen_copy(duals),
    )


def _rounded(
    model: PairwiseModel, marginals: NDArray[np.float64]
) -> tuple[NDArray[np.int32], float]:
    """The better local optimum (N,) from two roundings (maximum; sequential), and its score."""
    in_turn = np.empty(model.n_nodes, np.int32)
    surest_first = np.argsort(-marginals.max(axis=1), kind="stable").astype(np.uint32)
    expected = _expected(model, marginals)
    decode_beliefs(model.terms, model.around.arcs, surest_first, expected, np.inf, in_turn)
    best, best_score = in_turn, -np.inf
    for labels in (marginals.argmax(axis=1).astype(np.int32), in_turn):
        improved_modes(model, labels)
        score = total_score(model, labels)
        if score > best_score:
            best, best_score = labels, score
    return best, best_score


def _expected(model: PairwiseModel, marginals: NDArray[np.float64]) -> NDArray[np.float64]:
    """(2 E, K) by arc, the expected potential of the edge for each label of the arc's head."""
    ends = marginals[model.around.edges]
    if model.agreement is not None:
        return (ends * model.agreement[:, None]).reshape(-1, model.n_labels)
    allowed = model.edge_tables > -np.inf
    gains = np.where(allowed, model.edge_tables, 0.0)
    expected = np.empty(ends.shape)
    for side, sums in enumerate(("ea,eab->eb", "eb,eab->ea")):
        barred = np.einsum(sums, ends[:, side], ~allowed) > _INTEGRAL
        expected[:, side] = np.where(barred, -np.inf, np.einsum(sums, ends[:, side], gains))
    return expected.reshape(-1, model.n_labels)


def _solve(model: PairwiseModel) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Node marginals (N, K) and duals (2 E, K), which give the relaxation's value."""
    if model.n_nodes == 0:
        return np.zeros(model.unary.shape), np.zeros((0, model.n_labels))
    if model.agreement is not None and (model.agreement >= 0).all():
        gains, upper, equal, right = _associative_form(model, model.agreement)
    else:
        gains, upper, equal, right = _local_polytope(model)
    possible = gains > -np.inf
    # The solver's tolerances are absolute: make them independent of the objective's scale.
    scale = max(float(np.abs(gains[possible]).max(initial=0.0)), 1e-300)
    result = _call_highs(
        -np.where(possible, gains, 0.0) / scale,
        A_ub=upper,
        b_ub=None if upper is None else np.zeros(upper.shape[0]),
        A_eq=equal,
        b_eq=right,
        bounds=np.stack([np.zeros(len(gains)), np.where(possible, 1.0, 0.0)], axis=1),
        method="highs",
    )
    marginals = np.clip(result.x[: model.unary.size].reshape(model.unary.shape), 0.0, 1.0)
    marginals = marginals / marginals.sum(axis=1, keepdims=True) + 0.0  # no negative zeros
    if upper is not None:
        return marginals, associative_duals(model, -scale * result.ineqlin.marginals)
    return marginals, polytope_duals(model, -scale * result.eqlin.marginals[model.n_nodes :])


def _call_highs(*args: Any, **options: Any) -> Any:
    from scipy.optimize import linprog

    solve: Any = linprog
    result = solve(*args, **options)
    if result.status == 2:
        raise InfeasibleError
    if result.status != 0:
        raise SolverError(
            f"the linear relaxation was not solved: HiGHS ended with status {result.status} "
            f"({result.message}); try 'trw-s', which always gives a bound"
        )
    return result


def associative_duals(model: PairwiseModel, prices: NDArray[np.float64]) -> NDArray[np.float64]:
    """(2 E, K) duals of the associative form, corrected to be feasible, so that the bound is valid.

    Each edge splits its reward between its ends, ``a + b >= agreement``, ``a, b >= 0``.
    """
    assert model.agreement is not None  # the caller chose this form for it
    first = np.maximum(prices[: model.agreement.size].reshape(model.agreement.shape), 0.0)
    second = np.maximum(model.agreement - first, 0.0)
    return np.stack([second, first], axis=1).reshape(-1, model.n_labels)


def polytope_duals(model: PairwiseModel, prices: NDArray[np.float64]) -> NDArray[np.float64]:
    """(2 E, K) duals of the local polytope: message of each edge to its ends."""
    to_first, to_second = prices.reshape(2, model.around.n_edges, model.n_labels)
    return np.stack([to_second, to_first], axis=1).reshape(-1, model.n_labels)


_Form = tuple[NDArray[np.float64], sp.csr_array | None, sp.csr_array, NDArray[np.float64]]
"""Objective, inequality rows (at most 0), equality rows, right-hand sides of the equalities."""


def _associative_form(model: PairwiseModel, agreement: NDArray[np.float64]) -> _Form:
    """``y_ij^k - y_i^k <= 0`` and ``y_ij^k - y_j^k <= 0`` for every edge and label."""
    n_nodes, n_labels = model.unary.shape
    n_pairs = agreement.size
    upper = sp.vstack(
        [
            sp.hstack([-_picks(ends, n_labels, n_nodes), sp.eye_array(n_pairs)])
            for ends in model.around.edges.T
        ],
        format="csr",
    )
    gains = np.concatenate([model.unary.ravel(), agreement.ravel()])
    equal = sp.hstack(
        [_row_sums(n_nodes, n_labels), sp.csr_array((n_nodes, n_pairs))], format="csr"
    )
    return gains, upper, equal, np.ones(n_nodes)


def _local_polytope(model: PairwiseModel) -> _Form:
    """``sum_l y_ij^kl = y_i^k`` and ``sum_k y_ij^kl = y_j^l``."""
    n_nodes, n_labels = model.unary.shape
    n_edges = model.around.n_edges
    tables = model.edge_tables
    pair = np.arange(tables.size).reshape(tables.shape)
    first = pair.reshape(-1)
    second = pair.transpose(0, 2, 1).reshape(-1)
    sums = np.repeat(np.arange(n_edges * n_labels), n_labels)
    ones = np.ones(tables.size)
    size = (n_edges * n_labels, tables.size)
    blocks = [[_row_sums(n_nodes, n_labels), sp.csr_array((n_nodes, tables.size))]]
    for side, columns in ((0, first), (1, second)):
        picks = _picks(model.around.edges[:, side], n_labels, n_nodes)
        blocks.append([-picks, sp.csr_array((ones, (sums, columns)), shape=size)])
    equal = sp.csr_array(sp.block_array(blocks))
    right = np.concatenate([np.ones(n_nodes), np.zeros(2 * n_edges * n_labels)])
    return np.concatenate([model.unary.ravel(), tables.ravel()]), None, equal, right


def _row_sums(n_nodes: int, n_labels: int) -> sp.csr_array:
    """Rows that sum each node's labels."""
    rows = np.repeat(np.arange(n_nodes), n_labels)
    size = n_nodes * n_labels
    return sp.csr_array((np.ones(size), (rows, np.arange(size))), shape=(n_nodes, size))


def _picks(nodes: NDArray[np.int32], n_labels: int, n_nodes: int) -> sp.csr_array:
    """One row per edge and label that picks the label at that end of the edge."""
    columns = (nodes.astype(np.int64)[:, None] * n_labels + np.arange(n_labels)).ravel()
    rows = np.arange(len(columns))
    shape = (len(columns), n_nodes * n_labels)
    return sp.csr_array((np.ones(len(columns)), (rows, columns)), shape=shape)
