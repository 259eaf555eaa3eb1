"""Counts of labels, of consecutive labels, and of confusions, as probabilities."""

import logging
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array
from pgm_places.errors import InputError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.problem import LabelingProblem, labelled_problems

logger = logging.getLogger(__name__)

# Smallest eigenvalue of a table with a logarithm: below, one step forgets the past.
LEAST_EIGENVALUE = 1e-12

_NEAR_IDENTITY, _N_NODES = 0.1, 8
"""Gauss-Legendre nodes with which the logarithm of a matrix nearer to the identity (1-norm) is
accurate to the last digits."""


def transition_power(transition: ArrayLike, exponent: float) -> tuple[NDArray[np.float64], float]:
    """The transitions (K, K) over ``exponent`` > 0 steps, and the largest change of the table.

    ``P^e = exp(e Q)`` with the generator ``Q = log P``. If the table is not embeddable in a process
    in continuous time, negative rates of ``Q`` are set to 0 and its rows made to sum to 0 (Israel,
    Rosenthal and Wei, "Finding generators for Markov chains via empirical transition matrices",
    Mathematical Finance 11, 2001); the change is the largest difference of ``P`` and ``exp(Q)``.
    Integer powers are exact, with change 0. InputError for a table without a real logarithm.
    """
    table = finite_array("transition", transition, ("K", "K"))
    if table.min(initial=0.0) < 0 or abs(table.sum(axis=-1) - 1.0).max(initial=0.0) > 1e-6:
        raise InputError("transition must hold probabilities that sum to one in every row")
    if not 0 < exponent < np.inf:
        raise InputError(f"the exponent must be above 0, got {exponent}")
    if float(exponent).is_integer():
        return np.linalg.matrix_power(table, int(exponent)), 0.0
    rates = _generator(table)
    from scipy.linalg import expm

    changed = float(np.abs(expm(rates) - table).max(initial=0.0))
    powered = np.maximum(expm(exponent * rates), 0.0)
    return powered / powered.sum(axis=1, keepdims=True), changed


def transition_powers(transition: ArrayLike, exponents: NDArray[np.float64]) -> NDArray[np.float64]:
    """(A, K, K) the transitions over steps of several lengths: :func:`transition_power` of each.

    Exponents (A,) are at least 0 and share one generator: a table that is not embeddable is also
    changed for integer exponents.
    """
    from scipy.linalg import expm

    table = finite_array("transition", transition, ("K", "K"))
    if (exponents == 1).all():
        return np.repeat(table[None], len(exponents), axis=0)
    rates = _generator(table)
    powers = np.maximum(expm(exponents[:, None, None] * rates), 0.0)
    return np.asarray(powers / powers.sum(axis=2, keepdims=True))


def transition_at(
    transition: ArrayLike, counted_m: float, from_m: float, to_m: float
) -> tuple[NDArray[np.float64], float]:
    """The transitions (K, K) for updates every ``to_m`` metres, and their largest change.

    They were used for updates every ``from_m``, and counted over ``counted_m``. If the latter is
    larger, as on simulated runs, they do not change up to that distance.
    """
    factor = to_m / from_m
    if factor > 1:
        factor = max(to_m, counted_m) / max(from_m, counted_m)
    return transition_power(transition, factor)


def _generator(table: NDArray[np.float64]) -> NDArray[np.float64]:
    """The logarithm of a table with rates of at least 0 and rows that sum to 0."""
    values = np.linalg.eigvals(table)
    if ((np.abs(values.imag) < 1e-12) & (values.real < LEAST_EIGENVALUE)).any():
        raise InputError(
            "these transitions have no fractional power, since one step forgets the past; "
            "train the model at the step length of its use"
        )
    rates = np.real(_logarithm(table))
    np.fill_diagonal(rates, 0.0)
    rates = np.maximum(rates, 0.0)
    np.fill_diagonal(rates, -rates.sum(axis=1))
    return np.asarray(rates, np.float64)


def _logarithm(table: NDArray[np.float64]) -> NDArray[np.complex128]:
    """The principal logarithm (K, K) by square roots; SciPy's ``logm`` is not deterministic."""
    from scipy.linalg import sqrtm

    one, root, power = np.eye(len(table)), table.astype(np.complex128), 1.0
    while np.linalg.norm(root - one, 1) > _NEAR_IDENTITY:
        # SciPy before 1.13 gives complex256, which NumPy cannot solve with.
        root, power = np.asarray(sqrtm(root), np.complex128), 2.0 * power
    nodes, weights = np.polynomial.legendre.leggauss(_N_NODES)
    logarithm = np.zeros_like(root)
    for node, weight in zip((nodes + 1) / 2, weights / 2, strict=True):
        logarithm += weight * np.linalg.solve(one + node * (root - one), root - one)
    return power * logarithm


def learned_tables(
    problems: Sequence[LabelingProblem],
    labelings: Sequence[NDArray[np.int64]],
    moved: Callable[[LabelGraph], NDArray[np.bool_]],
    method: str,
    *,
    smoothing: float,
    weights: Sequence[NDArray[np.float64]],
    lengths: Sequence[NDArray[np.float64]],
) -> dict[str, Any]:
    """Tables of a hidden Markov model from counts over all chains, by name.

    ``moved(graph)`` (T - 1,) is whether the robot moved; ``method`` is named in errors. A move has
    the smaller of its steps' ``weights`` (T,). ``lengths`` (T - 1,) are those of chains that have
    them.
    """
    pairs = labelled_problems(problems, labelings)
    n_labels = pairs[0][0].n_labels
    moves = np.full((n_labels, n_labels), smoothing)
    confusions = moves.copy()
    first = np.full(n_labels, smoothing)
    share = first.copy()
    for (problem, truth), weight in zip(pairs, weights, strict=True):
        require_chain(problem.graph, method)
        if problem.unary is None:
            raise InputError(
                f"{method!r} needs unary log-probabilities; the problem has none. Put a classifier "
                "in front: StructuredLabeler(method, classifier)"
            )
        known = np.flatnonzero(truth >= 0)
        observed = known if problem.unseen is None else known[~problem.unseen[known]]
        pair = (truth[:-1] >= 0) & (truth[1:] >= 0) & moved(problem.graph)
        np.add.at(moves, (truth[:-1][pair], truth[1:][pair]), lighter_ends(weight)[pair])
        np.add.at(
            confusions, (truth[observed], problem.unary[observed].argmax(axis=1)), weight[observed]
        )
        np.add.at(share, truth[known], weight[known])
        first[truth[known[:1]]] += weight[known[:1]]
    if share.sum() == smoothing * n_labels:
        raise InputError("no labelled step has a positive weight: nothing to train on")
    return {
        "transition": normalised(moves),
        "confusion": normalised(confusions),
        "initial": normalised(first),
        "prior": normalised(share),
        "counted_m": usual_step(lengths),
    }


def lighter_ends(weight: NDArray[np.float64]) -> NDArray[np.float64]:
    """(T - 1,) the smaller weight of each step and the next."""
    return np.minimum(weight[:-1], weight[1:])


def counted_tables(
    confusions: ArrayLike | None,
    moves: ArrayLike | None,
    stays: ArrayLike | None,
    first: ArrayLike | None,
    *,
    smoothing: float,
    begun: bool,
) -> dict[str, Any]:
    """The tables of a hidden Markov model by name, for the counts that are passed.

    The initial distribution is uniform without ``begun``.
    """
    counted: dict[str, NDArray[np.float64]] = {}
    n_labels: int | str = "K"
    for name, counts in (("confusions", confusions), ("moves", moves), ("stays", stays)):
        if counts is not None:
            table = count_table(name, counts, (n_labels, n_labels))
            n_labels = len(table)
            counted[name] = table
    tables: dict[str, Any] = {}
    if "confusions" in counted:
        tables["confusion"] = normalised(counted["confusions"] + smoothing)
        tables["prior"] = normalised(counted["confusions"].sum(axis=1) + smoothing)
    if "moves" in counted:
        tables["transition"] = normalised(counted["moves"] + smoothing)
        tables["counted_m"] = None
    if "stays" in counted:
        tables["stay"] = normalised(counted["stays"])
    if first is not None:
        tables["initial"] = normalised(count_table("first", first, (n_labels,)) + smoothing)
    elif not begun and counted:
        tables["initial"] = np.full(int(n_labels), 1.0 / int(n_labels))
    return tables


def usual_step(lengths: Sequence[NDArray[np.float64]]) -> NDArray[np.float64] | None:
    """(1,) the median of all non-zero step lengths; None without any."""
    steps = np.concatenate([*lengths, np.zeros(0)])
    steps = steps[steps > 0]
    return np.array([np.median(steps)]) if len(steps) else None


def usual_length(counted: NDArray[np.float64] | None, of_runs: float) -> float:
    """The step length over which transitions were counted; None means simulated runs."""
    return of_runs if counted is None else float(counted[0])


def moved_steps(graph: LabelGraph, stay_below_m: float) -> NDArray[np.bool_]:
    """(T - 1,) whether the robot moved at least the threshold between each step and the next."""
    if stay_below_m <= 0:
        return np.ones(max(graph.n_nodes - 1, 0), np.bool_)
    if graph.positions_m is None:
        raise InputError("stay_below_m needs positions, and this graph has none")
    far: NDArray[np.bool_] = (
        np.linalg.norm(np.diff(graph.positions_m, axis=0), axis=1) >= stay_below_m
    )
    return far


def require_chain(graph: LabelGraph, method: str) -> None:
    """Raise InputError unless the graph is a chain."""
    if not graph.is_chain:
        raise InputError(
            f"{method!r} labels chains only (see LabelGraph.from_trajectory), and {graph!r} is not "
            "one; use 'potts', 'amn' or 'crf', which label any graph"
        )


def count_table(
    name: str, values: ArrayLike, shape: tuple[int | str | None, ...]
) -> NDArray[np.float64]:
    """``values`` as counts of this shape, which must be square if it has two axes."""
    counts: NDArray[np.float64] = finite_array(name, values, shape)
    if counts.ndim == 2 and counts.shape[0] != counts.shape[1]:
        raise InputError(f"{name} must be square, got shape {counts.shape}")
    if (counts < 0).any():
        raise InputError(f"{name} must hold counts of at least 0, got {counts.min()}")
    return counts


def normalised(counts: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows divided by their sum; uniform where the sum is 0."""
    total = counts.sum(axis=-1, keepdims=True)
    even = np.full_like(counts, 1.0 / counts.shape[-1])
    return np.divide(counts, total, out=even, where=total > 0)


def log_impossible(steps: NDArray[np.int64], n_steps: int) -> None:
    """Log a warning that observations of some steps have probability 0."""
    logger.warning(
        "the observations at %d of %d steps (first %d) have probability 0 in the hidden Markov "
        "model; train it with smoothing above 0",
        len(steps),
        n_steps,
        steps[0],
    )
