"""Fitting, cross-fitting and calibrating boosted decision lists."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.models.boosted_list import BoostedList
from pgm_places.models.list_average import list_average
from pgm_places.progress import report_stage
from pgm_places.unary.cell_scorers import aligned_log_proba

if TYPE_CHECKING:  # scikit-learn takes a second to import, and labelling does without it
    from pgm_places.models.decision_list import DecisionListClassifier

RAREST_FIRST = "rarest-first"
"""An order of the list that PlaceLabeler understands besides those of the list itself."""


def with_explicit_order(
    classifier: "DecisionListClassifier", truth: NDArray[np.int64]
) -> "DecisionListClassifier":
    """The list with ``"rarest-first"`` written out as the labels by increasing frequency.

    Asked first, a rare label is separated from everything by one classifier; asked last, it gets
    what the others leave. The paper's heuristic puts it last, since it is the hardest.
    """
    if not (isinstance(classifier.order, str) and classifier.order == RAREST_FIRST):
        return classifier
    labels, counts = np.unique(truth, return_counts=True)
    order = labels[np.argsort(counts, kind="stable")].tolist()
    return like(classifier, order=order)


@dataclass(frozen=True, eq=False)
class Rows:
    """What lists learn from.

    Parameters
    ----------
    features : (n, F) float32
    truth : (n,) int
        Label index of each row.
    groups : (n,) int or None
        Number of the fold that a row is held out with.
    domain : (n,) int or None
        -1 for rows that all lists learn from, see :func:`fitted_list`.
    """

    features: NDArray[np.float32]
    truth: NDArray[np.int64]
    groups: NDArray[np.int64] | None
    domain: NDArray[np.int64] | None = None

    def where(self, seen: NDArray[np.bool_]) -> "Rows":
        """The rows in a mask (n,)."""
        groups, domain = (
            None if part is None else part[seen] for part in (self.groups, self.domain)
        )
        return Rows(self.features[seen], self.truth[seen], groups, domain)


def fitted_list(unfitted: "DecisionListClassifier", rows: Rows) -> BoostedList:
    """The list that learned from all rows, or the mean of those that leave one domain out.

    What one list believes because of where a map comes from, those that have not seen such maps
    contradict: whole spaces flip between lists, and rarely in most of them at once.
    """
    remaining = without_a_domain(rows.truth, rows.domain)
    if len(remaining) > 1:
        return list_average([_fitted(unfitted, rows.where(seen)) for seen in remaining])
    return _fitted(unfitted, rows)  # a mask would copy all of them


def _fitted(unfitted: "DecisionListClassifier", rows: Rows) -> BoostedList:
    learned = like(unfitted).fit(rows.features, rows.truth, groups=rows.groups)
    boosted: BoostedList = learned.boosted_list_
    return boosted


def without_a_domain(
    truth: NDArray[np.int64], domain: NDArray[np.int64] | None
) -> list[NDArray[np.bool_]]:
    """The rows that remain without each domain, where all labels do; all rows if that is one."""
    everything = np.ones(len(truth), np.bool_)
    if domain is None:
        return [everything]
    remaining = [domain != number for number in np.unique(domain[domain >= 0])]
    n_labels = len(np.unique(truth))
    whole = [seen for seen in remaining if len(np.unique(truth[seen])) == n_labels]
    return whole if len(whole) > 1 else [everything]


def held_out_lists(
    unfitted: "DecisionListClassifier", rows: Rows, name: str
) -> dict[int, BoostedList]:
    """For each group a list that has not seen it, in the order, of labels, of the one given.

    With domains, each is the mean of lists that leave one of them out.
    """
    assert rows.groups is not None  # what they are held out by
    lists, folds = {}, np.unique(rows.groups).tolist()
    with report_stage(name) as stage:
        for count, fold in enumerate(folds, start=1):
            seen = replace(rows, groups=None).where(rows.groups != fold)
            order = [label for label in unfitted.order if (seen.truth == label).any()]
            if len(order) < 2:
                raise InputError(
                    "out-of-fold scores need at least two labels outside every group; "
                    "use fewer folds or learn_on='in-sample'"
                )
            lists[fold] = fitted_list(like(unfitted, order=order), seen)
            stage.update(count / len(folds))
    return lists


def scores_of(
    lists: dict[int, BoostedList],
    values: NDArray[np.float32],
    groups: NDArray[np.int64],
    n_labels: int,
) -> NDArray[np.float64]:
    """(n, K) log z of rows, each from the list of its group."""
    folds = np.unique(groups).tolist()
    if len({id(lists[fold]) for fold in folds}) == 1:
        return aligned_log_proba(lists[folds[0]], values, n_labels)
    scores = np.empty((len(values), n_labels))
    for fold in folds:
        rows = groups == fold
        scores[rows] = aligned_log_proba(lists[fold], values[rows], n_labels)
    return scores


def with_temperatures(
    fitted: BoostedList, lists: dict[int, BoostedList], rows: Rows
) -> tuple[BoostedList, dict[int, BoostedList]]:
    """A list and those that were held out, with the confidence that the latter justify.

    The log-odds of each classifier are multiplied by what makes the held-out examples likeliest
    (:func:`pgm_places.models.list_training.temperature`). Lists that lack a label, because no other
    group has it, have no part in this and keep their confidence.
    """
    from pgm_places.models.list_training import temperature

    whole = {fold: item for fold, item in lists.items() if item.order.size == fitted.order.size}
    order = fitted.classes[fitted.order]
    logits, label = [], []
    for fold, item in whole.items():
        unseen = rows.groups == fold
        slope, offset = item.calibration.T[:, :, None]
        logits.append(slope * item.scores(rows.features[unseen]) + offset)
        label.append(rows.truth[unseen])
    if not whole:
        return fitted, lists
    odds, found = np.concatenate(logits, axis=1), np.concatenate(label)
    factor = np.ones((len(order) - 1, 1))
    for i, k in enumerate(order[:-1]):
        mine = np.isin(found, order[i:])
        factor[i] = temperature(odds[i, mine], found[mine] == k, np.ones(int(mine.sum())))
    scaled = {
        fold: replace(item, calibration=factor * item.calibration) for fold, item in whole.items()
    }
    return replace(fitted, calibration=factor * fitted.calibration), {**lists, **scaled}


def in_the_order_of(
    fitted: BoostedList, unfitted: "DecisionListClassifier"
) -> "DecisionListClassifier":
    """An estimator that asks for labels in the order that another one has chosen."""
    return like(unfitted, order=fitted.classes[fitted.order].tolist())


def like(estimator: "DecisionListClassifier", **options: Any) -> "DecisionListClassifier":
    """The same estimator, not fitted, with some options changed."""
    from sklearn.base import clone

    other: DecisionListClassifier = clone(estimator).set_params(**options)
    return other
