"""Halls that are shown as corridors: what the studio says of them."""

from pathlib import Path

import numpy as np
import pytest

from pgm_places import OccupancyGrid, save_map, trained_labeler
from pgm_places.io.maps.map_server import load_map
from pgm_places.studio.records import cell_record, places_record
from pgm_places.studio.session import MapSession
from tests.foyer import foyer_map
from tests.studio.conftest import wait


def test_a_corridor_that_is_rather_a_hall_is_said_to_be(tmp_path: Path) -> None:
    foyer = foyer_map()
    grid = OccupancyGrid(foyer.grid.cells, foyer.grid.resolution_m)
    source = load_map(save_map(grid, tmp_path / "foyer"))
    session = MapSession(source, tmp_path / "kept", trained_labeler("generated"))
    session.start()
    try:
        wait(session)
        taught = session.taught
        assert taught is not None and taught.labelled.hall is not None
        record = places_record(taught)
        halls = [check["id"] for check in record["checks"] if check["is_likely_hall"]]
        truth = [
            region.id
            for region in taught.topology.regions
            if (foyer.labels[taught.topology.region == region.id] == 3).mean() > 0.5
            and region.label != "doorway"
        ]
        assert truth and set(halls) == set(truth)
        by_id = {region["id"]: region for region in record["regions"]}
        assert all(by_id[number]["hall"] > 0.5 for number in halls)
        row, column = np.argwhere(taught.topology.region == halls[0])[0].tolist()
        cell = cell_record(session, column + 0.5, row + 0.5)
        node = taught.labelled.layout.nodes_at(np.array([[row, column]]))[0]
        assert cell["hall"] == pytest.approx(taught.labelled.hall[node], abs=1e-4)
        assert cell["hall"] <= cell["probabilities"]["corridor"] + 1e-4
    finally:
        session.close()
