"""Relaxation labelling on any graph: neighbours revise each other's beliefs in parallel.

The update of every node (paper eq. 4 and 5)::

    q_i(l) = sum_j c_ij sum_m r_ij(l, m) p_j(m)
    p_i(l) <- p_i(l) (1 + q_i(l)) / sum_m p_i(m) (1 + q_i(m))

The compatibilities r are estimated from counts of adjacent labels (eq. 6).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array, integer_array
from pgm_places._core import count_pairs, starting_probabilities, update_parts_of_graph
from pgm_places.errors import InfeasibleError, InputError
from pgm_places.kernels.threads import ThreadTeam, resolve_threads
from pgm_places.solvers.convergence import check_iteration_limits

DIRECTIONS = ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))
"""Row and column steps to the 8 neighbours; the opposite of direction ``d`` is ``7 - d``."""

LOWEST = np.iinfo(np.int64).min


def grid_pair_counts(labels: ArrayLike, n_labels: int) -> NDArray[np.int64]:
    """(8, L, L) ordered neighbour pairs: ``counts[d, l, m]`` cells ``l`` whose neighbour is ``m``.

    Cells (H, W) of negative label are unknown and form no pairs.
    """
    raster = np.asarray(labels)
    integer_array("labels", raster, ("H", "W"), low=LOWEST, high=n_labels)
    if not 1 <= n_labels <= np.iinfo(np.int16).max:
        raise InputError(f"n_labels must be from 1 to {np.iinfo(np.int16).max}, got {n_labels}")
    forward = np.zeros((4, n_labels, n_labels), np.int64)
    count_pairs(np.maximum(raster, -1).astype(np.int16), forward)
    backward = forward[::-1].transpose(0, 2, 1)
    return np.concatenate([backward, forward])


def edge_pair_counts(labels: ArrayLike, edges: ArrayLike, n_labels: int) -> NDArray[np.int64]:
    """(2, L, L) ordered pairs: [0] first node here and second there, [1] the other way round.

    Nodes (N,) of negative label are unknown and form no pairs.
    """
    chosen = np.asarray(labels)
    integer_array("labels", chosen, ("N",), low=LOWEST, high=n_labels)
    pairs = integer_array("edges", edges, ("E", 2), low=0, high=max(len(chosen), 1))
    first, second = chosen[pairs[:, 0]], chosen[pairs[:, 1]]
    known = (first >= 0) & (second >= 0)
    key = first[known].astype(np.int64) * n_labels + second[known]
    counts = np.bincount(key, minlength=n_labels * n_labels).reshape(n_labels, n_labels)
    return np.stack([counts, counts.T])


def yamamoto_coefficients(counts: ArrayLike, *, smoothing: float = 0.0) -> NDArray[np.float64]:
    """(..., L, L) compatibility ``r[l, m]`` of label ``l`` here with ``m`` there, in [-1, 1].

    With p(l) and p(l|m) from the same pairs (paper eq. 6, after Yamamoto)::

        r = (1 - p(l) / p(l|m)) / (1 - p(l))    where p(l) < p(l|m)
        r = p(l|m) / p(l) - 1                   otherwise

    0 is independence, 1 "always", -1 "never"; also 0 for a label that never occurs here or there,
    or is the only one. ``smoothing`` is added to every pair of labels that both occur: without it
    two labels that never touched in training exclude each other.

    Examples
    --------
    >>> yamamoto_coefficients([[8, 2], [2, 8]]).round(3).tolist()
    [[0.75, -0.6], [-0.6, 0.75]]
    """
    table = np.asarray(counts, np.float64)
    if table.ndim < 2 or table.shape[-1] != table.shape[-2]:
        raise InputError(f"counts must have shape (..., L, L), got {table.shape}")
    table = finite_array("counts", table, tuple(table.shape))
    if (table < 0).any() or smoothing < 0:
        raise InputError("counts and smoothing must be at least 0")
    occurs = (table.sum(axis=-1) > 0)[..., :, None] & (table.sum(axis=-2) > 0)[..., None, :]
    table = np.where(occurs, table + smoothing, 0.0)
    total = table.sum(axis=(-2, -1), keepdims=True)
    here = table.sum(axis=-1, keepdims=True)
    there = table.sum(axis=-2, keepdims=True)
    informative = occurs & (here < total)
    # p(l|m) / p(l) from counts, so that equal ratios give exactly 0.
    joint, chance = table * total, here * there
    with np.errstate(divide="ignore", invalid="ignore"):
        attract = (1.0 - chance / joint) / (1.0 - here / total)
        repel = joint / chance - 1.0
    return np.where(informative, np.where(chance < joint, attract, repel), 0.0)


NODES_PER_PART = 4096
LANES, FOUR = 16, 4
"""Vector widths of the kernels: nodes in a row, and labels of a node."""

SUMS = 3
"""Per task: largest change, sum of changes, sum of p q over labels and nodes."""

MOST_ENTRIES = 2**32  # the kernel's indices have 32 bits
GROUPS_PER_THREAD = 2  # so that the others need not wait for an interrupted thread
PARTS_PER_THREAD = 4  # with fewer, starting a thread costs more than it saves

Beliefs = NDArray[np.floating[Any]]

OnIteration = Callable[[int, float, Callable[[], Beliefs]], None]
"""Called after each iteration with its number from 1, the largest change of a belief, and a
function that returns the current beliefs (N, K)."""


class _Neighbours(NamedTuple):
    """Neighbours in compressed rows: row ``i D + d`` has the entries of node i, table d."""

    start: NDArray[np.uint32]
    """(N D + 1,)."""
    place: NDArray[np.uint32]
    """(A,) start of the neighbour's beliefs: P times its index."""
    weight: NDArray[np.float64]
    """(A,) weight c_ij, or (N,) if a node's neighbours have equal weights."""
    shared: bool
    """Whether weights are per node."""


@dataclass(frozen=True, eq=False)
class Relaxed:
    """The result of relaxation labelling."""

    beliefs: Beliefs
    """(N, K) rows sum to one."""
    converged: bool
    """Whether no belief changed by more than the tolerance in the last iteration."""
    max_change: list[float] = field(default_factory=list)
    mean_change: list[float] = field(default_factory=list)
    """Largest and mean absolute change of a belief, per iteration."""
    support: list[float] = field(default_factory=list)
    """Average local consistency before each iteration: mean over nodes of ``sum_l p(l) q(l)``."""

    @property
    def iterations(self) -> int:
        """Number of iterations."""
        return len(self.max_change)


def starting_beliefs(
    unary: ArrayLike, *, floor: float = 0.0, first_node: int = 0
) -> NDArray[np.float64]:
    """(N, K) probabilities from log-probabilities (N, K) up to a constant per row; -inf stays 0.

    Smaller positive probabilities are raised to ``floor`` before rows are normalised again: a
    product update cannot change a belief of 0. Errors count nodes from ``first_node``.
    """
    array = finite_array("unary", unary, ("N", "K"), allow_minus_inf=True)
    row = np.empty(array.size + LANES)
    stopped = starting_probabilities(np.ascontiguousarray(array), float(floor), row)
    if stopped >= 0:
        raise InfeasibleError(f"unary forbids every label at node {first_node + stopped}")
    return row[: array.size].reshape(array.shape)


def relax_graph(
    unary: ArrayLike,
    start: ArrayLike,
    node: ArrayLike,
    compatibility: ArrayLike,
    *,
    weight: ArrayLike | None = None,
    table: ArrayLike | None = None,
    floor: float = 0.0,
    damping: float = 0.0,
    max_iterations: int = 50,
    tolerance: float = 1e-4,
    on_iteration: OnIteration | None = None,
    _most_entries: int = MOST_ENTRIES,
) -> Relaxed:
    """Relaxed beliefs on any graph, in double precision; the same bits for any thread count.

    Each iteration computes the support ``q_i(l) = sum_j c_ij sum_m r[l, m] p_j(m)`` (paper eq. 5)
    and multiplies every belief ``p_i(l)`` by ``1 + q_i(l)``, normalised (eq. 4).

    The neighbours of ``i`` are ``node[start[i]:start[i + 1]]``. For each entry of ``node`` (A,),
    ``weight`` is ``c_ij`` (at most 1 in sum at each node; default 1 / degree) and ``table`` the
    index in ``compatibility`` (D, K, K) of ``r[d, l, m]`` in [-1, 1], label ``l`` here and ``m`` at
    the neighbour; default 0. Other options are those of
    :class:`pgm_places.models.relaxation.Relaxation`.

    A. Rosenfeld, R. Hummel, S. Zucker, "Scene labeling by relaxation operations" (IEEE Transactions
    on Systems, Man, and Cybernetics 1976).
    """
    check_iteration_limits(max_iterations, tolerance, damping, fewest=0)
    beliefs = starting_beliefs(unary, floor=floor)
    n_nodes, n_labels = beliefs.shape
    rows = integer_array("start", start, (n_nodes + 1,), low=0, high=2**62)
    neighbour = integer_array("node", node, ("A",), low=0, high=max(n_nodes, 1))
    tables = check_tables(compatibility, n_labels)
    if rows[0] != 0 or rows[-1] != len(neighbour) or (np.diff(rows) < 0).any():
        raise InputError(f"start must rise from 0 to the {len(neighbour)} entries of node")
    which = None
    if table is not None:
        which = integer_array("table", table, neighbour.shape, low=0, high=len(tables))
    width = FOUR * -(-n_labels // FOUR)
    if max(n_nodes * width, len(neighbour)) >= _most_entries:
        raise InputError(
            f"relaxation takes fewer than {_most_entries:,} entries of node and beliefs (labels "
            f"counted up to a multiple of four), got {len(neighbour):,} and {n_nodes * width:,}"
        )
    share, shared = _check_weights(weight, rows)
    around = _neighbours(rows, width * neighbour, share, shared, which, len(tables))
    padded, across = _padded(beliefs, tables, width)
    begin = np.append(np.arange(0, n_nodes, NODES_PER_PART), n_nodes)
    threads = useful_threads(len(begin) - 1)
    groups = thread_groups(len(begin) - 1, threads)
    sums = np.zeros((len(begin) - 1, SUMS))
    buffers = padded, padded.copy()
    calls = [
        [
            partial(
                update_parts_of_graph,
                *(old, around, across, float(damping), *group, begin, width, new, sums),
            )
            for group in groups
        ]
        for old, new in (buffers, buffers[::-1])
    ]

    def after(iterations: int) -> NDArray[np.float64]:
        wide = buffers[iterations % 2].reshape(-1, width)[:, :n_labels]
        return wide / wide.sum(axis=1, keepdims=True)

    limits = max_iterations, tolerance
    return repeat(calls, sums, threads, beliefs.shape, after, *limits, on_iteration)


def repeat(
    calls: list[list[partial[None]]],
    sums: NDArray[np.float64],
    threads: int,
    shape: tuple[int, ...],
    after: Callable[[int], Beliefs],
    max_iterations: int,
    tolerance: float,
    on_iteration: OnIteration | None,
    last: Callable[[], Beliefs] | None = None,
) -> Relaxed:
    """Iterate until no belief changes by more than the tolerance; the result with its history.

    ``calls`` are the kernel calls of an odd and of an even iteration, shared by threads, which
    write ``sums``. ``after(n)`` returns the beliefs after ``n`` iterations, ``last`` the final
    ones.
    """
    n_nodes, n_labels = shape
    max_change: list[float] = []
    mean_change: list[float] = []
    support: list[float] = []
    converged = n_nodes == 0
    with ThreadTeam(threads) as crew:
        while not converged and len(max_change) < max_iterations:
            crew.run(lambda group: calls[len(max_change) % 2][group](), len(calls[0]))
            max_change.append(float(sums[:, 0].max()))
            mean_change.append(math.fsum(sums[:, 1]) / (n_nodes * n_labels))
            support.append(math.fsum(sums[:, 2]) / n_nodes)
            converged = max_change[-1] <= tolerance
            if on_iteration is not None:
                on_iteration(len(max_change), max_change[-1], partial(after, len(max_change)))
    beliefs = after(len(max_change)) if last is None else last()
    return Relaxed(beliefs, converged, max_change, mean_change, support)


def useful_threads(n_parts: int, parts_per_thread: int = PARTS_PER_THREAD) -> int:
    """The requested number of threads, or fewer if there is little work."""
    return max(1, min(resolve_threads(), n_parts // parts_per_thread))


def thread_groups(n_parts: int, threads: int) -> list[tuple[int, int]]:
    """First part and end of each group of parts that a thread processes."""
    cuts = np.linspace(0, n_parts, (GROUPS_PER_THREAD * threads if threads > 1 else 1) + 1)
    return list(pairwise(cuts.astype(int).tolist()))


def check_tables(compatibility: ArrayLike, n_labels: int) -> NDArray[np.float64]:
    """The compatibility tables (D, n_labels, n_labels), contiguous and in [-1, 1]."""
    tables = finite_array("compatibility", compatibility, ("D", n_labels, n_labels))
    if not len(tables) or np.abs(tables).max(initial=0.0) > 1:
        raise InputError("compatibility must hold at least one table of numbers from -1 to 1")
    return np.ascontiguousarray(tables)


def _check_weights(
    weight: ArrayLike | None, rows: NDArray[np.int64]
) -> tuple[NDArray[np.float64], bool]:
    """Weights per node if its neighbours have equal ones, else per entry; whether per node."""
    degree = np.diff(rows)
    if weight is None:
        return 1.0 / np.maximum(degree, 1), True
    share = finite_array("weight", weight, (int(rows[-1]),))
    alike = np.zeros(len(degree))
    alike[degree > 0] = share[rows[:-1][degree > 0]]
    shared = bool((np.repeat(alike, degree) == share).all())
    if shared:
        most = (alike * degree).max(initial=0.0)
    else:
        owner = np.repeat(np.arange(len(degree)), degree)
        most = np.bincount(owner, weights=share, minlength=1).max()
    if (share < 0).any() or most > 1 + 1e-9:
        raise InputError(
            f"weight must be at least 0 and sum to at most 1 at each node, got a sum of {most:g}"
        )
    return alike if shared else np.ascontiguousarray(share), shared


def _neighbours(
    rows: NDArray[np.int64],
    place: NDArray[np.int64],
    weight: NDArray[np.float64],
    shared: bool,
    table: NDArray[np.int64] | None,
    n_tables: int,
) -> _Neighbours:
    """The adjacency for the kernel, each node's entries by table."""
    n_nodes = len(rows) - 1
    if n_tables > 1:
        row = np.repeat(np.arange(n_nodes) * n_tables, np.diff(rows))
        if table is not None:
            row += table
        order = np.argsort(row, kind="stable")
        place = place[order]
        weight = weight if shared else weight[order]
        counts = np.bincount(row, minlength=n_nodes * n_tables)
        rows = np.concatenate([[0], np.cumsum(counts)])
    return _Neighbours(rows.astype(np.uint32), place.astype(np.uint32), weight, shared)


def _padded(
    beliefs: NDArray[np.float64], tables: NDArray[np.float64], width: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Beliefs and tables flat for the kernel: labels padded, tables by the neighbour's label."""
    n_nodes, n_labels = beliefs.shape
    wide = np.zeros((n_nodes, width))
    wide[:, :n_labels] = beliefs
    across = np.zeros((len(tables), width, width))
    across[:, :n_labels, :n_labels] = tables.transpose(0, 2, 1)
    return wide.ravel(), across.ravel()
