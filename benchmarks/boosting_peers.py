"""Peers of boosting: an exhaustive sweep as reference, and stumps of other packages.

The sweep is what a careful programmer would write first: every round passes over all presorted
values of all features. Its stumps are the ones that ours must be.
"""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Stump = tuple[int, float, int]


def best_of_column(
    order: NDArray[np.int64], values: NDArray[np.float32], signed: NDArray[np.float64], total: float
) -> tuple[float, int]:
    """The largest |r| over the thresholds of one sorted column, and the last place on its left."""
    r = np.abs(2.0 * np.cumsum(signed[order])[:-1] - total)
    r[values[:-1] == values[1:]] = -1.0
    place = int(np.argmax(r >= r.max() - 1e-12))  # of equal ones the first, but for rounding
    return float(r[place]), place


def sweep(X: NDArray[np.float32], y: NDArray[np.bool_], n_rounds: int) -> list[Stump]:
    """The stumps of the first rounds of generalised AdaBoost."""
    columns = np.ascontiguousarray(X.T)
    orders = np.argsort(columns, axis=1, kind="stable")
    values = np.take_along_axis(columns, orders, axis=1)
    labels = np.where(y, 1.0, -1.0)
    weights = np.where(y, 0.5 / y.sum(), 0.5 / (~y).sum())
    stumps: list[Stump] = []
    for _ in range(n_rounds):
        weights /= weights.sum()
        signed = weights * labels
        total = float(signed.sum())
        best, column, place = -1.0, -1, -1
        for j in range(len(orders)):
            r, k = best_of_column(orders[j], values[j], signed, total)
            if r > best + 1e-12:
                best, column, place = r, j, k
        low, high = float(values[column, place]), float(values[column, place + 1])
        theta = low + (high - low) / 2
        left = X[:, column] < theta
        polarity = 1 if 2 * signed[left].sum() > total else -1
        alpha = np.arctanh(best)
        weights *= np.exp(-alpha * labels * polarity * np.where(left, 1.0, -1.0))
        stumps.append((column, theta, polarity))
    return stumps


def seconds_of(work: Callable[[], Any]) -> tuple[float, Any]:
    """Processor seconds of one run, and its result."""
    start = time.process_time()
    result = work()
    return time.process_time() - start, result


def balanced(own: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Weights that give both classes half."""
    return np.where(own, 0.5 / own.sum(), 0.5 / (~own).sum()) * len(own)


def scikit_learn(X: NDArray[np.float32], own: NDArray[np.bool_]) -> float:
    """Processor seconds of one round."""
    from sklearn.ensemble import AdaBoostClassifier
    from sklearn.tree import DecisionTreeClassifier

    model = AdaBoostClassifier(DecisionTreeClassifier(max_depth=1), n_estimators=2)
    seconds, _ = seconds_of(lambda: model.fit(X, own, sample_weight=balanced(own)))
    return seconds / 2


def lightgbm_stumps(
    X: NDArray[np.float32], own: NDArray[np.bool_], n_rounds: int
) -> tuple[float, float]:
    """Binning and rounds of LightGBM with trees of two leaves."""
    import lightgbm

    options = {
        "objective": "binary", "num_leaves": 2, "max_bin": 255, "min_data_in_leaf": 20,
 "num_threads": 1, "verbose": -1, "learning_rate": 0.5,
    }  # fmt: skip
    prepare_s, data = seconds_of(
        lambda: lightgbm.Dataset(
            X, own.astype(np.float32), weight=balanced(own), params=options
        ).construct()
    )
    rounds_s, _ = seconds_of(lambda: lightgbm.train(options, data, num_boost_round=n_rounds))
    return prepare_s, rounds_s
