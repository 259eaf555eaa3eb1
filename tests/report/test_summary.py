"""The first sentences of a report."""

from dataclasses import replace

from pgm_places.evaluation.bootstrap import Interval, SignTest
from pgm_places.experiment.significance import Difference
from pgm_places.report.summary import _evidence


def test_a_single_building_has_no_sign_test() -> None:
    found = Difference("a", "b", "accuracy", Interval(0.02, 0.01, 0.03), SignTest(1, 0, 0))
    assert "sign test" not in _evidence(found)
    assert "ahead in 1 and behind in 1 of 2 buildings" in _evidence(
        replace(found, buildings=SignTest(1, 1, 0))
    )
