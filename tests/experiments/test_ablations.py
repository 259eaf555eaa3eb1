"""Ablations: what a stripe and a drive leave of a map, and that every experiment can be found."""

from pathlib import Path

import numpy as np
import pytest

from experiments.ablations.other_maps import seen_part
from experiments.ablations.settings import stripe
from experiments.own_sections import ABLATIONS, BUILDINGS
from experiments.paper.setting import with_stand_ins
from pgm_places.experiment.config import load_config
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.sensing.simulated_robot import SimulatedRobot
from pgm_places.trajectories.scan import ScanGeometry
from tests.report.comparisons import small_map

CONFIGS = ABLATIONS["features"].configs


def test_a_stripe_keeps_the_columns_next_to_the_cut() -> None:
    item = small_map()
    known = LabelledMap(item.grid, item.truth)
    whole, part = stripe(known, 0.0), stripe(known, 0.5)
    assert whole.labelled_cells.sum() == known.labelled_cells.sum()
    columns = np.flatnonzero(part.labelled_cells.any(axis=0))
    assert columns[-1] == 7
    assert 1 < columns[0] < 7


def test_what_a_drive_saw_has_the_labels_of_the_whole_map() -> None:
    item = small_map()
    labels = np.where(item.truth >= 0, item.truth, 0).astype(np.int16)
    whole = LabelledMap(item.grid, np.where(item.grid.free, labels, -1).astype(np.int16))
    robot = SimulatedRobot(ScanGeometry.full_circle(360, range_max_m=10.0), radius_m=0.2)
    drive = robot.drive(item.grid, [[1.2, 1.2], [3.0, 1.2]])
    seen = seen_part(whole, drive)
    assert seen.labelled_cells.sum() > 5
    rows, columns = np.nonzero(seen.labelled_cells)
    at = whole.grid.cells_at_m(seen.grid.cell_centres_m(np.column_stack([rows, columns])))
    assert (seen.labels[rows, columns] == whole.labels[at[:, 0], at[:, 1]]).all()


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.toml")), ids=lambda path: path.stem)
def test_every_configuration_is_good_and_has_stand_ins(path: Path) -> None:
    replaced = with_stand_ins(load_config(path))
    assert all(item.generated is not None for item in (*replaced.train, *replaced.test))


@pytest.mark.parametrize("key", ABLATIONS)
def test_every_ablation_has_a_function(key: str) -> None:
    assert callable(ABLATIONS[key].run)


def test_buildings_left_out_have_a_function() -> None:
    assert callable(BUILDINGS.run)
