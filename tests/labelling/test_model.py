"""The options of a model, and what departs from them."""

from typing import Any

import pytest

from pgm_places.errors import ConfigError
from pgm_places.labelling.model import LoadedModel, with_given
from pgm_places.labelling.options import ModelOptions
from pgm_places.persistence.stored import _options_of
from pgm_places.spaces.entered_options import EnteredOptions
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
    rules = with_given(TopologyOptions(**topology), {"doorways": flag})
    assert (rules.doorways, rules.min_width_m) == (used, 0.3)


def test_what_counts_as_entered_is_stored_and_overruled() -> None:
    record = {"config": {"entered": {"disc_radius_m": 0.3}}}
    _, stored = _options_of(record)
    assert stored == EnteredOptions(disc_radius_m=0.3)
    assert _options_of({})[1] == EnteredOptions()
    given = {"disc_radius_m": None, "unentered": True}
    assert with_given(stored, given) == EnteredOptions(0.3, unentered=True)
    with pytest.raises(ConfigError, match=r"unknown key .record.config.entered.radius_m"):
        _options_of({"config": {"entered": {"radius_m": 0.3}}})


@pytest.mark.parametrize(
    ("given", "least"),
    [({}, 0.2), ({"disc_radius_m": 0.3}, 0.3), ({"unentered": True}, 0.0)],
)
def test_places_have_room_for_the_robot_that_enters_them(
    given: dict[str, Any], least: float
) -> None:
    assert LoadedModel.load(ModelOptions(**given)).rules.min_clearance_m == least
