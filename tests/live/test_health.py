"""Health reports the latest complaint, for as long as complaints count."""

import pytest

from pgm_places.live.health import ERROR, FRESH_S, OK, WARN, Health


@pytest.mark.parametrize("kinds", [("tf", "scan"), ("scan", "tf")])
def test_the_latest_of_several_complaints_is_named(kinds: tuple[str, str]) -> None:
    earlier, later = kinds
    said = {earlier: (1.0, "z: the earlier one"), later: (2.0, "a: the later one")}
    for order in (said, dict(reversed(said.items()))):
        health = Health(reports=order, heard_s=3.0)
        assert health.level(3.0) == (WARN, "a: the later one")
        assert health.level(2.0 + FRESH_S) == (OK, "no place yet")


def test_a_silent_robot_is_an_error_and_one_that_was_never_heard_a_warning() -> None:
    assert Health(silent_s=5.0).level(100.0)[0] == WARN
    assert Health(silent_s=5.0, heard_s=1.0).level(6.5) == (ERROR, "no scans come")
    assert Health(silent_s=5.0, heard_s=1.0).level(6.0)[0] == OK
