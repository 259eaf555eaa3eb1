"""Columns of samples laid side by side for kernels: squares of them, and what is left of them."""

import numpy as np
import pytest

from pgm_places.models.strong_classifier import StrongClassifier


@pytest.mark.parametrize("width", [1, 15, 16, 17, 50, 100])
@pytest.mark.parametrize("size", [1, 16, 19, 128, 300])
@pytest.mark.parametrize("share", [0.1, 0.5, 1.0])
def test_every_stump_sees_its_column(width: int, size: int, share: float) -> None:
    rng = np.random.default_rng(width + size)
    X = rng.normal(size=(size, width)).astype(np.float32)
    columns = rng.permutation(width)[: max(1, int(share * width))]
    alpha = rng.normal(size=len(columns))
    threshold = rng.normal(size=len(columns))
    classifier = StrongClassifier(columns, threshold, np.ones(len(columns), np.int8), alpha)
    wanted = np.zeros(size)
    for column, theta, vote in zip(columns, threshold, alpha, strict=True):
        wanted += np.where(X[:, column] < theta, vote, -vote)
    np.testing.assert_array_equal(classifier.scores(X), wanted)
