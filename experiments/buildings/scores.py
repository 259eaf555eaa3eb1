"""Held-out scores with confidences that are right in buildings left out."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from experiments.buildings.lists import AVERAGE, CORRIDOR, Scored
from experiments.buildings.maps import NAMES
from pgm_places.models.list_training import platt, temperature
from pgm_places.unary.cell_scorers import without_halls

SHIPPED = "temperature"
RESCALED = ("platt", SHIPPED)
"""The calibrations of the list to compare."""

_ORDER = {3: (2, 0, 1), 4: (2, 3, 0, 1)}
"""The list's classes, the rarest first, without and with halls."""


def rescaled(scored: Sequence[Scored], how: str) -> list[NDArray[np.float64]]:
    """(m, K) log z of every map with confidences rescaled by the held-out cells of other folds.

    ``how`` is one of ``RESCALED``. All maps have the same weight, as in training.
    """
    fold = np.array([item.fold for item in scored])
    order = _ORDER[scored[0].log_z[AVERAGE].shape[1]]
    logits = [_logits(item.log_z[AVERAGE], order) for item in scored]
    scales = {}
    for number in np.unique(fold).tolist():
        others = [k for k in range(len(scored)) if fold[k] != number]
        truths = [scored[k].finer for k in others]
        scales[number] = _scales(truths, [logits[k] for k in others], order, how)
    found = [
        _log_z(own, scales[item.fold], order) for item, own in zip(scored, logits, strict=True)
    ]
    return [z if z.shape[1] == len(NAMES) else without_halls(z, CORRIDOR)[0] for z in found]


def _logits(log_z: NDArray[np.float64], order: tuple[int, ...]) -> NDArray[np.float64]:
    """(K - 1, m) log odds that each confidence of the list, rarest label first, stands for."""
    found = []
    for i, k in enumerate(order[:-1]):
        rest = np.logaddexp.reduce(log_z[:, order[i + 1 :]], axis=1)
        found.append(log_z[:, k] - rest)
    return np.array(found)


def _scales(
    truths: Sequence[NDArray[np.int64]],
    logits: Sequence[NDArray[np.float64]],
    order: tuple[int, ...],
    how: str,
) -> list[tuple[float, float]]:
    truth, values = np.concatenate(truths), np.concatenate(logits, axis=1)
    weight = np.concatenate([np.full(len(part), 1000.0 / max(len(part), 1)) for part in truths])
    found = []
    for i, k in enumerate(order[:-1]):
        remaining = np.isin(truth, order[i:])
        examples = values[i, remaining], truth[remaining] == k, weight[remaining]
        found.append(platt(*examples) if how == "platt" else (temperature(*examples), 0.0))
    return found


def _log_z(
    logits: NDArray[np.float64], scales: Sequence[tuple[float, float]], order: tuple[int, ...]
) -> NDArray[np.float64]:
    found = np.empty((logits.shape[1], len(order)))
    remaining = np.zeros(logits.shape[1])
    for k, values, (slope, offset) in zip(order, logits, scales, strict=False):
        scaled = slope * values + offset
        found[:, k] = remaining - np.logaddexp(0.0, -scaled)
        remaining = remaining - np.logaddexp(0.0, scaled)
    found[:, order[-1]] = remaining
    return found
