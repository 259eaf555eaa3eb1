"""Columns of samples laid side by side for kernels: blocks of sixteen, and what is left of them."""

import numpy as np
import pytest

from pgm_places.models._gathering_kernels import BLOCK, gather


@pytest.mark.parametrize("width", [1, 15, 16, 17, 50, 100])
@pytest.mark.parametrize("size", [1, 16, 19, BLOCK])
@pytest.mark.parametrize("share", [0.1, 0.5, 1.0])
def test_wanted_columns_are_gathered(width: int, size: int, share: float) -> None:
    rng = np.random.default_rng(width + size)
    X = rng.normal(size=(BLOCK + 7, width)).astype(np.float32)
    columns = np.sort(rng.permutation(width)[: max(1, int(share * width))]).astype(np.int64)
    values = np.full((len(columns) + 1, BLOCK), np.nan, np.float32)
    start = BLOCK + 7 - size
    gather(X, start, size, columns, values)
    np.testing.assert_array_equal(values[:-1, :size], X[start:, columns].T)
