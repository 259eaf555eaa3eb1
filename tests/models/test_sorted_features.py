from typing import Any

import numpy as np
import pytest

from pgm_places._core import bin_members, count_bins
from pgm_places.errors import InputError
from pgm_places.models.sorted_features import prepare
from tests.refusals import refused


def test_columns_that_order_the_examples_alike_are_kept_once() -> None:
    rng = np.random.default_rng(3)
    X = rng.normal(size=(5_000, 8)).astype(np.float32)
    X[:, 1] = np.round(X[:, 1])
    X[:, 2] = 1000 * X[:, 1] + 1
    X[:, 3] = X[:, 0]
    X[:, 4] *= rng.random(5_000) < 0.05
    X[:, 5] = -X[:, 0]
    X[:, 6] = 4.0
    prepared = prepare(X, rng.integers(-1, 3, 5_000))
    np.testing.assert_array_equal(prepared.columns, [0, 1, 4, 5, 6, 7])


def test_columns_that_differ_inside_one_bin_are_both_kept() -> None:
    rng = np.random.default_rng(4)
    X = np.sort(rng.normal(size=(5_000, 1)).astype(np.float32), axis=0)
    X = np.concatenate([X, X], axis=1)
    X[[101, 102], 1] = X[[102, 101], 1]
    prepared = prepare(X, np.zeros(5_000, np.int64))
    np.testing.assert_array_equal(prepared.codes[0], prepared.codes[1])
    np.testing.assert_array_equal(prepared.columns, [0, 1])


def test_memory_is_at_most_two_bytes_per_example_and_feature() -> None:
    rng = np.random.default_rng(0)
    X = rng.normal(size=(40_000, 20)).astype(np.float32)
    prepared = prepare(X, rng.integers(0, 2, 40_000))
    used = prepared.codes.nbytes + prepared.tables.cells.nbytes
    assert used <= 2 * X.size


@pytest.mark.parametrize(
    ("X", "part", "text"),
    [
        (np.zeros((3, 2)), np.zeros(3, np.int64), "X must be float32, got float64"),
        (np.zeros(3, np.float32), np.zeros(3, np.int64), "X must have shape"),
        (np.full((3, 2), np.nan, np.float32), np.zeros(3, np.int64), "X must hold finite numbers"),
        (np.zeros((3, 2), np.float32), np.zeros(2, np.int64), r"part must have shape \(3,\)"),
    ],
)
def test_bad_input_is_refused(X: Any, part: Any, text: str) -> None:
    refused(InputError, text, prepare, X, part)


def test_huge_finite_values_pass() -> None:
    X = np.full((4, 2), 3e38, np.float32)
    X[0] = -3e38
    assert prepare(X, np.array([0, 0, 1, 1])).codes.shape == (1, 4)


@pytest.mark.parametrize("n", [0, 1, 3, 4, 7, 1000])
def test_bins_are_counted(n: int) -> None:
    codes = np.random.default_rng(n).integers(0, 256, n).astype(np.uint8)
    counts = np.full(256, -1)
    count_bins(codes, counts)
    np.testing.assert_array_equal(counts, np.bincount(codes, minlength=256))


def test_members_of_a_bin_are_listed() -> None:
    codes = np.random.default_rng(0).integers(0, 5, 1000).astype(np.uint8)
    for wanted in range(6):
        members = np.empty(len(codes), np.int32)
        count = bin_members(codes, wanted, members)
        np.testing.assert_array_equal(members[:count], np.flatnonzero(codes == wanted))
