"""The protocol of detectors, counts over time, and what goes wrong with either."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places.errors import InputError
from pgm_places.features.object_counts import PAPER_OBJECTS, Detector, ObjectCounts, count_objects
from tests.refusals import refused


class Fixed:
    """A detector that says what it is told."""

    object_names = ("cup", "chair")

    def count(self, observation: Any) -> Any:
        return observation


def test_counts_come_in_the_order_of_the_observations() -> None:
    detector: Detector[Any] = Fixed()
    assert isinstance(detector, Detector)
    assert count_objects(detector, iter([[1, 2], [0, 3]])).tolist() == [[1, 2], [0, 3]]
    assert count_objects(detector, []).shape == (0, 2)
    assert len(PAPER_OBJECTS) == 8


@pytest.mark.parametrize("wrong", [[1], [1, -1], [0.5, 1.0], [[1, 2]]])
def test_a_detector_must_count_every_class(wrong: Sequence[Any]) -> None:
    with pytest.raises(InputError, match="a detector of cup, chair must count each of them"):
        count_objects(Fixed(), [wrong])


TIMES = st.lists(st.integers(0, 40).map(float), min_size=1, max_size=8, unique=True)


@given(TIMES, st.lists(st.floats(-5, 45), max_size=8), st.floats(0, 10))
def test_each_step_gets_the_nearest_observation(
    times: list[float], steps: list[float], within_s: float
) -> None:
    counts = np.arange(1, len(times) + 1)[:, None]
    seen = ObjectCounts(np.array(times), counts, ("cup",))
    columns = seen.at(steps, within_s=within_s)
    assert columns.dtype == np.float32
    assert columns.shape == (len(steps), 1)
    for step, value in zip(steps, columns[:, 0].tolist(), strict=True):
        away = np.abs(np.array(times) - step)
        if away.min() > within_s:
            assert value == 0
        else:
            assert away[int(value) - 1] == away.min()


def test_of_two_observations_as_near_the_earlier_counts() -> None:
    seen = ObjectCounts(np.array([2.0, 0.0, 4.0]), np.array([[2], [1], [3]]), ("cup",))
    assert seen.at([1.0, 3.0], within_s=1.0).tolist() == [[1.0], [2.0]]


def test_columns_can_be_those_of_a_model() -> None:
    seen = ObjectCounts(np.array([1.0]), np.array([[2, 3]]), ("cup", "chair"))
    columns = seen.at([1.0], within_s=0.0, object_names=("sofa", "chair"))
    assert columns.tolist() == [[0.0, 3.0]]


def test_no_observation_is_no_object() -> None:
    none = ObjectCounts(np.zeros(0), np.zeros((0, 1), int), ("cup",))
    assert none.at([0.0, 5.0], within_s=100.0).tolist() == [[0.0], [0.0]]


def test_counts_are_put_in_order_of_time() -> None:
    seen = ObjectCounts(np.array([3.0, 1.0]), np.array([[3], [1]]), ("cup",))
    assert seen.times_s.tolist() == [1.0, 3.0]
    assert seen.counts.tolist() == [[1], [3]]


@pytest.mark.parametrize(
    ("times", "counts", "names", "words"),
    [
        ([0.0], [[1, 2]], ("cup",), "counts must have shape"),
        ([0.0], [[-1]], ("cup",), "counts must hold integers from 0"),
        ([np.nan], [[1]], ("cup",), "times_s must hold finite numbers"),
        ([0.0], [[1, 1]], ("cup", "cup"), "object_names must differ, got cup"),
    ],
)
def test_what_does_not_fit_is_refused(
    times: list[float], counts: list[list[int]], names: tuple[str, ...], words: str
) -> None:
    refused(InputError, words, ObjectCounts, np.array(times), np.array(counts), names)


def test_a_negative_tolerance_is_refused() -> None:
    seen = ObjectCounts(np.array([1.0]), np.array([[2]]), ("cup",))
    refused(InputError, "within_s must be at least 0", seen.at, [1.0], within_s=-1.0)
