"""Batched inference: many small problems labelled in one call."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import stacked_rows
from pgm_places.graph.edge_list import EdgeList
from pgm_places.graph.known_labels import known_beside
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.raster_edges import EdgeKind
from pgm_places.inference.backends import traits_of
from pgm_places.inference.labeling import Labeling
from pgm_places.inference.problem import LabelingProblem
from pgm_places.labelers.method import infer
from pgm_places.solvers.adjacency import adjacency, is_forest

# Decoders that label each tree of a forest as if it were alone.
EXACT_ON_FORESTS = ("max-product", "sum-product", "exact")

# Edge features that need kinds of edges, or whose units depend on the whole graph.
WHOLE_GRAPH_FEATURES = {"diagonal", "kind", "raw-difference"}


def label_many(backend: Any, problems: Sequence[LabelingProblem]) -> list[Labeling]:
    """A backend's labelling of each problem.

    Networks and fields (``amn``, ``crf``) label graphs without cycles in one call, if the decoder
    is exact on them and no edge feature depends on the whole graph (as ``raw-difference`` does).
    Labels and beliefs are equal up to rounding, at a fraction of the time; score, bound and
    ``info`` are omitted. Other problems are labelled one by one.
    """
    stack = stack_problems(problems) if _is_stackable(backend, problems) else None
    if stack is None or _decoder(backend, stack) not in EXACT_ON_FORESTS:
        return [infer(backend, problem) for problem in problems]
    return unstack(infer(backend, stack), problems)


def stack_problems(problems: Sequence[LabelingProblem]) -> LabelingProblem | None:
    """Several problems as one problem on the disjoint union of their graphs.

    None if stacking could change the labels: for different label names, features that only some
    problems have, cycles, cliques, or diagonals of grids. Layouts and kinds of edges are dropped.
    """
    first = problems[0]
    sizes = [problem.graph.n_nodes for problem in problems]
    starts = np.cumsum([0, *sizes])
    alike = all(
        problem.label_names == first.label_names
        and problem.cliques is None
        and not _has_diagonals(problem)
        and (problem.unary is None) == (first.unary is None)
        and (problem.node_features is None) == (first.node_features is None)
        and (problem.edge_features is None) == (first.edge_features is None)
        for problem in problems
    )
    if not alike:
        return None
    edges = np.concatenate(
        [problem.graph.edges + start for problem, start in zip(problems, starts[:-1], strict=True)]
    )
    if not is_forest(adjacency(int(starts[-1]), edges)):
        return None
    return LabelingProblem(
        LabelGraph(int(starts[-1]), EdgeList(edges)),
        first.label_names,
        _stacked([problem.unary for problem in problems]),
        _stacked([problem.node_features for problem in problems]),
        _stacked([problem.edge_features for problem in problems]),
        known_beside([(problem.known, problem.graph.n_nodes) for problem in problems]),
        unseen=_unobserved_stacked(problems),
    )


def unstack(stack: Labeling, problems: Sequence[LabelingProblem]) -> list[Labeling]:
    """The labelling of each of the stacked problems."""
    ends = np.cumsum([problem.graph.n_nodes for problem in problems])[:-1]
    labels = np.split(stack.labels, ends)
    if stack.beliefs is None:
        return [Labeling(each, stack.status) for each in labels]
    beliefs = np.split(stack.beliefs, ends)
    return [
        Labeling(each, stack.status, belief) for each, belief in zip(labels, beliefs, strict=True)
    ]


def _is_stackable(backend: Any, problems: Sequence[LabelingProblem]) -> bool:
    if len(problems) < 2 or not traits_of(backend).sees_parts_alone:
        return False
    return WHOLE_GRAPH_FEATURES.isdisjoint(backend.edge_names(problems[0]))


def _decoder(backend: Any, problem: LabelingProblem) -> str:
    """The name of the decoder that a network or field uses for a problem."""
    chosen = getattr(backend, "decoder_for", None)
    return str(backend.inference if chosen is None else chosen(problem))


def _has_diagonals(problem: LabelingProblem) -> bool:
    kinds = problem.graph.edge_kind
    return kinds is not None and bool((kinds == EdgeKind.DIAGONAL).any())


def _unobserved_stacked(problems: Sequence[LabelingProblem]) -> NDArray[np.bool_] | None:
    if all(problem.unseen is None for problem in problems):
        return None
    return np.concatenate(
        [
            np.zeros(problem.graph.n_nodes, np.bool_) if problem.unseen is None else problem.unseen
            for problem in problems
        ]
    )


def _stacked(arrays: Sequence[Any]) -> Any:
    return None if arrays[0] is None else stacked_rows(arrays)
