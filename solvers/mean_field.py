"""Mean-field approximation: independent beliefs closest to the model, on graphs and rasters."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise as neighbours

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array, freeze, frozen_copy, integer_array, row_blocks
from pgm_places._core import mean_field_pass, row_starts, set_mean_field_pass, update_rows
from pgm_places.errors import InfeasibleError, InputError
from pgm_places.kernels.threads import resolve_threads, run_tasks
from pgm_places.solvers.convergence import check_iteration_limits, until_converged
from pgm_places.solvers.pairwise import PairwiseModel, total_score
from pgm_places.solvers.set_terms import SetTables, set_slots, set_unit

__all__ = ["MeanField", "mean_field"]


@dataclass(frozen=True, eq=False)
class MeanField:
    """Mean-field beliefs of nodes, and their most probable labels."""

    labels: NDArray[np.int64]
    """(N,) the most probable label per node."""
    score: float
    """The labels' log-potential, without the rewards of sets."""
    beliefs: NDArray[np.float64]
    """(N, K) probability of each label; rows sum to one."""
    converged: bool
    """Whether the last pass changed no belief by more than the tolerance."""
    history: NDArray[np.float64]
    """(T,) largest change of a belief in each pass."""


def mean_field(
    model: PairwiseModel,
    *,
    sets: SetTables | None = None,
    damping: float = 0.0,
    tolerance: float = 1e-4,
    max_iterations: int = 100,
    on_iteration: Callable[[int, float], None] | None = None,
) -> MeanField:
    """Independent beliefs ``q`` that locally minimise ``KL(q || p)`` of the Markov random field.

    Nodes are updated one after the other, from the normalised unaries, so that without damping
    (weight of the old belief, from 0 to below 1) the bound of the partition function never falls. A
    node whose neighbours together forbid every label (-inf) does not change. Passes end when no
    belief changes by more than ``tolerance``, in units of the potentials
    (:attr:`PairwiseModel.unit <pgm_places.solvers.pairwise.PairwiseModel.unit>`) of at most 1.
    ``sets`` are from :func:`pgm_places.solvers.set_terms.set_tables`; ``on_iteration`` gets the
    number of each pass and its largest change.

    Examples
    --------
    >>> from pgm_places.solvers.pairwise import pairwise_model
    >>> field = mean_field(pairwise_model([[1.0, 0.0], [0.0, 0.4]], [(0, 1)], [[0.5, 0.5]]))
    >>> field.labels.tolist(), field.beliefs.sum(axis=1).tolist()
    ([0, 1], [1.0, 1.0])
    """
    check_iteration_limits(max_iterations, tolerance, damping)
    beliefs = normalised(model.unary)
    threshold = tolerance * min(set_unit(model, sets), 1.0)
    kernel = mean_field_pass if sets is None else set_mean_field_pass
    arguments = damping, model.terms, model.around.arcs, *set_slots(model, sets), beliefs
    history = until_converged(lambda _: kernel(*arguments), threshold, max_iterations, on_iteration)
    labels = beliefs.argmax(axis=1)
    return MeanField(
        labels=frozen_copy(labels),
        score=total_score(model, labels),
        beliefs=frozen_copy(beliefs),
        converged=history[-1] <= threshold,
        history=frozen_copy(np.array(history)),
    )


def normalised(log_beliefs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows of log-values (N, K) as probabilities that sum to one."""
    beliefs = np.exp(log_beliefs - log_beliefs.max(axis=1, keepdims=True, initial=-np.inf))
    beliefs /= beliefs.sum(axis=1, keepdims=True)
    return np.asarray(beliefs)


_NODES_PER_TASK = 32_768
"""Below this, starting a thread costs more than it saves."""


@dataclass(frozen=True, eq=False)
class GridMeanField:
    """Mean-field beliefs of cells, and their most probable labels."""

    labels: NDArray[np.int64]
    """(N,) the most probable label per node."""
    beliefs: NDArray[np.float32]
    """(N, K) probability of each label; rows sum to one."""
    converged: bool
    """Whether the last pass changed no belief by more than the tolerance."""
    history: NDArray[np.float64]
    """(T,) largest change of a belief in each pass."""


def grid_mean_field(
    unary: ArrayLike,
    cells_rc: ArrayLike,
    pairwise: ArrayLike | None = None,
    *,
    connectivity: int = 8,
    damping: float = 0.0,
    tolerance: float = 1e-4,
    max_iterations: int = 100,
    on_iteration: Callable[[int, float], None] | None = None,
) -> GridMeanField:
    """Independent beliefs of a raster's cells that locally minimise ``KL(q || p)``.

    As :func:`~pgm_places.solvers.mean_field.mean_field`, for one table (K, K) on all edges: rows
    are the label at the earlier node, columns at the later one. ``cells_rc`` (N, 2) are sorted row
    by row, from left to right; neighbours share a side, with ``connectivity`` 8 also a corner. A
    pass updates the even rows first, then the odd ones, each from left to right. Rows of equal
    parity do not touch, so results are identical for any number of threads. ``4 K`` bytes a node
    beside input and labels.

    Examples
    --------
    >>> cells = [(0, 0), (0, 1), (0, 2)]
    >>> unary = np.log([[0.9, 0.1], [0.4, 0.6], [0.9, 0.1]])
    >>> grid_mean_field(unary, cells, np.eye(2)).labels.tolist()
    [0, 0, 0]
    """
    check_iteration_limits(max_iterations, tolerance, damping)
    if connectivity not in (4, 8):
        raise InputError(f"connectivity must be 4 or 8, got {connectivity}")
    nodes = np.ascontiguousarray(finite_array("unary", unary, ("N", "K"), allow_minus_inf=True))
    n_nodes, n_labels = nodes.shape
    table = np.zeros((n_labels, n_labels))
    if pairwise is not None:
        checked = finite_array("pairwise", pairwise, table.shape, allow_minus_inf=True)
        table = np.ascontiguousarray(checked)
    cells, start = _rows_of(cells_rc, n_nodes)
    threads = min(resolve_threads(), -(-n_nodes // _NODES_PER_TASK) or 1)
    reach = 1 if connectivity == 8 else 0
    beliefs = _start(nodes)
    tasks = _split(start)
    largest = np.zeros(len(tasks))

    def update(parity: int, task: int) -> None:
        first, last = tasks[task]
        rows = (first + (first + parity) % 2, last)
        change = update_rows(nodes, table, cells, start, *rows, reach, damping, beliefs)
        largest[task] = max(largest[task], change)

    def full_pass(_: int) -> float:
        largest[:] = 0.0
        for parity in (0, 1):
            run_tasks(partial(update, parity), len(tasks), n_threads=threads)
        return float(largest.max(initial=0.0))

    history = until_converged(full_pass, tolerance, max_iterations, on_iteration)
    return GridMeanField(
        labels=freeze(beliefs.argmax(axis=1)),
        beliefs=freeze(beliefs),
        converged=history[-1] <= tolerance,
        history=freeze(np.array(history)),
    )


def _rows_of(cells_rc: ArrayLike, n_nodes: int) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """The cells (N, 2), and the first node of each row (H + 1,)."""
    checked = np.asarray(cells_rc).reshape(-1, 2) if not n_nodes else np.asarray(cells_rc)
    integer_array("cells_rc", checked, (n_nodes, 2), low=0, high=np.iinfo(np.int32).max)
    cells = np.ascontiguousarray(checked, np.int32)
    start = np.zeros((int(cells[:, 0].max()) + 2) if n_nodes else 1, np.int64)
    wrong = row_starts(cells, start)
    if wrong >= 0:
        raise InputError(
            f"cells_rc must go row by row and from left to right, each cell once, but node {wrong} "
            f"at {tuple(cells[wrong].tolist())} follows {tuple(cells[wrong - 1].tolist())}"
        )
    return cells, start


def _start(unary: NDArray[np.float64]) -> NDArray[np.float32]:
    """(N, K) the normalised unaries, computed in blocks to save memory."""
    beliefs = np.empty(unary.shape, np.float32)
    for some in row_blocks(len(unary)):
        barred = some.start + np.flatnonzero(unary[some].max(axis=1, initial=-np.inf) == -np.inf)
        if len(barred):
            raise InfeasibleError(
                f"unary forbids every label at node {barred[0]}; allow at least one"
            )
        beliefs[some] = normalised(unary[some])
    return beliefs


def _split(start: NDArray[np.int64]) -> list[tuple[int, int]]:
    """Ranges of rows with about one task's worth of nodes each."""
    n_rows = len(start) - 1
    wanted = np.arange(0, start[-1], _NODES_PER_TASK)
    first = np.unique(np.searchsorted(start, wanted, "right") - 1)
    return list(neighbours([*first.tolist(), n_rows]))
