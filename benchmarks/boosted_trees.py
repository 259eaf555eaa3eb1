"""Boosting small trees: gentle AdaBoost, 20 rounds.

Doorways against all other labels, on the 321 features of the cells of building 79 at 5 cm if the
data is available, otherwise of the generated building. Trees of D levels have at most 2^D leaves.
Seconds are processor time on one thread. LightGBM and scikit-learn's histogram gradient boosting
grow trees with the same numbers of leaves and levels, leaf by leaf, from 255 bins with a logistic
loss. For the latter, the time of the rounds is the difference of two runs; the rest is preparation.
"""

import sys
from typing import Any

import numpy as np

from benchmarks import boosting_peers as peers
from benchmarks.boosting import Matrix, Row, timed, training_data
from pgm_places.kernels.threads import threads
from pgm_places.models.boosting_rounds import boost
from pgm_places.models.gentle_boosting import boost_trees
from pgm_places.models.sorted_features import SortedFeatures, prepare

DEPTHS = (2, 3, 4)
PEERS_DEPTH = 3


def row(method: str, depth: int, prepare_s: float, rounds_s: float, n_rounds: int) -> Row:
    """One method's line."""
    n_splits = n_rounds * (2**depth - 1)
    return {
        "method": method,
        "levels": depth,
        "preparation s": prepare_s,
        "rounds s": rounds_s,
        "ms per round": 1e3 * rounds_s / n_rounds,
        "ms per split": 1e3 * rounds_s / n_splits,
    }


def boosted(prepared: SortedFeatures, depth: int, n_rounds: int) -> Any:
    """The paper's stumps, or trees."""
    if depth == 1:
        return boost(prepared, [1], [0], n_rounds=n_rounds)
    return boost_trees(prepared, [1], [0], n_rounds=n_rounds, max_depth=depth, shrinkage=0.3)


def training(X: Matrix, own: Any, n_rounds: int, repeats: int) -> list[Row]:
    """Ours depth by depth, and the peers."""
    rows = []
    part = own.astype(np.int64)
    for depth in (1, *DEPTHS):
        prepare_s, prepared = timed(lambda: prepare(X, part), repeats)
        rounds_s, _ = timed(lambda p=prepared, d=depth: boosted(p, d, n_rounds), repeats)
        name = "pgm_places, stumps" if depth == 1 else "pgm_places, trees"
        rows.append(row(name, depth, prepare_s, rounds_s, n_rounds))
    for name, work in (
        ("LightGBM", peers.lightgbm_trees),
        ("scikit-learn HistGradientBoosting", peers.histogram_boosting),
    ):
        try:
            prepare_s, rounds_s = work(X, own, n_rounds, PEERS_DEPTH)
        except ImportError as error:
            print(f"{name}: skipped, {error}", file=sys.stderr)
        else:
            rows.append(row(name, PEERS_DEPTH, prepare_s, rounds_s, n_rounds))
    return rows


def prediction(X: Matrix, own: Any, n_rounds: int, repeats: int) -> list[Row]:
    """Trained classifiers evaluated on all examples, reading only the columns they use."""
    prepared = prepare(X, own.astype(np.int64))
    rows = []
    for depth in (1, *DEPTHS):
        found = boosted(prepared, depth, n_rounds)
        used = found.used_features
        place = np.full(X.shape[1], -1)
        place[used] = np.arange(len(used))
        small, moved = np.ascontiguousarray(X[:, used]), found.renumbered(place)
        seconds, _ = timed(lambda m=moved, x=small: m.scores(x), 5 * repeats)
        rows.append(
            {
                "prediction by": "stumps" if depth == 1 else f"trees of {2**depth} leaves",
                "columns": len(used),
                "rounds": found.n_rounds,
                "examples": len(X),
                "ms": 1e3 * seconds,
                "ns per example": 1e9 * seconds / len(X),
                "ns per example and round": 1e9 * seconds / len(X) / found.n_rounds,
            }
        )
    return rows


def run(quick: bool) -> list[Row]:
    """The rows of the tables."""
    n_rows, n_rounds, repeats = (4_000, 5, 1) if quick else (100_000, 20, 3)
    title, X, y = training_data(n_rows)
    print(f"{title}: {X.shape[0]} x {X.shape[1]}", file=sys.stderr, flush=True)
    own = y == 2
    warm = prepare(X[::97], own[::97].astype(np.int64))
    for depth in (1, *DEPTHS):
        boosted(warm, depth, 2).scores(X[:200])
    with threads(1):
        return training(X, own, n_rounds, repeats) + prediction(X, own, 5 * n_rounds, repeats)
