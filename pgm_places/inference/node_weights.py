"""Sample weights of nodes and problems for training."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array
from pgm_places.errors import InputError
from pgm_places.inference.problem import LabelingProblem, listed_problems


def weights_of(
    sample_weight: Sequence[ArrayLike] | None, problems: Sequence[LabelingProblem]
) -> list[NDArray[np.float64]]:
    """For each problem the weight (N,) of every node.

    ``sample_weight`` has one entry per problem: a weight for all of its nodes, or one for each
    node; at least 0. None means 1 everywhere. InputError if entries do not fit, or no weight is
    above 0.

    Examples
    --------
    >>> from pgm_places import LabelGraph
    >>> graph = LabelGraph.from_edges(3, [(0, 1), (1, 2)])
    >>> problem = LabelingProblem(graph, ("a", "b"), known=[0, 1, -1])
    >>> [part.tolist() for part in weights_of([2.0, [1.0, 0.0, 3.0]], [problem, problem])]
    [[2.0, 2.0, 2.0], [1.0, 0.0, 3.0]]
    """
    sizes = [problem.graph.n_nodes for problem in listed_problems(problems)]
    if sample_weight is None:
        return [np.ones(size) for size in sizes]
    if len(sample_weight) != len(sizes):
        raise InputError(
            f"sample_weight must have one entry per problem ({len(sizes)}), got "
            f"{len(sample_weight)}; an entry is a number or one weight per node"
        )
    parts = []
    for index, (entry, size) in enumerate(zip(sample_weight, sizes, strict=True)):
        name = f"sample_weight[{index}]"
        weights = finite_array(name, entry, () if np.ndim(entry) == 0 else (size,))
        if weights.min(initial=0.0) < 0:
            raise InputError(f"{name} must be at least 0, got {weights.min():g}")
        parts.append(np.broadcast_to(weights, (size,)))
    if not any(part.any() for part in parts):
        raise InputError("sample_weight is 0 at every node; nothing is left to learn from")
    return parts
