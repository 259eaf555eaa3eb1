"""Weights of nodes and of whole problems, for what learns from them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array
from pgm_places.errors import InputError


def node_weights(
    sample_weight: Sequence[ArrayLike] | NDArray[np.float64] | None, sizes: Sequence[int]
) -> list[NDArray[np.float64]]:
    """For each problem the weight of every node.

    Parameters
    ----------
    sample_weight : sequence of float or (N,) float, or None
        One entry a problem: a weight for all of its nodes, or one for each node; at least 0. None
        for 1 everywhere.
    sizes : sequence of int
        The problems' numbers of nodes.

    Raises
    ------
    InputError
        Another number of entries, an entry of another shape, or a weight that is not a number of at
        least 0; no weight above 0 at all.

    Examples
    --------
    >>> [part.tolist() for part in node_weights([2.0, [1.0, 0.0, 3.0]], [2, 3])]
    [[2.0, 2.0], [1.0, 0.0, 3.0]]
    """
    if sample_weight is None:
        return [np.ones(size) for size in sizes]
    if len(sample_weight) != len(sizes):
        raise InputError(
            f"sample_weight must have one entry per problem ({len(sizes)}), got "
            f"{len(sample_weight)}; an entry is a number or one weight per node"
        )
    found = []
    for number, (given, size) in enumerate(zip(sample_weight, sizes, strict=True)):
        name = f"sample_weight[{number}]"
        shape = () if np.ndim(given) == 0 else (size,)
        weights = np.broadcast_to(finite_array(name, given, shape), (size,))
        if weights.size and weights.min() < 0:
            raise InputError(f"{name} must be at least 0, got {weights.min():g}")
        found.append(weights)
    if not any(part.any() for part in found):
        raise InputError("sample_weight is 0 at every node; nothing is left to learn from")
    return found
