"""Columns to learn from, of every kind that a search for splits treats differently."""

from typing import Any

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray


def random_columns(
    draw: st.DrawFn, rng: np.random.Generator, n: int, n_features: int
) -> NDArray[Any]:
    """(n, n_features) continuous, tied, sparse, repeated, constant and binary columns."""
    X = rng.normal(size=(n, n_features))
    for j in range(n_features):
        kind = draw(st.sampled_from(["normal", "tied", "sparse", "scaled", "constant", "binary"]))
        if kind == "tied":
            X[:, j] = np.round(2 * X[:, j])
        elif kind == "sparse":
            X[:, j] *= rng.random(n) < 0.1
        elif kind == "scaled":
            X[:, j] = 3 * X[:, 0]
        elif kind == "constant":
            X[:, j] = 7.0
        elif kind == "binary":
            X[:, j] = X[:, j] > 0.5
    return X
