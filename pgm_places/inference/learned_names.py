"""Learned label names, and reordering of problems whose labels are in another order."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import wraps
from typing import Any, Self, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.inference.backends import learned
from pgm_places.inference.labeling import Labeling
from pgm_places.inference.potentials import Potentials
from pgm_places.inference.problem import LabelingProblem


@dataclass(frozen=True, eq=False, kw_only=True)
class LearnedNames:
    """A method whose learned arrays use the order of labels in ``learned_names``."""

    name_bytes: NDArray[np.uint8] | None = learned()

    @property
    def learned_names(self) -> tuple[str, ...] | None:
        """The K labels in the order of learned arrays; None if these did not come from problems.

        Models of earlier versions lack the names: their problems must have the labels in the order
        of training.
        """
        if self.name_bytes is None:
            return None
        return tuple(self.name_bytes.tobytes().decode().split("\0"))

    def with_names_of(self, problem: LabelingProblem) -> Self:
        """A copy whose learned arrays have the labels in the order of a problem."""
        text = "\0".join(problem.label_names).encode()
        return replace(self, name_bytes=np.frombuffer(text, np.uint8))

    def order_in(self, problem: LabelingProblem) -> NDArray[np.int64]:
        """(K,) the index in a problem of each label in the order of learned arrays.

        Raises
        ------
        InputError
            The problem has other labels.
        """
        names = self.learned_names or problem.label_names
        if set(names) != set(problem.label_names):
            raise InputError(
                f"the model has learned the labels {list(names)}, this problem has "
                f"{list(problem.label_names)}; learn from such problems, or name them alike"
            )
        return np.array([problem.label_names.index(name) for name in names])


Method = TypeVar("Method", bound=Callable[..., Any])


def in_learned_order(method: Method) -> Method:
    """Decorate a method of one problem: labels are in the learned order inside.

    Results are returned in the problem's order. The arguments ``truth`` (N,) and ``further`` (N, K)
    are reordered, too.
    """

    @wraps(method)
    def ordered(self: LearnedNames, problem: LabelingProblem, **options: Any) -> Any:
        names = self.learned_names
        if not isinstance(problem, LabelingProblem) or names in (None, problem.label_names):
            return method(self, problem, **options)
        if names is not None and len(names) != problem.n_labels:
            return method(self, problem, **options)  # which has its own words for that
        order = self.order_in(problem)
        if options.get("truth") is not None:
            options["truth"] = renumbered(np.asarray(options["truth"]), order)
        if options.get("further") is not None:
            options["further"] = np.asarray(options["further"])[:, order]
        return _restored(method(self, reordered(problem, order), **options), order)

    return cast(Method, ordered)


def renumbered(labels: NDArray[np.integer], order: NDArray[np.int64]) -> NDArray[np.int64]:
    """The labels renumbered so that label ``order[k]`` becomes k; -1 stays.

    Examples
    --------
    >>> renumbered(np.array([2, -1, 0]), np.array([2, 0, 1])).tolist()
    [0, -1, 1]
    """
    return np.append(np.argsort(order), -1)[labels]


def reordered(problem: LabelingProblem, order: NDArray[np.int64]) -> LabelingProblem:
    """The problem with label ``order[k]`` at index k."""
    return replace(
        problem,
        label_names=tuple(problem.label_names[k] for k in order),
        unary=None if problem.unary is None else problem.unary[:, order],
        known=None if problem.known is None else renumbered(problem.known, order),
    )


def reordered_potentials(given: Potentials, order: NDArray[np.int64]) -> Potentials:
    """The potentials with label ``order[k]`` at index k."""
    tables, earned = given.pairwise, given.agreement
    return Potentials(
        given.unary[:, order],
        None if tables is None else tables[..., order, :][..., order],
        None if earned is None else earned[:, order],
    )


def restored_labeling(found: Labeling, order: NDArray[np.int64]) -> Labeling:
    """A labelling of a :func:`reordered` problem, converted to the original order."""
    place, info = np.argsort(order), dict(found.info)
    if "node_marginals" in info:
        info["node_marginals"] = info["node_marginals"][:, place]
    beliefs = None if found.beliefs is None else found.beliefs[:, place]
    labels = order.astype(found.labels.dtype)[found.labels]
    return replace(found, labels=labels, beliefs=beliefs, info=info)


def _restored(result: Any, order: NDArray[np.int64]) -> Any:
    if isinstance(result, Labeling):
        return restored_labeling(result, order)
    place = np.argsort(order)
    if isinstance(result, Potentials):
        return reordered_potentials(result, place)
    return result[:, place]
