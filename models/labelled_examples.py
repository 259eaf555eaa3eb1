"""Preparation of labelled problems for learners: labelled parts, losses, validation parts."""

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError, LabelError, nearest_name
from pgm_places.evaluation.evaluation import balanced_accuracy, confusion_matrix
from pgm_places.evaluation.folds import contiguous_parts
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.raster_edges import EdgeKind
from pgm_places.inference.problem import LabelingProblem, labelled_problems
from pgm_places.options import Positive


def best_value(
    values: Sequence[float],
    truth: Sequence[NDArray[np.int64]],
    answers: Sequence[Sequence[NDArray[np.int64]]],
) -> tuple[float, NDArray[np.float64]]:
    """The best value, and (V, 2) every value with its balanced accuracy over all parts.

    ``truth`` has the labels of each part, ``answers`` for each value its labels of these parts.
    Among equals the smallest wins. If no part could be held out, it is the first value, with
    accuracies of NaN.

    Examples
    --------
    >>> truth = [np.array([0, 1])]
    >>> best, table = best_value([10.0, 1.0], truth, [[np.array([0, 0])], [np.array([0, 1])]])
    >>> best, table.tolist()
    (1.0, [[10.0, 0.5], [1.0, 1.0]])
    """
    if not truth:
        return float(values[0]), np.column_stack([values, np.full(len(values), np.nan)])
    everywhere = np.concatenate(truth)
    scores = [
        float(balanced_accuracy(confusion_matrix(everywhere, np.concatenate(labels))))
        for labels in answers
    ]
    best = max(range(len(values)), key=lambda v: (scores[v], -values[v]))
    return float(values[best]), np.column_stack([values, scores])


WeightRule = Literal["none", "cube-root", "sqrt", "two-thirds", "inverse"]
ClassWeight = WeightRule | Mapping[str, Positive]
"""Cost of a missed label: a rule by its share, or a weight by name, 1 for other labels."""

MANY = 100
"""Number of problems from which on options are compared on half of the parts."""

# A problem and the true label (N,) of every node.
Example = tuple[LabelingProblem, NDArray[np.int64]]

CLASS_WEIGHTS: dict[WeightRule, float] = {
    "none": 0.0,
    "cube-root": 1 / 3,
    "sqrt": 1 / 2,
    "two-thirds": 2 / 3,
    "inverse": 1.0,
}
"""Exponent p: a wrong node of a label with share f of the nodes costs f^-p."""


def node_losses(
    labels: NDArray[np.int64], label_names: Sequence[str], class_weight: ClassWeight
) -> NDArray[np.float64]:
    """(N,) cost of a wrong label at each node, with mean 1; each label needs an example."""
    counts = np.bincount(labels, minlength=len(label_names))
    missing = [name for name, count in zip(label_names, counts, strict=True) if not count]
    if missing:
        raise LabelError(
            f"no node of the training data is labelled {', '.join(map(repr, missing))}; "
            "label one, or remove the label from label_names"
        )
    if isinstance(class_weight, Mapping):
        for name in class_weight:
            if name not in label_names:
                raise InputError(
                    f"class_weight has a weight for {name!r}, which is no label. "
                    f"{nearest_name(name, list(label_names))}"
                )
        weights = np.array([class_weight.get(name, 1.0) for name in label_names])
    else:
        weights = (counts / len(labels)) ** -CLASS_WEIGHTS[class_weight]
    losses: NDArray[np.float64] = weights[labels]
    return losses / losses.mean()


def penalties_of(
    C: float | Literal["auto"] | tuple[float, ...], auto: tuple[float, ...]
) -> tuple[float, ...]:
    """The candidates of C; a single one if it is set."""
    if C == "auto":
        return auto
    return C if isinstance(C, tuple) else (float(C),)


def labelled_parts(
    problems: Sequence[LabelingProblem],
    labelings: Sequence[NDArray[np.int64]],
    *,
    with_unlabelled: bool = False,
) -> list[Example]:
    """Each problem with labels, without its unlabelled nodes unless ``with_unlabelled``."""
    known: list[Example] = []
    for problem, truth in labelled_problems(problems, labelings):
        labelled = truth >= 0
        if not labelled.any():
            continue
        if with_unlabelled or labelled.all():
            known.append((problem, truth))
        else:
            known.append((problem.subproblem(labelled), truth[labelled]))
    if not known:
        raise InputError("no node of any training problem has a label")
    return known


def labelled_weights(
    weights: Sequence[NDArray[np.float64]],
    labelings: Sequence[NDArray[np.int64]],
    *,
    with_unlabelled: bool = False,
) -> list[NDArray[np.float64]]:
    """The weights of the nodes in the result of :func:`labelled_parts`."""
    pairs = [(w, np.asarray(t) >= 0) for w, t in zip(weights, labelings, strict=True)]
    return [w if with_unlabelled else w[known] for w, known in pairs if known.any()]


def held_out_parts(examples: Sequence[Example], n_parts: int) -> NDArray[np.int64]:
    """(N,) the validation part of each node: its problem, or blocks of a single problem."""
    if len(examples) == 1:
        problem, truth = examples[0]
        return contiguous_parts(problem.graph, n_parts, truth)
    n = min(n_parts, len(examples))
    group = [m * n // len(examples) for m in range(len(examples))]
    return np.repeat(group, [len(truth) for _, truth in examples])


def linked_steps(graph: LabelGraph) -> NDArray[np.bool_]:
    """(N,) nodes of edges in time, in a graph that links them to others; none elsewhere."""
    steps = np.zeros(graph.n_nodes, np.bool_)
    kinds = graph.edge_kind
    if kinds is not None and (kinds == EdgeKind.LINK).any():
        steps[graph.edges[(kinds == EdgeKind.TIME) | (kinds == EdgeKind.LOOP)]] = True
    return steps


def searched_parts(examples: Sequence[Example], n_parts: int) -> NDArray[np.int64]:
    """(N,) :func:`held_out_parts`; of :data:`MANY` or more problems only half are held out."""
    parts = held_out_parts(examples, n_parts)
    return np.where(parts < max(n_parts // 2, 1), parts, -1) if len(examples) >= MANY else parts
