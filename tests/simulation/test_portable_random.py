import numpy as np
import pytest

from pgm_places.simulation.portable_random import Dice


def test_the_same_numbers_everywhere() -> None:
    dice = Dice(3, 1)
    assert [dice.integer(0, 99) for _ in range(5)] == [25, 40, 34, 42, 53]
    assert Dice(3, 1).integers(0, 99, 5).tolist() == [25, 40, 34, 42, 53]


def test_streams_differ() -> None:
    assert Dice(0, 0).integers(0, 9, 50).tolist() != Dice(0, 1).integers(0, 9, 50).tolist()


@pytest.mark.parametrize(("low", "high"), [(0, 0), (-3, 4), (10, 12)])
def test_both_ends_come_up_and_nothing_beyond(low: int, high: int) -> None:
    drawn = Dice(0, 0).integers(low, high, 400)
    assert set(drawn.tolist()) == set(range(low, high + 1))


def test_chances_are_kept() -> None:
    dice = Dice(1, 0)
    hits = np.mean([dice.chance(1, 4) for _ in range(2000)])
    assert hits == pytest.approx(0.25, abs=0.04)


def test_a_choice_is_one_of_the_options() -> None:
    dice = Dice(1, 0)
    assert {dice.choice("abc") for _ in range(50)} == {"a", "b", "c"}
