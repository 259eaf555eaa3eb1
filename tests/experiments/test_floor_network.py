"""The training floors of the networks: folds of whole buildings."""

import pytest

from experiments.floor_network.floors import KINDS_TOGETHER, N_FOLDS, all_floors, fold_of
from experiments.known_maps import GENERATED_STYLES
from tests.real_data import real_data_folder


def test_every_generated_kind_is_in_one_fold() -> None:
    kinds = [kind for together in KINDS_TOGETHER for kind in together]
    assert len(kinds) == len(set(kinds))
    assert set(GENERATED_STYLES) <= set(kinds)
    assert len(KINDS_TOGETHER) == N_FOLDS


@pytest.mark.real_data
def test_a_simulated_floor_is_in_the_fold_of_its_plan() -> None:
    floors = list(all_floors(real_data_folder("robots").parent))
    fold = fold_of(floors)
    by_name = {floor.name: fold[floor.building] for floor in floors}
    assert len(by_name) == len(floors)
    for floor in floors:
        if floor.source == "simulated":
            plan = floor.name.removeprefix("simulated_").rpartition("_")[0]
            assert by_name[floor.name] == by_name[plan]
    assert {fold for name, fold in by_name.items() if name.startswith("robot_")} == set(range(4))
