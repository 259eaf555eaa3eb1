"""Numbers of the first page of a report: ends of intervals, and the scale below the methods."""

import pytest

from pgm_places.evaluation.bootstrap import Interval, SignTest
from pgm_places.experiment.significance import Difference
from pgm_places.report.comparison_page import AccuracyAxis, _evidence


@pytest.mark.parametrize(("low", "shown"), [(-0.00004, "0.0 to"), (-0.0006, "−0.06 to")])
def test_an_end_of_an_interval_is_never_minus_zero(low: float, shown: str) -> None:
    found = Difference("a", "b", "accuracy", Interval(0.01, low, 0.02), SignTest(1, 0, 0))
    assert f" {shown} 2.0 points" in _evidence(found)


def test_an_axis_names_its_ends_and_a_step_in_the_middle() -> None:
    odd, even = (AccuracyAxis.over(*ends).ticks() for ends in ((0.92, 0.97), (0.6, 1.0)))
    assert [at for at, _ in odd] == pytest.approx([0, 20, 40, 60, 80, 100])
    assert [words for _, words in odd] == ["92 %", "", "", "", "", "97 %"]
    assert [words for _, words in even] == ["60 %", "", "80 %", "", "100 %"]
