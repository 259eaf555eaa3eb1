"""The mean of several lists of trees, as one list."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pgm_places.errors import InputError
from pgm_places.models.boosted_list import BoostedList, list_average
from pgm_places.models.decision_list import DecisionListClassifier
from tests.refusals import refused

RNG = np.random.default_rng(8)
X = RNG.normal(size=(600, 6)).astype(np.float32)
Y = np.where(X[:, 0] * X[:, 1] > 0.4, 1, np.where(X[:, 2] > 0, 2, 0))


def fitted(rows: slice = slice(None), **options: Any) -> BoostedList:
    wanted = {"n_rounds": 6, "max_depth": 2, "shrinkage": 0.3, "order": [1, 2, 0], **options}
    found: BoostedList = DecisionListClassifier(**wanted).fit(X[rows], Y[rows]).boosted_list_
    return found


def log_odds(item: BoostedList) -> np.ndarray:
    slope, offset = item.calibration.T[:, :, None]
    return np.asarray(slope * item.scores(X) + offset)


def test_its_log_odds_are_the_mean_of_those_of_the_lists() -> None:
    lists = [
        fitted(slice(0, 300), prior_weight=0.5),
        fitted(slice(300, 600), n_rounds=9, prior_weight=1.0),
        fitted(slice(100, 500)),
    ]
    other = np.array([[1.3, 0.2], [0.7, -0.4]])
    lists.append(replace(lists[0], calibration=other))
    wanted = np.mean([log_odds(item) for item in lists], axis=0)
    np.testing.assert_allclose(log_odds(list_average(lists)), wanted, rtol=0, atol=1e-5)


def test_the_mean_of_one_list_is_that_list() -> None:
    one = fitted()
    assert list_average([one]) is one


@pytest.mark.parametrize(
    ("other", "message"),
    [
        (lambda: fitted(order=[2, 1, 0]), r"in one order can be averaged, got \[1, 2, 0\] and"),
        (lambda: fitted(Y[:600] != 2, order=[1, 0]), r"same classes can be averaged, got \[0, 1"),
        (lambda: replace(fitted(), n_features=9), "on 6 and 9 columns"),
    ],
)
def test_lists_that_do_not_match_are_refused(other: Any, message: str) -> None:
    refused(InputError, message, list_average, [fitted(), other()])
    stumps = fitted(max_depth=1, shrinkage=1.0)
    refused(InputError, "lists of stumps cannot be averaged", list_average, [stumps, stumps])
