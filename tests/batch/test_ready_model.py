"""The options of a model, and what departs from them."""

from typing import Any

import pytest

from pgm_places.batch.ready_model import rules_with
from pgm_places.topology.rules import TopologyOptions


@pytest.mark.parametrize(
    ("stored", "flag", "used"),
    [
        (None, None, "gates"),
        ("labels", None, "labels"),
        ("labels", "gates", "gates"),
        (None, "labels", "labels"),
    ],
)
def test_the_flag_comes_before_what_the_model_was_configured_with(
    stored: str | None, flag: str | None, used: str
) -> None:
    topology: dict[str, Any] = {"min_width_m": 0.3} | (
        {} if stored is None else {"doorways": stored}
    )
    rules = rules_with(TopologyOptions(**topology), flag)
    assert (rules.doorways, rules.min_width_m) == (used, 0.3)
