"""Evidence in the answers of methods that do not look at it."""

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.inference.labeling import Labeling, Status
from pgm_places.inference.potentials import keep_known
from pgm_places.inference.problem import LabelingProblem

__all__ = ["keep_evidence"]


def keep_evidence(problem: LabelingProblem, found: Labeling) -> Labeling:
    """The labelling with every known label kept and no forbidden one, whatever the method did.

    All methods of the package keep evidence by themselves, so that it speaks to the neighbours too;
    their labellings come back as they are. One that does not know of evidence has its beliefs at
    those nodes limited to the labels allowed there, and the label with the greatest of them taken;
    of labels with equal beliefs, or without any, the one that ``unary`` prefers. Its score and
    bound, which were another labelling's, are dropped.

    Parameters
    ----------
    problem : LabelingProblem
        N nodes, K labels.
    found : Labeling
        What a method said about it.

    Examples
    --------
    >>> from pgm_places.graph.label_graph import LabelGraph
    >>> graph = LabelGraph.from_edges(2, [(0, 1)])
    >>> problem = LabelingProblem(graph, ["a", "b"], known=np.array([1, -1]))
    >>> keep_evidence(problem, Labeling(np.zeros(2, np.int64), Status.CONVERGED)).labels.tolist()
    [1, 0]
    """
    nodes = np.flatnonzero(problem.evidence)
    if not len(nodes):
        return found
    preferred = _preferred(problem, nodes)
    allowed = preferred > -np.inf
    all_beliefs = found.beliefs
    beliefs = None if all_beliefs is None else all_beliefs[nodes]
    labels = found.labels[nodes]
    breaks = ~allowed[np.arange(len(nodes)), labels]
    if not breaks.any() and (beliefs is None or not beliefs[~allowed].any()):
        return found
    if all_beliefs is not None and beliefs is not None:
        beliefs = np.where(allowed, beliefs, 0)
        beliefs = np.where(beliefs.any(axis=1, keepdims=True), beliefs, allowed)
        beliefs = beliefs / beliefs.sum(axis=1, keepdims=True)
        tied = beliefs == beliefs.max(axis=1, keepdims=True)
        preferred = np.where(tied, preferred, -np.inf)
        found = dataclasses.replace(found, beliefs=_with_rows(all_beliefs, nodes, beliefs))
    if not breaks.any():
        return found
    best = np.where(breaks, preferred.argmax(axis=1), labels)
    labels = _with_rows(found.labels, nodes, best)
    return dataclasses.replace(found, labels=labels, status=Status.REPAIRED, score=None, bound=None)


def _preferred(problem: LabelingProblem, nodes: NDArray[np.int64]) -> NDArray[np.float64]:
    """(n, K) the unary at some nodes, zeros without one, with -inf for what is not allowed."""
    known = None if problem.known is None else problem.known[nodes]
    unary = None if problem.unary is None else problem.unary[nodes]
    scores = np.zeros((len(nodes), problem.n_labels)) if unary is None else unary
    return scores if known is None else keep_known(scores, known)


def _with_rows(array: NDArray[Any], nodes: NDArray[np.int64], rows: NDArray[Any]) -> NDArray[Any]:
    changed = np.array(array)
    changed[nodes] = rows
    return changed
