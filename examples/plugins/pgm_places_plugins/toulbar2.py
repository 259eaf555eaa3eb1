"""Branch and bound by toulbar2: the best labelling of hard problems, with proof.

toulbar2 (https://toulbar2.github.io/toulbar2) is a package of its own: ``pip install pytoulbar2``.
The entry point in ``pyproject.toml`` makes it the decoder ``"toulbar2"``.
"""

import importlib
import math
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InfeasibleError, InputError
from pgm_places.inference.labeling import Status
from pgm_places.models.decoders import DecodingAnswer, DecodingTask
from pgm_places.solvers.bucket_tree import Factor
from pgm_places.solvers.pairwise import PairwiseModel
from pgm_places.solvers.trws import trws

MAX_BACKTRACKS = 1_000_000
"""Default limit of backtracks, some minutes."""

FIRST_PASSES = 50
"""Of TRW-S, for a labelling to begin with."""

_COSTS = 2**56
"""toulbar2 adds up whole numbers below 2**58; costs are rounded down to parts of this."""

_EPSILON = float(np.finfo(np.float64).eps)
_one_at_a_time = threading.Lock()
"""toulbar2 keeps its state in global variables."""

Array = NDArray[np.float64]


def decode_by_toulbar2(task: DecodingTask) -> DecodingAnswer:
    """The decoder; it counts backtracks as its iterations."""
    limit = MAX_BACKTRACKS if task.limit is None else task.limit
    best = exact_search(task.model, max_backtracks=limit)
    status = Status.CONVERGED if best.complete else Status.STOPPED  # EXACT if the bound proves it
    return DecodingAnswer(best.labels, status, best.bound, info={"backtracks": best.backtracks})


@dataclass(frozen=True, eq=False)
class ExactSearch:
    """The best labelling that was found.

    Parameters
    ----------
    labels : (N,) int
        Label index per node.
    bound : float
        No labelling scores more; above the score by no more than rounding if ``complete``.
    complete : bool
        Whether the search came to its end.
    backtracks : int
        How often a choice was taken back.
    """

    labels: NDArray[np.int64]
    bound: float
    complete: bool
    backtracks: int


def exact_search(model: PairwiseModel, *, max_backtracks: int = MAX_BACKTRACKS) -> ExactSearch:
    """The best labelling of a pairwise model, searched to the end or to a limit.

    Parameters
    ----------
    model : PairwiseModel
        The potentials, from :func:`~pgm_places.solvers.pairwise.pairwise_model`.
    max_backtracks : int
        Most backtracks of the search.

    Raises
    ------
    InputError
        toulbar2 is not installed.
    InfeasibleError
        It is proved that no labelling is allowed.

    Notes
    -----
    D. Allouche et al., "Anytime hybrid best-first search with tree decomposition for weighted CSP",
    CP 2015. TRW-S gives the labelling to begin with; what costs more than that cannot be part of a
    better one, so that large negative numbers in tables do not make the costs coarser.
    """
    toulbar2()
    first = trws(model, max_iterations=FIRST_PASSES)
    if first.bound <= first.score:
        return ExactSearch(first.labels, first.bound, complete=True, backtracks=0)
    initial = first.labels if first.score > -np.inf else None
    factors = [Factor((i,), row) for i, row in enumerate(model.unary)]
    pairs = zip(model.around.edges.tolist(), model.edge_tables, strict=True)
    factors += [Factor((i, j), table) for (i, j), table in pairs]
    sizes = [model.n_labels] * model.n_nodes
    search = search_factors(sizes, factors, initial=initial, max_backtracks=max_backtracks)
    bound = min(first.bound, search.bound + model.offset)
    return ExactSearch(search.labels, bound, search.complete, search.backtracks)


def search_factors(
    sizes: Sequence[int],
    factors: Sequence[Factor],
    *,
    initial: NDArray[np.int64] | None = None,
    max_backtracks: int = MAX_BACKTRACKS,
) -> ExactSearch:
    """The same for factors of any order over nodes of ``sizes`` labels.

    ``initial`` (N,) is an allowed labelling to begin with.

    Raises
    ------
    InputError
        toulbar2 is not installed.
    InfeasibleError
        It is proved that no labelling is allowed. Where the limit came before one was found, the
        labels are zeros.
    """
    package = toulbar2()
    wide = np.flatnonzero(np.asarray(sizes, np.int64) > 1)
    if len(wide) < len(sizes):
        return _of_wide_nodes(sizes, factors, wide, initial, max_backtracks)
    top = [float(factor.table.max()) for factor in factors]
    if -np.inf in top:
        raise InfeasibleError
    costs = [t - factor.table for t, factor in zip(top, factors, strict=True)]
    whole, magnitudes = math.fsum(top), math.fsum(map(abs, top))
    if initial is None:
        most = math.fsum(float(cost[np.isfinite(cost)].max()) for cost in costs)
    else:
        most = _cost(factors, costs, initial)
        costs = [np.where(cost > most * (1 + 1e-9), np.inf, cost) for cost in costs]
    scale = 2.0 ** math.floor(math.log2(_COSTS / most)) if most > 0 else 1.0
    rounded = [np.floor(cost * scale) for cost in costs]
    ceiling = None if initial is None else _cost(factors, rounded, initial)
    with _one_at_a_time:
        labels, least, done, backtracks = _solved(
            package, sizes, factors, rounded, ceiling, max_backtracks
        )
    if labels is None and initial is None and done:
        raise InfeasibleError
    if labels is None:
        labels = np.zeros(len(sizes), np.int64) if initial is None else initial
    slack = 4 * _EPSILON * (magnitudes + least / scale)
    return ExactSearch(labels, whole - least / scale + slack, done, backtracks)


def _of_wide_nodes(
    sizes: Sequence[int],
    factors: Sequence[Factor],
    wide: NDArray[np.int64],
    initial: NDArray[np.int64] | None,
    max_backtracks: int,
) -> ExactSearch:
    """The same without nodes of one label, on which toulbar2 ends the process."""
    number = {node: new for new, node in enumerate(wide.tolist())}
    inner = [[node for node in factor.scope if node in number] for factor in factors]
    constants = [
        float(f.table.item()) for f, nodes in zip(factors, inner, strict=True) if not nodes
    ]
    if -np.inf in constants:
        raise InfeasibleError
    kept = [
        Factor(tuple(number[node] for node in nodes), table.reshape([sizes[n] for n in nodes]))
        for (_, table), nodes in zip(factors, inner, strict=True)
        if nodes
    ]
    labels = np.zeros(len(sizes), np.int64)
    bound = math.fsum(constants) + 4 * _EPSILON * math.fsum(map(abs, constants))
    if not len(wide):
        return ExactSearch(labels, bound, complete=True, backtracks=0)
    first = None if initial is None else initial[wide]
    within = [sizes[node] for node in wide]
    found = search_factors(within, kept, initial=first, max_backtracks=max_backtracks)
    labels[wide] = found.labels
    return ExactSearch(labels, bound + found.bound, found.complete, found.backtracks)


def _cost(factors: Sequence[Factor], costs: Sequence[Array], labels: NDArray[np.int64]) -> float:
    """What a labelling costs."""
    pairs = zip(factors, costs, strict=True)
    return math.fsum(float(cost[tuple(labels[list(factor.scope)])]) for factor, cost in pairs)


def toulbar2() -> Any:
    """The package, or one line on how to install it."""
    try:
        return importlib.import_module("pytoulbar2")
    except ImportError as error:
        raise InputError(
            f"the decoder 'toulbar2' needs the package 'pytoulbar2' ({error}); install it with: "
            "pip install pytoulbar2"
        ) from None


def _solved(
    package: Any,
    sizes: Sequence[int],
    factors: Sequence[Factor],
    costs: Sequence[Array],
    ceiling: float | None,
    max_backtracks: int,
) -> tuple[NDArray[np.int64] | None, float, bool, int]:
    """Labels that cost less than the ceiling, if any; a lower bound of all; whether that is all."""
    network = package.CFN(ubinit=ceiling)
    network.Option.backtrackLimit = max_backtracks
    try:
        for node, size in enumerate(sizes):
            network.AddVariable(f"x{node}", range(size))
        for factor, cost in zip(factors, costs, strict=True):
            network.AddFunction(list(factor.scope), cost.ravel().tolist())
        answer = network.Solve()
    except network.Contradiction:
        return None, math.inf if ceiling is None else ceiling, True, 0
    backtracks = int(network.GetNbBacktracks())
    best = math.inf if ceiling is None else ceiling
    labels = None
    if answer is not None:
        labels, best = np.array(answer[0], np.int64), float(answer[1])
    if not network.Option.limited:
        return labels, best, True, backtracks
    return labels, min(float(network.GetDDualBound()), best), False, backtracks
