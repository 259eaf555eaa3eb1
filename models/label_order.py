"""Internal order of labels in methods: by frequency, independent of their order in a problem.

Rounding, ties and the moves of a graph cut depend on the order of labels; results must not.
"""

from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from pgm_places.inference.backends import (
    renumbered,
    reordered,
    reordered_potentials,
    restored_labeling,
)
from pgm_places.inference.labeling import Labeling
from pgm_places.inference.potentials import Potentials
from pgm_places.inference.problem import LabelingProblem, labelled_problems


def frequency_order(labelings: Sequence[NDArray[np.integer]], n_labels: int) -> NDArray[np.int64]:
    """(K,) the labels from the most frequent to the rarest; of equals, the first to occur.

    Examples
    --------
    >>> frequency_order([np.array([2, -1, 0, 2]), np.array([1])], 3).tolist()
    [2, 0, 1]
    """
    every = np.concatenate([np.asarray(labels) for labels in labelings])
    values, first = np.unique(every, return_index=True)
    place = np.full(n_labels, len(every))
    place[values[values >= 0]] = first[values >= 0]
    return np.lexsort((place, -np.bincount(every[every >= 0], minlength=n_labels)))


def preference_order(unary: NDArray[np.floating], names: Sequence[str]) -> NDArray[np.int64]:
    """(K,) the labels by the number of nodes that prefer them, most preferred first.

    A node prefers all labels of its highest unary (N, K). Equals are in alphabetical order.

    Examples
    --------
    >>> preference_order(np.array([[0.0, 1.0], [1.0, 1.0]]), ["a", "b"]).tolist()
    [1, 0]
    """
    best = unary.max(axis=1)
    preferred = [int((unary[:, k] == best).sum()) for k in range(unary.shape[1])]
    return np.lexsort((np.argsort(np.argsort(names)), -np.array(preferred)))


def decoded_by_preference(
    potentials: Potentials,
    names: Sequence[str],
    decoded: Callable[[Potentials, NDArray[np.int64]], Labeling],
) -> Labeling:
    """Decode by ``decoded(potentials, order)`` in :func:`preference_order` (K,)."""
    order = preference_order(potentials.unary, names)
    if (order == np.arange(len(order))).all():
        return decoded(potentials, order)
    return restored_labeling(decoded(reordered_potentials(potentials, order), order), order)


Fit = TypeVar("Fit", bound=Callable[..., Any])


def learned_by_frequency(fit: Fit) -> Fit:
    """Decorator of ``fit`` that sorts labels by frequency, except in a warm-started model."""

    @wraps(fit)
    def ordered(
        self: Any,
        problems: Sequence[LabelingProblem],
        labelings: Sequence[NDArray[np.int64]],
        **options: Any,
    ) -> Any:
        pairs = labelled_problems(problems, labelings)
        first = pairs[0][0]
        if self.warm_start and self.node_weights is not None:
            order = self.order_in(first)
        else:
            every = [labels for _, labels in pairs]
            every += [problem.known for problem, _ in pairs if problem.known is not None]
            order = frequency_order(every, first.n_labels)
        problems_in_order = [reordered(problem, order) for problem, _ in pairs]
        turned = [renumbered(labels, order) for _, labels in pairs]
        fitted = fit(self.with_options_in(order), problems_in_order, turned, **options)
        return fitted.with_options_in(np.argsort(order)).with_names_of(problems_in_order[0])

    return cast(Fit, ordered)
