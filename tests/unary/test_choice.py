"""The choice of the unary by held-out scores: which one is taken, and what its record says."""

from dataclasses import asdict

import numpy as np
import pytest

from pgm_places.errors import InputError
from pgm_places.unary.options import UnaryChoice, accuracy_by_part

SAFE = [0.8, 0.9, 0.7]


@pytest.mark.parametrize(
    ("parts", "chosen"),
    [
        ({}, "laser+space"),
        ({"laser": [0.8, 0.9, 0.7]}, "laser+space"),  # a tie
        ({"laser": [0.81, 0.91, 0.71]}, "laser"),  # ahead everywhere, by the same
        ({"space": [0.99, 0.92, 0.66]}, "laser+space"),  # 5.7 points ahead, give or take 6.7
        ({"space": [0.99, 0.99, 0.99]}, "space"),
        ({"laser": [0.85, 0.95, 0.75], "space": [0.9, 0.99, 0.8]}, "space"),  # the better of two
        ({"laser": [0.9, 0.99, 0.8], "space": [0.85, 0.95, 0.75]}, "laser"),
        ({"space": [0.7, 0.8, 0.6]}, "laser+space"),
    ],
)
def test_another_is_taken_only_where_it_is_ahead_by_more_than_its_standard_error(
    parts: dict[str, list[float]], chosen: str
) -> None:
    found = UnaryChoice.of({"laser+space": SAFE, **parts}, "buildings")
    assert found.unary == chosen
    assert found == UnaryChoice.of({"laser+space": SAFE, **parts}, "buildings")
    assert found.scores == {
        name: pytest.approx(np.mean(values))
        for name, values in {"laser+space": SAFE, **parts}.items()
    }


def test_a_single_part_has_no_error() -> None:
    assert UnaryChoice.of({"laser": [0.5], "context": [0.51]}, "blocks").unary == "context"


def test_accuracy_of_each_part_is_the_mean_recall_of_its_labels() -> None:
    truth = np.array([0, 0, 1, 2, 1, 1])
    scores = np.log(np.eye(3)[[0, 1, 1, 2, 1, 0]] * 0.8 + 0.1)
    found = accuracy_by_part(truth, scores, np.array([4, 4, 4, 4, 7, 7]), 3)
    np.testing.assert_allclose(found, [(0.5 + 1 + 1) / 3, 0.5])


def test_a_record_comes_back_and_a_damaged_one_is_refused() -> None:
    found = UnaryChoice.of({"laser+space": SAFE, "laser": [0.1, 0.2, 0.3]}, "blocks")
    record = asdict(found)
    assert UnaryChoice.from_record(record) == found
    for damage in (
        {"unary": "context"},
        {"scores": {"laser": 80.0, "laser+space": 0.5}},
        {"scores": {"lidar": 0.5, "laser+space": 0.5}},
        {"scores": [0.5]},
        {"held_out": "cells"},
    ):
        with pytest.raises(InputError, match="unary_choice must name a unary with its scores"):
            UnaryChoice.from_record({**record, **damage})
