"""Counts of labels, of consecutive labels, and of confusions, as probabilities."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array
from pgm_places.errors import InputError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.problem import LabelingProblem, labelled_problems

__all__ = [
    "ChainCounts",
    "count_chains",
    "count_table",
    "counted_tables",
    "lighter_ends",
    "moved_steps",
    "normalised",
    "require_chain",
    "usual_step_m",
]


class ChainCounts(NamedTuple):
    """What was counted along labelled chains."""

    moves: NDArray[np.float64]
    """(K, K) how often the column's label came after the row's, the robot having moved."""
    confusions: NDArray[np.float64]
    """(K, K) how often the classifier's best label was the column where the row was true."""
    first: NDArray[np.float64]
    """(K,) how often each label was the first that is known."""
    shares: NDArray[np.float64]
    """(K,) how many steps have each label."""


def count_chains(
    problems: Sequence[LabelingProblem],
    labelings: Sequence[NDArray[np.int64]],
    moved: Callable[[LabelGraph], NDArray[np.bool_]],
    *,
    smoothing: float,
    weights: Sequence[NDArray[np.float64]],
) -> ChainCounts:
    """Counts over all chains, ``smoothing`` added to each.

    Parameters
    ----------
    problems, labelings
        Chains with unaries, and the true label (T,) of each step, -1 where it is unknown.
    moved : function of a chain
        (T - 1,) whether the robot moved between each step and the next.
    smoothing : float
    weights : sequence of (T,) float
        What each step counts; a move counts as the lighter of its two steps, which is what a chain
        of one weight does as a whole.

    Raises
    ------
    InputError
        A problem is no chain, has no unary, or other labels than the first; no step is labelled.
    """
    pairs = labelled_problems(problems, labelings)
    n_labels = pairs[0][0].n_labels
    moves = np.full((n_labels, n_labels), smoothing)
    seen = moves.copy()
    first = np.full(n_labels, smoothing)
    share = first.copy()
    for (problem, truth), weight in zip(pairs, weights, strict=True):
        require_chain(problem.graph)
        if problem.unary is None:
            raise InputError("'hmm' needs unary log-probabilities; the problem has none")
        known = np.flatnonzero(truth >= 0)
        pair = (truth[:-1] >= 0) & (truth[1:] >= 0) & moved(problem.graph)
        np.add.at(moves, (truth[:-1][pair], truth[1:][pair]), lighter_ends(weight)[pair])
        np.add.at(seen, (truth[known], problem.unary[known].argmax(axis=1)), weight[known])
        np.add.at(share, truth[known], weight[known])
        first[truth[known[:1]]] += weight[known[:1]]
    if share.sum() == smoothing * n_labels:
        raise InputError("no step is labelled, or all that are weigh 0: nothing to train on")
    return ChainCounts(moves, seen, first, share)


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
    """The learned tables of a hidden Markov model by name, as far as counts of them are given.

    ``begun`` says whether the model has a distribution of first labels; without, it is even.

    Raises
    ------
    InputError
        A count is negative or not finite, or shapes do not fit.
    """
    found: dict[str, NDArray[np.float64]] = {}
    n_labels: int | str = "K"
    for name, counts in (("confusions", confusions), ("moves", moves), ("stays", stays)):
        if counts is not None:
            table = count_table(name, counts, (n_labels, n_labels))
            n_labels = len(table)
            found[name] = table
    tables: dict[str, Any] = {}
    if "confusions" in found:
        tables["confusion"] = normalised(found["confusions"] + smoothing)
        tables["prior"] = normalised(found["confusions"].sum(axis=1) + smoothing)
    if "moves" in found:
        tables["transition"] = normalised(found["moves"] + smoothing)
        tables["counted_m"] = None
    if "stays" in found:
        tables["stay"] = normalised(found["stays"])
    if first is not None:
        tables["initial"] = normalised(count_table("first", first, (n_labels,)) + smoothing)
    elif not begun and found:
        tables["initial"] = np.full(int(n_labels), 1.0 / int(n_labels))
    return tables


def usual_step_m(problems: Sequence[LabelingProblem]) -> NDArray[np.float64] | None:
    """(1,) the median distance between the steps of chains; None where positions are unknown."""
    places = [problem.graph.positions_m for problem in problems]
    moved = [np.linalg.norm(np.diff(xy, axis=0), axis=1) for xy in places if xy is not None]
    steps = np.concatenate([*moved, np.zeros(0)])
    steps = steps[steps > 0]
    return np.array([np.median(steps)]) if len(steps) else None


def moved_steps(graph: LabelGraph, stay_below_m: float) -> NDArray[np.bool_]:
    """(T - 1,) whether the robot moved, so far or farther, between each step and the next.

    Raises
    ------
    InputError
        A distance is given, and the graph has no positions.
    """
    if stay_below_m <= 0:
        return np.ones(max(graph.n_nodes - 1, 0), np.bool_)
    if graph.positions_m is None:
        raise InputError("stay_below_m needs positions, and this graph has none")
    far: NDArray[np.bool_] = (
        np.linalg.norm(np.diff(graph.positions_m, axis=0), axis=1) >= stay_below_m
    )
    return far


def require_chain(graph: LabelGraph) -> None:
    """Refuse a graph that is no chain."""
    if not graph.is_chain:
        raise InputError(
            f"'hmm' labels chains such as LabelGraph.from_trajectory makes; {graph!r} is not one"
        )


def count_table(
    name: str, values: ArrayLike, shape: tuple[int | str | None, ...]
) -> NDArray[np.float64]:
    """``values`` as counts of that shape, which must be square if it has two axes.

    Raises
    ------
    InputError
        Another shape, a negative count, or one that is not a finite number.
    """
    counts: NDArray[np.float64] = finite_array(name, values, shape)
    if counts.ndim == 2 and counts.shape[0] != counts.shape[1]:
        raise InputError(f"{name} must be square, got shape {counts.shape}")
    if (counts < 0).any():
        raise InputError(f"{name} must hold counts of at least 0, got {counts.min()}")
    return counts


def normalised(counts: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows over their sum; equal probabilities where it is 0."""
    total = counts.sum(axis=-1, keepdims=True)
    even = np.full_like(counts, 1.0 / counts.shape[-1])
    return np.divide(counts, total, out=even, where=total > 0)
