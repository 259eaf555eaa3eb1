"""The mean of several boosted lists, as one list."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pgm_places.errors import InputError
from pgm_places.models.boosted_list import BoostedList
from pgm_places.models.strong_classifier import BoostedTrees

_SLOPE = 2.0  # the slope of equation 7, so that F has the same meaning as in a boosted list


def list_average(lists: Sequence[BoostedList]) -> BoostedList:
    """A list whose log-odds are the mean log-odds of several lists of trees.

    F is a sum over trees, so the mean of L classifiers is again a sum: it has all trees, with
    leaves scaled by 1 / L and by each list's calibration.

    Parameters
    ----------
    lists : sequence of L BoostedList
        Lists of trees of one depth, on equal columns, with equal classes in equal order.

    Returns
    -------
    BoostedList
        ``log_histogram`` combines the geometric means of the binary confidences by equation 8. A
        single list is returned unchanged.

    Raises
    ------
    InputError
        The lists do not match, or are lists of stumps.

    References
    ----------
    Breiman, Bagging predictors, Machine Learning 24, 1996; here the lists differ in their training
    maps.
    """
    first, *others = lists
    if not others:
        return first
    for other in others:
        _require_match(first, other)
    return replace(
        first,
        classifiers=tuple(_mean_of(lists, k) for k in range(len(first.classifiers))),
        calibration=np.stack(
            [
                np.full(len(first.classifiers), _SLOPE),
                np.mean([item.calibration[:, 1] for item in lists], axis=0),
            ],
            axis=1,
        ),
    )


def _mean_of(lists: Sequence[BoostedList], k: int) -> BoostedTrees:
    """The trees of the k-th classifiers of all lists."""
    parts = [item.classifiers[k] for item in lists]
    trees = [part for part in parts if isinstance(part, BoostedTrees)]
    if len(trees) < len(parts):
        raise InputError("lists of stumps cannot be averaged; boost trees instead (max_depth >= 2)")
    factors = [item.calibration[k, 0] / (_SLOPE * len(lists)) for item in lists]
    return BoostedTrees(
        np.concatenate([part.feature for part in trees]),
        np.concatenate([part.cut for part in trees]),
        np.concatenate(
            [factor * part.value for factor, part in zip(factors, trees, strict=True)],
            dtype=np.float32,
            casting="same_kind",
        ),
    )


def _require_match(one: BoostedList, other: BoostedList) -> None:
    if not np.array_equal(one.classes, other.classes):
        raise InputError(
            "only lists of the same classes can be averaged, got "
            f"{one.classes.tolist()} and {other.classes.tolist()}"
        )
    if not np.array_equal(one.order, other.order):
        raise InputError(
            "only lists that ask for their classes in one order can be averaged, got "
            f"{one.classes[one.order].tolist()} and {other.classes[other.order].tolist()}"
        )
    if one.n_features != other.n_features:
        raise InputError(
            "only lists on the same columns can be averaged, got lists on "
            f"{one.n_features} and {other.n_features} columns"
        )
