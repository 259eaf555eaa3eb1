"""Drives of the tracking model: what is held out, what is drawn, and how tables count."""

from pathlib import Path

import numpy as np
import pytest

from experiments.array_cache import ArrayCache
from experiments.known_maps import GENERATED, NAMES, KnownMap
from experiments.tracking_model.drives import Laser, Observed, simulated_drive
from experiments.tracking_model.learning import Table, folds, learned
from experiments.tracking_model.real_drives import in_lobby
from experiments.tracking_model.unseen import ALONE, WAYS, Answer, floors_table, lasers_table
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.simulation import generate_building
from pgm_places.unary.local_features import N_LOCAL_SPACE_FEATURES

LASER = Laser(180.0, 60, 10.0)


def drive(building: str, labels: list[int], *, laser: Laser = LASER, group: str = "a") -> Observed:
    n = len(labels)
    return Observed(
        "drive",
        building,
        group,
        laser,
        False,
        np.column_stack([0.3 * np.arange(n), np.zeros((n, 2))]),
        np.array(labels),
        np.zeros((n, 360), np.float32),
        np.zeros((n, N_LOCAL_SPACE_FEATURES), np.float32),
    )


def answer(item: Observed, labels: list[int]) -> Answer:
    return Answer(item, {way: np.array(labels) for way in (ALONE, *WAYS)})


def test_lasers_are_of_every_kind() -> None:
    rng = np.random.default_rng(0)
    drawn = [Laser.drawn(rng) for _ in range(300)]
    assert {item.view_degrees for item in drawn} == {90, 120, 180, 240, 270, 360}
    reaches = [item.reach_m for item in drawn]
    assert 4 <= min(reaches) < 5 and 70 < max(reaches) <= 80
    assert all(item.geometry.n_beams == item.n_beams >= 30 for item in drawn)


def test_drives_of_a_building_are_held_out_together() -> None:
    made = [drive(name, [0]) for name in "xyzwvx"]
    found = folds(made, 2)
    assert found[0] == found[-1] and set(found.tolist()) == {0, 1}


def test_tables_count_the_steps_of_each_kind_and_laser() -> None:
    near = Laser(90.0, 90, 5.0)
    some = [
        answer(drive("x", [0, 1, 2, -1]), [0, 1, 2, 0]),
        answer(drive("y", [0, 1], group="b", laser=near), [1, 1]),
    ]
    rows = floors_table(some).splitlines()[2:]
    assert rows[0].startswith("| a | 3 | 100.0 / 100.0 (100) |")
    assert rows[1].startswith("| b | 2 | 50.0 / 50.0 (0) |")
    table = lasers_table(some).splitlines()
    assert table[2].strip("| ").split(" | ")[:3] == ["90°", "50.0 / 50.0 (1)", "-"]
    assert table[3].strip("| ").split(" | ")[:3] == ["120° to 180°", "-", "100.0 / 100.0 (1)"]


def test_the_lobby_is_corridor_in_one_part_of_two_maps() -> None:
    item = drive("Saarbrücken", [0, 1])
    assert not in_lobby(item).any()


@pytest.mark.parametrize("kept", [None, "folder"])
def test_what_drives_show_can_be_learned_from(kept: str | None, tmp_path: Path) -> None:
    store = ArrayCache(None if kept is None else tmp_path)
    drives = []
    for seed in (1, 3):
        building = generate_building(seed, size="small", resolution_m=0.1)
        item = LabelledMap(building.grid, building.labels, None, f"{seed}", f"{seed}")
        known = KnownMap(item, "office", GENERATED)
        found = simulated_drive(known, seed, store, LASER, length_m=15.0)
        again = simulated_drive(known, seed, store, LASER, length_m=15.0)
        np.testing.assert_array_equal(found.spaces, again.spaces)
        assert (found.labels >= 0).all()
        assert (np.hypot(*np.diff(found.poses[:, :2], axis=0).T) > 0.2).all()
        drives.append(found)
    model = learned(Table.of(drives)).labeler()
    assert model.label_names_ == NAMES and model.scan_model_.sees_spaces
