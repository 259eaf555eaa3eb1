"""Maps that robots made: each comes to a model's cells and back, small ones are labelled."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pgm_places.io.maps.map_server import load_map
from pgm_places.labelers.labelled_places import at_model_resolution
from pgm_places.maps.coarsening import Coarsening
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
