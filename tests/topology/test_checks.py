"""Places to check first: the order, the table, and what is said where nothing is known."""

import csv
import io
from pathlib import Path

import numpy as np
import pytest

from pgm_places import LabelGraph, OccupancyGrid, load_topology, save_topology, topological_map
from pgm_places.io.places.topology_files import check_table
from pgm_places.labelling.files import write_topology
from pgm_places.pictures.topology_pictures import marked_checks, topology_drawing
from pgm_places.report.places_summary import doubt_summary
from pgm_places.spaces.doorways import Doorways
from pgm_places.spaces.gates import gate_candidates
from pgm_places.spaces.places import places_between
from pgm_places.spaces.segmentation import Segmentation
from pgm_places.topology.checks import doubtful_share, places_to_check
from pgm_places.topology.rules import TopologyOptions
from pgm_places.topology.topological_map import TopologicalMap
from tests.topology.floors import gated_floor_map

NAMES = ("corridor", "room", "hall")
CELLS = np.array([0] * 10 + [1] * 6 + [2] * 4)
SURE = np.array([[0.9, 0.02, 0.08], [0.3, 0.5, 0.2], [0.25, 0.35, 0.4]])


@pytest.fixture
def topology() -> TopologicalMap:
    """A corridor of 10 m2, 0.9 sure; a room of 6 m2, 0.5 sure; a hall of 4 m2, 0.4 sure."""
    grid = OccupancyGrid(np.zeros((1, 20), np.int8), resolution_m=1.0)
    layout = LabelGraph.from_grid(grid).layout
    rules = TopologyOptions(min_area_m2=0.0)
    return topological_map(
        grid,
        CELLS[None],
        NAMES,
        rules=rules,
        beliefs=SURE[CELLS],
        layout=layout,  # type: ignore[arg-type]
    )


def test_places_come_by_doubt_times_area(topology: TopologicalMap) -> None:
    found = places_to_check(topology)
    assert [check.place.name for check in found] == ["room 2", "hall 3", "corridor 1"]
    assert [check.doubtful_m2 for check in found] == pytest.approx([3.0, 2.4, 1.0])
    assert [check.second_label for check in found] == ["corridor", "room", "hall"]
    assert [check.second_probability for check in found] == pytest.approx([0.3, 0.35, 0.08])
    assert doubtful_share(topology) == pytest.approx(6.4 / 20)


def test_the_table_holds_a_row_for_each(topology: TopologicalMap) -> None:
    rows = list(csv.DictReader(io.StringIO(check_table(topology))))
    assert [row["name"] for row in rows] == ["room 2", "hall 3", "corridor 1"]
    assert rows[0] == {
        "id": str(topology.place("room 2").id),
        "name": "room 2",
        "label": "room",
        "second_label": "corridor",
        "probability": "0.5000",
        "second_probability": "0.3000",
        "area_m2": "6.000",
        "doubt": "0.5000",
        "doubtful_m2": "3.000",
        "x_m": rows[0]["x_m"],
        "y_m": "0.500",
        "rooms": "",
        "to_split": "",
        "finer_label": "room",
        "hall": "",
    }
    region = topology.region_at(float(rows[0]["x_m"]), float(rows[0]["y_m"]))
    assert region is topology.place("room 2")


def test_what_is_read_back_has_the_same_checks(topology: TopologicalMap, tmp_path: Path) -> None:
    save_topology(tmp_path, topology)
    assert check_table(load_topology(tmp_path)) == check_table(topology)


def test_a_gate_is_in_doubt_by_its_own_probability() -> None:
    cells = np.zeros((20, 42), np.int8)
    cells[:, 20:22], cells[8:12, 20:22] = 100, 0  # two rooms, a wall, a door of 0.8 m
    grid = OccupancyGrid(cells, resolution_m=0.2)
    labels = np.where(grid.free, 0, -1)
    labels[8:12, 20:22] = 1
    layout = LabelGraph.from_grid(grid).layout
    assert layout is not None
    beliefs = np.tile([0.75, 0.25], (int(grid.free.sum()), 1))
    probability = np.array([0.6])
    places = places_between(gate_candidates(Segmentation.of(grid)), probability)
    found = topological_map(
        grid,
        labels,
        ("room", "doorway"),
        beliefs=beliefs,
        layout=layout,  # type: ignore[arg-type]
        doorways=Doorways.of(places, probability),
    )
    checks = {check.place.name: check for check in places_to_check(found)}
    assert checks["doorway 3"].doubt == pytest.approx(0.4)
    assert checks["doorway 3"].second_label == "room"
    assert checks["doorway 3"].second_probability == pytest.approx(0.4)  # not its cells' 0.75
    assert checks["room 1"].doubt == pytest.approx(0.25)


def test_without_probabilities_nothing_is_in_doubt(tmp_path: Path) -> None:
    grid = OccupancyGrid(np.zeros((1, 20), np.int8), resolution_m=1.0)
    found = topological_map(grid, CELLS[None], NAMES)
    assert places_to_check(found) == []
    assert doubtful_share(found) is None
    assert doubt_summary(found) is None
    assert "check.csv" not in {path.name for path in write_topology(tmp_path, grid, found)}


def test_gates_alone_say_nothing_of_the_area() -> None:
    found = gated_floor_map()
    assert [check.place.label for check in places_to_check(found)] == ["doorway"]
    assert doubtful_share(found) is None


def test_the_summary_and_the_picture_name_the_first(topology: TopologicalMap) -> None:
    assert doubt_summary(topology) == (
        "Uncertain: 32.0 % of the area. Check first: room 2 (3.0 m² may be corridor); hall 3 "
        "(2.4 m² may be room); corridor 1 (1.0 m² may be hall)"
    )
    assert len(marked_checks(topology)) == 3
    unknown = topological_map(topology.grid, CELLS[None], NAMES)
    assert (
        topology_drawing(topology.grid, topology).png()
        != topology_drawing(topology.grid, unknown).png()
    )
