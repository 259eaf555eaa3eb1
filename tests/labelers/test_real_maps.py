"""Maps that robots made: each comes to a model's cells and back, small ones are labelled."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pgm_places.io.maps.map_server import load_map
from pgm_places.labelers.labelled_places import at_model_resolution
from pgm_places.labelling.label import label_map
from pgm_places.maps.coarsening import Coarsening
from pgm_places.trained import trained_labeler
from tests.real_data import real_data_folder

pytestmark = pytest.mark.real_data


def test_every_map_comes_to_the_cells_of_a_model_and_back() -> None:
    folders = sorted(path.parent for path in real_data_folder("robots").glob("*/map.yaml"))
    assert len(folders) >= 36
    labeler: Any = SimpleNamespace(resolution_m_=0.05)
    lost = []
    for folder in folders:
        loaded = load_map(folder / "map.yaml")
        used, _ = at_model_resolution(labeler, loaded.grid)
        if used.resolution_m < loaded.grid.resolution_m:
            holders = Coarsening(used, loaded.grid).holders(np.argwhere(used.free))
            kept = np.zeros(loaded.grid.shape, np.bool_)
            kept[holders[:, 0], holders[:, 1]] = True
        else:
            kept = Coarsening(loaded.grid, used).paint(used.free, fill=False)
        if (kept != loaded.grid.free).any():
            lost.append(folder.name)
    assert lost == []


@pytest.mark.parametrize("name", ["home_ex2", "lab_urjc"])
def test_small_maps_of_robots_are_labelled(name: str) -> None:
    grid = load_map(real_data_folder("robots") / name / "map.yaml").grid
    found = label_map(trained_labeler(), grid)
    left_out = np.zeros(grid.shape, np.bool_) if found.unentered is None else found.unentered.cells
    assert ((found.labels >= 0) == (grid.free & ~left_out)).all()
    assert set(np.unique(found.labels[grid.free])) <= {-1, 0, 1, 2}
