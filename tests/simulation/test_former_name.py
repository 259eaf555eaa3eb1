"""The former name of the folder, for one release."""

import importlib

import pytest

from pgm_places import simulation


def test_the_former_name_warns_and_works() -> None:
    with pytest.warns(DeprecationWarning, match=r"pgm_places\.simulation now"):
        datasets = importlib.import_module("pgm_places.datasets")
    assert datasets.generate_building is simulation.generate_building
