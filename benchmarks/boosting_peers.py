"""What boosting is compared with: an exhaustive sweep of our own, and other packages' stumps.

The sweep is what a careful programmer would write first: every round passes over all presorted
values of all features. Its stumps are the ones that ours must be.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
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
) -> tuple[float, float, str]:
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
    return prepare_s, rounds_s, " stumps"


def opencv_boost(
    X: NDArray[np.float32], own: NDArray[np.bool_], n_rounds: int
) -> tuple[float, float, str]:
    """OpenCV's discrete AdaBoost with stumps and no trimming, from runs of one and three rounds."""
    import cv2

    if not hasattr(cv2, "ml"):
        raise ImportError("this OpenCV has no ml module")
    cv2.setNumThreads(1)

    def train(count: int) -> None:
        ml: Any = cv2.ml
        model = ml.Boost_create()
        model.setBoostType(cv2.ml.BOOST_DISCRETE)
        model.setWeakCount(count)
        model.setWeightTrimRate(0.0)
        model.setMaxDepth(1)
        model.setUseSurrogates(False)
        model.train(X, cv2.ml.ROW_SAMPLE, own.astype(np.int32))

    one, _ = seconds_of(lambda: train(1))
    three, _ = seconds_of(lambda: train(3))
    per_round = (three - one) / 2
    return max(0.0, one - per_round), per_round * n_rounds, " Boost *"


def lightgbm_trees(
    X: NDArray[np.float32], own: NDArray[np.bool_], n_rounds: int, depth: int
) -> tuple[float, float]:
    """Binning and rounds of LightGBM with trees of so many levels."""
    import lightgbm

    options = {
        "objective": "binary", "num_leaves": 2**depth, "max_depth": depth, "max_bin": 255,
        "min_data_in_leaf": 20, "num_threads": 1, "verbose": -1, "learning_rate": 0.3,
    }  # fmt: skip
    data = lightgbm.Dataset(X, own.astype(np.float32), weight=balanced(own), params=options)
    prepare_s, data = seconds_of(data.construct)
    rounds_s, _ = seconds_of(lambda: lightgbm.train(options, data, num_boost_round=n_rounds))
    return prepare_s, rounds_s


def histogram_boosting(
    X: NDArray[np.float32], own: NDArray[np.bool_], n_rounds: int, depth: int
) -> tuple[float, float]:
    """Binning and rounds of scikit-learn's histogram gradient boosting.

    In a process of its own that was told to use one thread before it started: threads that wait
    for each other would count as work.
    """
    with tempfile.TemporaryDirectory() as folder:
        np.savez(Path(folder) / "data.npz", X=X, own=own, weight=balanced(own))
        done = subprocess.run(
            [sys.executable, "-c", _HISTOGRAM_BOOSTING, folder, str(n_rounds), str(depth)],
            env={**os.environ, "OMP_NUM_THREADS": "1"},
            capture_output=True,
            text=True,
            check=True,
        )
    few, many = (float(text) for text in done.stdout.split())
    return few - 2 * (many - few) / n_rounds, many - few


_HISTOGRAM_BOOSTING = """
import sys, time
import numpy as np
from sklearn.ensemble import HistGradientBoostingClassifier
folder, n_rounds, depth = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
data = dict(np.load(folder + "/data.npz"))
def seconds(count):
    start = time.process_time()
    HistGradientBoostingClassifier(
        learning_rate=0.3, max_iter=count, max_leaf_nodes=2**depth, max_depth=depth,
        early_stopping=False,
    ).fit(data["X"], data["own"], sample_weight=data["weight"])
    return time.process_time() - start
for count in (2, 2 + n_rounds):
    print(min(seconds(count) for _ in range(3)))
"""
