"""A trained decision list of strong classifiers (paper, section 3, eq. 7 and 8), as plain data."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array, integer_array, set_frozen
from pgm_places.errors import InputError, ModelFileError, quoted
from pgm_places.models.strong_classifier import BoostedTrees, StrongClassifier, TreeSplit, VoteTable

__all__ = ["BoostedList"]

_KIND = "boosted decision list"
_VERSION = 1  # of lists of stumps; those of trees came later
_TREES_VERSION = 2
_MAX_FEATURES = 10_000_000
_DECISIONS = ("list", "argmax")


@dataclass(frozen=True, eq=False)
class BoostedList:
    """A fitted decision list of boosted classifiers; needs neither scikit-learn nor training data.

    ``classes`` (K,) are ascending labels; columns of the histogram follow them. ``order`` (K,) has
    the index of each classifier's positive class, then of the remaining class; ``classifiers`` (K -
    1) are all of stumps, or all of trees of one depth. ``calibration`` (K - 1, 2) holds slope and
    offset of each confidence C+ = expit(slope F + offset); (2, 0) is eq. 7. ``decision`` predicts
    the first class whose F is positive (``list``, section 3) or the largest bin of z (``argmax``).
    Bins are at least ``clip``, 0 for none, before z is normalised again. With ``in_list_order``
    bins are summed in the order of the list, the last first, so that rounding and ties do not
    depend on the numbering of classes; else in the order of ``classes``, as in lists stored by
    earlier versions.
    """

    classes: NDArray[Any]
    order: NDArray[np.int64]
    classifiers: tuple[StrongClassifier | BoostedTrees, ...]
    calibration: NDArray[np.float64]
    n_features: int
    decision: str = "list"
    clip: float = 1e-6
    in_list_order: bool = False

    def __post_init__(self) -> None:
        """Check that the fields are consistent, and freeze them."""
        n_classes = len(self.classes)
        if n_classes < 2:
            raise InputError(f"a decision list needs at least two classes, got {n_classes}")
        if len(np.unique(self.classes)) != n_classes:
            raise InputError("classes must not repeat")
        order = integer_array("order", self.order, (n_classes,), low=0, high=n_classes)
        if len(np.unique(order)) != n_classes:
            raise InputError(f"order must name each class once, got {order.tolist()}")
        if len(self.classifiers) != n_classes - 1:
            raise InputError(
                f"{n_classes} classes need {n_classes - 1} classifiers, got {len(self.classifiers)}"
            )
        if len({classifier.feature.shape[1:] for classifier in self.classifiers}) > 1:
            raise InputError("the classifiers must all be stumps, or all be trees of one depth")
        calibration = finite_array("calibration", self.calibration, (n_classes - 1, 2))
        check_decision(self.decision, self.clip, n_classes)
        for k, classifier in enumerate(self.classifiers):
            if (classifier.feature >= self.n_features).any():
                raise InputError(
                    f"classifier {k} uses feature {int(classifier.feature.max())}, "
                    f"but there are {self.n_features} features"
                )
        set_frozen(self, classes=np.asarray(self.classes), order=order, calibration=calibration)

    @property
    def sequence(self) -> NDArray[np.int64]:
        """(K,) class indices in the order of sums and columns."""
        return self.order[::-1] if self.in_list_order else np.arange(len(self.classes))

    @property
    def used_features(self) -> NDArray[np.int64]:
        """The distinct columns that any classifier uses, ascending."""
        return np.unique(
            np.concatenate([classifier.used_features for classifier in self.classifiers])
        )

    def scores(self, X: NDArray[np.float32]) -> NDArray[np.float64]:
        """(K - 1, N) F of every classifier of the list."""
        return self._votes.scores(X)

    @cached_property
    def _votes(self) -> VoteTable:
        return VoteTable.of(self.classifiers)

    def log_histogram(self, X: NDArray[np.float32]) -> NDArray[np.float64]:
        """(N, K) log z: z[k] = C_k prod_{j<k} (1 - C_j), with C_K = 1 (eq. 8).

        In the order of ``classes``; clipped from below and normalised again if ``clip`` > 0.
        """
        return self.log_histogram_of(self.scores(X))

    def log_histogram_of(self, scores: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, K) log z from F (K - 1, N); see :meth:`log_histogram`."""
        log_z = self._unclipped(scores)
        if self.clip > 0:
            np.maximum(log_z, np.log(self.clip), out=log_z)
            bins = np.exp(log_z[:, self.sequence] if self.in_list_order else log_z)
            log_z -= np.log(bins.sum(axis=1, keepdims=True))
        return log_z

    def _unclipped(self, scores: NDArray[np.float64]) -> NDArray[np.float64]:
        log_z = np.empty((scores.shape[1], len(self.classes)))
        remaining = np.zeros(scores.shape[1])
        for k, (score, (slope, offset)) in enumerate(zip(scores, self.calibration, strict=True)):
            logit = slope * score + offset
            log_yes = -np.logaddexp(0.0, -logit)  # log of the logistic function
            log_z[:, self.order[k]] = remaining + log_yes
            remaining += log_yes - logit  # log(1 - C+)
        log_z[:, self.order[-1]] = remaining
        return log_z

    def decide(self, X: NDArray[np.float32]) -> NDArray[np.int64]:
        """(N,) index into ``classes`` of the predicted label."""
        scores = self.scores(X)
        if self.decision == "argmax":
            return self._unclipped(scores).argmax(axis=1)
        return first_positive(scores, self.order)

    def restricted(self, columns: ArrayLike) -> Self:
        """The list for matrices with only these columns, in this order; used ones must be there."""
        chosen = integer_array("columns", columns, ("n",), low=0, high=self.n_features)
        place = np.full(self.n_features, -1, np.int64)
        place[chosen] = np.arange(len(chosen))
        if len(np.unique(chosen)) != len(chosen):
            raise InputError("columns must not name a column twice")
        missing = self.used_features[place[self.used_features] < 0]
        if len(missing):
            raise InputError(
                f"the list needs columns {missing[:5].tolist()}, which are not among the "
                f"{len(chosen)} passed; used_features_ has all that it needs"
            )
        parts = tuple(classifier.renumbered(place) for classifier in self.classifiers)
        return replace(self, classifiers=parts, n_features=len(chosen))

    def part(self, columns: ArrayLike) -> Self:
        """The stumps on these columns, for matrices with only these columns, in this order.

        F is a sum over stumps: :meth:`scores` of parts with disjoint columns sum to the list's, up
        to rounding. Trees use several columns together: InputError.
        """
        chosen = integer_array("columns", columns, ("n",), low=0, high=self.n_features)
        if isinstance(self.classifiers[0], BoostedTrees):
            raise InputError(
                "a list of trees cannot be split by columns; boost stumps instead (max_depth=1)"
            )
        own = tuple(
            classifier[np.isin(classifier.feature, chosen)] for classifier in self.classifiers
        )
        return replace(self, classifiers=own).restricted(chosen)

    def features_in_order_of_choice(self, limit: int | None = None) -> NDArray[np.int64]:
        """The distinct columns in the order of choice, round by round, at most ``limit``."""
        distinct = {split.column: None for split in self._splits()}
        return np.array(list(distinct)[:limit], np.int64)

    def weak_outputs(self, X: NDArray[np.float32], limit: int | None = None) -> NDArray[np.int8]:
        """(N, S) outputs +1 or -1 of the distinct stumps, or splits, in the order of choice."""
        distinct: dict[tuple[int, float], TreeSplit] = {}
        for split in self._splits():
            distinct.setdefault((split.column, split.threshold), split)
        picked = list(distinct.values())[:limit]
        out = np.empty((len(X), len(picked)), np.int8)
        for s, split in enumerate(picked):
            out[:, s] = np.where(X[:, split.column] < split.cut, split.left, -split.left)
        return out

    def _splits(self) -> Iterator[TreeSplit]:
        """All splits: every classifier's first round, then every second one, ..."""
        longest = max(classifier.n_rounds for classifier in self.classifiers)
        for t in range(longest):
            for classifier in self.classifiers:
                if t < classifier.n_rounds:
                    yield from classifier.splits(t)

    def to_arrays(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """A JSON-compatible description and the arrays, as input of :meth:`from_arrays`."""
        sizes = [classifier.n_rounds for classifier in self.classifiers]
        like = self.classifiers[0]
        meta = {
            "kind": _KIND,
            "version": _TREES_VERSION if isinstance(like, BoostedTrees) else _VERSION,
            "classes": self.classes.tolist(),
            "n_features": self.n_features,
            "decision": self.decision,
            "clip": self.clip,
            "in_list_order": self.in_list_order,
        }
        arrays: dict[str, NDArray[Any]] = {
            "order": self.order,
            "calibration": self.calibration,
            "first": np.cumsum([0, *sizes]).astype(np.int64),
        }
        for attribute in fields(like):
            arrays[attribute.name] = np.concatenate(
                [getattr(classifier, attribute.name) for classifier in self.classifiers]
            )
        return meta, arrays

    @classmethod
    def from_arrays(cls, meta: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> Self:
        """The list stored by :meth:`to_arrays`; ModelFileError if it is damaged."""
        try:
            return cls._from_checked(meta, arrays)
        except ModelFileError:
            raise
        except KeyError as error:
            raise ModelFileError(f"the stored decision list lacks {error}") from None
        except (InputError, TypeError, ValueError, AttributeError) as error:
            raise ModelFileError(f"the stored decision list is damaged: {error}") from None

    @classmethod
    def _from_checked(cls, meta: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> Self:
        kind, version = meta["kind"], meta["version"]
        if kind != _KIND or version not in (_VERSION, _TREES_VERSION):
            raise ModelFileError(
                f"a {_KIND!r} of version {_VERSION} or {_TREES_VERSION} was expected, got "
                f"{quoted(kind)} of version {quoted(version)}"
            )
        n_features = meta["n_features"]
        if type(n_features) is not int or not 1 <= n_features <= _MAX_FEATURES:
            raise ModelFileError(
                f"n_features must be 1 to {_MAX_FEATURES}, got {quoted(n_features)}"
            )
        classes = _stored_classes(meta["classes"])
        feature = arrays["feature"]
        total, least = len(feature), 0 if version == _VERSION else -1
        integer_array("feature", feature, feature.shape, low=least, high=n_features)
        first = integer_array("first", arrays["first"], (len(classes),), low=0, high=total + 1)
        if first[0] != 0 or first[-1] != total or (np.diff(first) < 0).any():
            raise ModelFileError(f"first must ascend from 0 to {total}, got {first.tolist()}")
        spans = [slice(*span) for span in pairwise(first.tolist())]
        kind = StrongClassifier if version == _VERSION else BoostedTrees
        joined = kind(*(arrays[attribute.name] for attribute in fields(kind)))
        return cls(
            classes,
            arrays["order"],
            tuple(joined[span] for span in spans),
            arrays["calibration"],
            n_features,
            meta["decision"],
            meta["clip"],
            bool(meta.get("in_list_order", False)),
        )


def check_decision(decision: str, clip: float, n_classes: int) -> None:
    """Raise InputError on an unknown decision rule, or a clip not below 1/n_classes."""
    if decision not in _DECISIONS:
        raise InputError(f"decision must be one of {', '.join(_DECISIONS)}, got {quoted(decision)}")
    is_number = isinstance(clip, int | float | np.number) and not isinstance(clip, bool)
    if not is_number or not 0 <= clip < 1 / n_classes:
        raise InputError(f"clip must be at least 0 and below 1/{n_classes}, got {clip!r}")


def first_positive(scores: NDArray[np.float64], order: NDArray[np.int64]) -> NDArray[np.int64]:
    """(N,) the class of the first classifier with F > 0, else the last of the order."""
    chosen = np.full(scores.shape[1], order[-1], np.int64)
    for k in range(len(scores) - 1, -1, -1):
        chosen[scores[k] > 0] = order[k]
    return chosen


def _stored_classes(labels: object) -> NDArray[np.generic]:
    if not isinstance(labels, list) or len({type(label) for label in labels}) != 1:
        raise ModelFileError("classes must be a list of labels of one type")
    if not isinstance(labels[0], str | int | float | bool):
        raise ModelFileError(
            f"a class must be a string or a number, got {type(labels[0]).__name__}"
        )
    return np.array(labels)


_SLOPE = 2.0  # the slope of equation 7, so that F has the same meaning as in a boosted list


def list_average(lists: Sequence[BoostedList]) -> BoostedList:
    """A list whose log-odds are the mean log-odds of several lists of trees.

    It has all trees, with leaves scaled by 1 / L for L lists and by each list's calibration
    (Breiman, Bagging predictors, Machine Learning 24, 1996; here the lists differ in their training
    maps). The lists need trees of one depth, equal columns, and equal classes in equal order.
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
                np.mean([one.calibration[:, 1] for one in lists], axis=0),
            ],
            axis=1,
        ),
    )


def _mean_of(lists: Sequence[BoostedList], k: int) -> BoostedTrees:
    """The trees of the k-th classifiers of all lists."""
    classifiers = [one.classifiers[k] for one in lists]
    trees = [voters for voters in classifiers if isinstance(voters, BoostedTrees)]
    if len(trees) < len(classifiers):
        raise InputError("lists of stumps cannot be averaged; boost trees instead (max_depth >= 2)")
    factors = [one.calibration[k, 0] / (_SLOPE * len(lists)) for one in lists]
    return BoostedTrees(
        np.concatenate([one.feature for one in trees]),
        np.concatenate([one.cut for one in trees]),
        np.concatenate(
            [factor * one.value for factor, one in zip(factors, trees, strict=True)],
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
