"""How an associative Markov network learns: losses, the learners by name, the choice of C."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import integer_array
from pgm_places.errors import InputError, LabelError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.layout import GridLayout
from pgm_places.inference.problem import LabelingProblem
from pgm_places.solvers.certificate import certify_weights
from pgm_places.solvers.max_margin import (
    Cut,
    MaxMarginProblem,
    MaxMarginSolution,
    OnStep,
    joined,
    potentials_of,
)
from pgm_places.solvers.max_margin_qp import QPSolver
from pgm_places.solvers.max_oracle import graph_cut_oracle

__all__ = [
    "CLASS_WEIGHTS",
    "LEARNERS",
    "ClassWeight",
    "Learner",
    "LearnerOptions",
    "balanced_accuracy",
    "choose_penalty",
    "contiguous_parts",
    "labelled_parts",
    "learn",
    "node_losses",
]

Learner = Literal["cutting-plane", "qp", "frank-wolfe"]
ClassWeight = Literal["none", "cube-root", "sqrt", "two-thirds", "inverse"]
LEARNERS: tuple[Learner, ...] = get_args(Learner)

CLASS_WEIGHTS: dict[ClassWeight, float] = {
    "none": 0.0,
    "cube-root": 1 / 3,
    "sqrt": 1 / 2,
    "two-thirds": 2 / 3,
    "inverse": 1.0,
}
"""Exponent p: a node of a label that is a share f of the nodes costs f^-p when it is wrong."""

SEARCH_TOLERANCE = 1e-2
"""Learning is only this exact while C is being chosen: C changes by factors of several."""


@dataclass(frozen=True)
class LearnerOptions:
    """The options of learning that do not depend on the data; see the network's docstring."""

    learner: Learner
    solver: QPSolver
    tolerance: float
    max_cuts: int
    time_limit_s: float | None
    certified_tolerance: float | None


def node_losses(
    labels: NDArray[np.int64], label_names: Sequence[str], class_weight: ClassWeight
) -> NDArray[np.float64]:
    """(N,) what a wrong label costs at each node, with mean 1.

    Raises
    ------
    LabelError
        A label has no example, so that nothing can be learned about it.
    """
    counts = np.bincount(labels, minlength=len(label_names))
    missing = [name for name, count in zip(label_names, counts, strict=True) if not count]
    if missing:
        raise LabelError(
            f"no training map has a node labelled {', '.join(map(repr, missing))}; "
            "add a map that has one or take the label out of label_names"
        )
    weights = (counts / len(labels)) ** -CLASS_WEIGHTS[class_weight]
    losses: NDArray[np.float64] = weights[labels]
    return losses / losses.mean()


def labelled_parts(
    problems: Sequence[LabelingProblem], labelings: Sequence[NDArray[np.int64]]
) -> list[tuple[LabelingProblem, NDArray[np.int64]]]:
    """Each map without its unlabelled nodes; maps without any label are left out.

    Raises
    ------
    InputError
        Maps and labelings that do not belong together, or no label at all.
    """
    if not problems or len(problems) != len(labelings):
        raise InputError(
            f"fit wants one labeling per problem, got {len(labelings)} for {len(problems)} problems"
        )
    names = problems[0].label_names
    known = []
    for number, (problem, labeling) in enumerate(zip(problems, labelings, strict=True)):
        if problem.label_names != names:
            raise InputError(
                f"all training maps must have the labels {list(names)}, "
                f"map {number} has {list(problem.label_names)}"
            )
        n_nodes, n_labels = problem.graph.n_nodes, problem.n_labels
        truth = integer_array(f"labelings[{number}]", labeling, (n_nodes,), low=-1, high=n_labels)
        labelled = truth >= 0
        if labelled.all() and n_nodes:
            known.append((problem, truth))
        elif labelled.any():
            known.append((problem.subproblem(labelled), truth[labelled]))
    if not known:
        raise InputError("no node of any training map has a label")
    return known


def learn(
    problems: Sequence[MaxMarginProblem],
    options: LearnerOptions,
    *,
    cuts: Sequence[Cut] = (),
    on_iteration: OnStep | None = None,
) -> MaxMarginSolution:
    """The weights that the chosen learner finds for one or several maps."""
    if options.learner == "qp":
        from pgm_places.solvers.max_margin_qp import max_margin_qp

        return max_margin_qp(
            joined(problems),
            solver=options.solver,
            tolerance=min(options.tolerance, 1e-4),
            time_limit_s=options.time_limit_s,
        )
    if options.learner == "frank-wolfe":
        from pgm_places.solvers.frank_wolfe import frank_wolfe

        return frank_wolfe(
            problems,
            [graph_cut_oracle(problem.n_nodes, problem.edges) for problem in problems],
            tolerance=options.tolerance,
            max_passes=options.max_cuts,
            time_limit_s=options.time_limit_s,
            on_iteration=on_iteration,
        )
    from pgm_places.solvers.cutting_plane import cutting_plane

    problem = joined(problems)
    return cutting_plane(
        problem,
        graph_cut_oracle(problem.n_nodes, problem.edges, from_last=True),
        thorough=graph_cut_oracle(problem.n_nodes, problem.edges),
        tolerance=options.tolerance,
        max_iterations=options.max_cuts,
        time_limit_s=options.time_limit_s,
        cuts=cuts,
        verifier=None if options.certified_tolerance is None else certify_weights,
        verified_tolerance=options.certified_tolerance or 0.0,
        on_iteration=on_iteration,
    )


def choose_penalty(
    problems: Sequence[MaxMarginProblem],
    graphs: Sequence[LabelGraph],
    penalties: Sequence[float],
    n_blocks: int,
    options: LearnerOptions,
) -> tuple[float, NDArray[np.float64]]:
    """The C with the best balanced accuracy on held-out blocks, and (P, 2) C and that accuracy.

    Every map is cut into contiguous parts; part b of all maps is held out in turn, the network is
    learned on the rest and labels the part alone. Single cells are never held out: their
    neighbours would give them away. Among equals the smaller C wins.

    Raises
    ------
    LabelError
        A label lies in one part only, so that learning without that part is impossible.
    """
    parts = [contiguous_parts(graph, n_blocks) for graph in graphs]
    quick = replace(
        options, learner="cutting-plane", tolerance=SEARCH_TOLERANCE, certified_tolerance=None
    )
    truth: list[NDArray[np.int64]] = []
    found: list[list[NDArray[np.int64]]] = [[] for _ in penalties]
    for part in range(n_blocks):
        train = [_restricted(p, at != part) for p, at in zip(problems, parts, strict=True)]
        held_out = joined(
            [_restricted(p, at == part) for p, at in zip(problems, parts, strict=True)]
        )
        kept = np.unique(np.concatenate([problem.labels for problem in train]))
        if len(kept) < held_out.n_labels:
            raise LabelError(
                "C cannot be chosen by held-out blocks: without block "
                f"{part + 1} of {n_blocks} some label has no example left. "
                "Use more validation blocks or give one C"
            )
        truth.append(held_out.labels)
        cuts: tuple[Cut, ...] = ()
        oracle = graph_cut_oracle(held_out.n_nodes, held_out.edges)
        for number, penalty in enumerate(penalties):
            priced = [replace(problem, penalty=penalty) for problem in train]
            solution = learn(priced, quick, cuts=cuts)
            cuts = solution.cuts  # planes hold at any C
            found[number].append(oracle(*potentials_of(held_out, solution.weights)))
    everywhere = np.concatenate(truth)
    scores = [balanced_accuracy(everywhere, np.concatenate(labels)) for labels in found]
    table = np.column_stack([penalties, scores])
    best = max(range(len(penalties)), key=lambda p: (scores[p], -penalties[p]))
    return float(penalties[best]), table


def balanced_accuracy(truth: NDArray[np.int64], labels: NDArray[np.int64]) -> float:
    """The mean recall over the labels that occur in ``truth``."""
    return float(np.mean([(labels[truth == k] == k).mean() for k in np.unique(truth)]))


def contiguous_parts(graph: LabelGraph, n_parts: int) -> NDArray[np.int64]:
    """(N,) part of each node: stripes of equal size across the longer side of the graph.

    Without positions or a raster, nodes are taken in their order.
    """
    if graph.positions_m is not None:
        places = graph.positions_m
    elif isinstance(graph.layout, GridLayout):
        places = graph.layout.cells_rc.astype(np.float64)
    else:
        places = np.arange(graph.n_nodes, dtype=np.float64)[:, None]
    along = places[:, int(np.argmax(np.ptp(places, axis=0)))]
    rank = np.argsort(np.argsort(along, kind="stable"), kind="stable")
    return rank * n_parts // max(graph.n_nodes, 1)


def _restricted(problem: MaxMarginProblem, keep: NDArray[np.bool_]) -> MaxMarginProblem:
    """The problem on the nodes of a mask."""
    if not keep.any():
        raise InputError("a validation block is empty; use fewer validation blocks")
    number = np.cumsum(keep, dtype=np.int32) - 1
    inside = keep[problem.edges].all(axis=1)
    return replace(
        problem,
        node_features=problem.node_features[keep],
        edges=number[problem.edges[inside]],
        edge_features=problem.edge_features[inside],
        labels=problem.labels[keep],
        loss=problem.loss[keep],
    )
