"""Temperature scaling of lists, by what they say of buildings held out."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pgm_places.models.boosted_list import BoostedList

__all__ = ["with_temperatures"]


def with_temperatures(
    fitted: BoostedList,
    lists: dict[int, BoostedList],
    features: NDArray[np.float32],
    truth: NDArray[np.int64],
    groups: NDArray[np.int64],
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
        rows = groups == fold
        slope, offset = item.calibration.T[:, :, None]
        logits.append(slope * item.scores(features[rows]) + offset)
        label.append(truth[rows])
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
