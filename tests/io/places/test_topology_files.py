"""A topological map survives being written and read; what is damaged is said in one line."""

import json
from pathlib import Path

import numpy as np
import pytest

from pgm_places.errors import InputError, LabelError, OutputError
from pgm_places.io.atomic import write_json
from pgm_places.io.maps.regions import load_regions, read_regions
from pgm_places.io.places.topology_files import load_topology, read_own_names, save_topology
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.place_ids import PlaceIds
from tests.refusals import refused
from tests.topology.floors import NAMES, floor_grid, floor_labels, floor_map, gated_floor_map

FRAME = {"yaw_rad": 0.4, "origin_xy_m": (5.0, -3.0)}


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    labels = floor_labels()
    labels[2, 12] = 1
    before = topological_map(floor_grid(labels, **FRAME), labels, NAMES)
    paths = save_topology(tmp_path, before)
    assert {path.name for path in paths} == {"places.json", "regions.png", "regions.geojson"}
    after = load_topology(tmp_path)
    assert (after.region == before.region).all()
    assert after.connections == before.connections
    assert after.corrections == before.corrections
    assert (after.label_names, after.doorway_label, after.next_id) == (NAMES, "doorway", 8)
    assert after.grid.yaw_rad == before.grid.yaw_rad
    for one, other in zip(before.regions, after.regions, strict=True):
        assert (one.id, one.name, one.label) == (other.id, other.name, other.label)
        assert one.anchor_m == other.anchor_m
        for ring, again in zip(one.polygons[0], other.polygons[0], strict=True):
            np.testing.assert_allclose(again, ring, rtol=0, atol=1e-6)
    assert [r.name for r in after.path("room 1", "room 2")][1] == "doorway 5"


def test_gates_are_written_and_read_back(tmp_path: Path) -> None:
    before = gated_floor_map(**FRAME)
    save_topology(tmp_path, before)
    [one] = [region for region in before.regions if region.gate is not None]
    [other] = [region for region in load_topology(tmp_path).regions if region.gate is not None]
    assert (one.name, one.confidence) == (other.name, other.confidence) == ("doorway 3", 0.9)
    assert one.gate is not None
    assert other.gate is not None
    np.testing.assert_allclose(other.gate.corners_m, one.gate.corners_m, rtol=0, atol=2e-6)
    record = json.loads((tmp_path / "places.json").read_text())
    [gate] = [region["gate"] for region in record["regions"] if "gate" in region]
    assert list(gate) == ["centre_m", "heading_rad", "width_m", "depth_m", "corners_m"]
    assert gate["heading_rad"] == pytest.approx(0.4, abs=1e-6)
    features = before.to_geojson()["features"]
    assert [item["properties"]["gate"] for item in features if "gate" in item["properties"]] == [
        gate
    ]


def test_the_outlines_are_ground_truth_for_our_own_reader(tmp_path: Path) -> None:
    labels = floor_labels()
    labels[6:8, 3:5] = -1  # a pillar: a hole in the first room
    grid = floor_grid(labels, **FRAME)
    topology = topological_map(grid, labels, NAMES, tolerance=0.0)
    path = write_json(tmp_path / "regions.geojson", topology.to_geojson())
    assert (load_regions(path, NAMES, grid) == labels).all()


def test_features_carry_what_a_map_viewer_shows(tmp_path: Path) -> None:
    features = floor_map().to_geojson()
    assert features["crs"]["properties"]["name"].endswith("EPSG::3857")
    first = features["features"][0]
    assert first["geometry"]["type"] == "Polygon"
    assert first["properties"]["neighbours"] == [5]
    assert first["properties"]["area_m2"] == pytest.approx(35 * 0.25)
    assert "confidence" not in first["properties"]
    diagonal = np.array([[1, -1], [-1, 1]], np.int16)
    two = topological_map(floor_grid(diagonal), diagonal, NAMES, correct=False)
    path = write_json(tmp_path / "two.geojson", two.to_geojson())
    assert [len(region.polygons) for region in read_regions(path, "id")] == [2]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"format": "other"}, "does not hold a topological map"),
        ({"schema": 2}, "schema 2, but only 1 can be read"),
        ({"regions": [{}]}, "damaged"),
        ({"regions": []}, "hold other regions"),
        ({"map": {"rows": 3}}, "'map.columns' is missing"),
        ({"connections": 5}, "damaged"),
        ({"connections": [{"first": 1}]}, r"'connections\[0\].second' is missing"),
        ({"label_names": ["room", "\x1b[2J"]}, r"must not hold control characters, got '\\x1b"),
        ({"label_names": ["\ud800"]}, "must not hold control characters"),
        ({"label_names": "room"}, "label_names must be a list of names"),
        ({"label_names": []}, r"regions\[0\].label 'room' is not among label_names"),
        ({"doorway_label": None}, "doorway_label must be strings"),
        ({"next_id": 1}, "next_id is 1, but there is a region"),
        ({"next_id": 10**400}, "an integer has 401 digits"),
        ({"corrections": [{"cell_rc": [0]}]}, r"corrections\[0\]"),
        ({"name": "hall\x1b[2J"}, "must not hold control characters"),
        ({"name": 5}, r"regions\[0\].name must be a string, got 5"),
        ({"id": "1"}, r"regions\[0\].id must be"),
        ({"anchor_m": [1.0]}, r"regions\[0\].anchor_m must be"),
        ({"area_m2": "1"}, r"regions\[0\].area_m2 must be"),
        ({"colour": "red"}, r"regions\[0\] has the unknown key 'colour'"),
        ({"width_m": "wide"}, r"places.json is damaged .*; write it again"),
        ({"centre_m": [1.0]}, r"places.json is damaged .*; write it again"),
        ({"depth_m": None}, r"places.json is damaged .*; write it again"),
    ],
)
def test_damage_is_said(changes: dict[str, object], words: str, tmp_path: Path) -> None:
    """In the record, in its first region, or in its gate."""
    save_topology(tmp_path, gated_floor_map())
    path = tmp_path / "places.json"
    record = json.loads(path.read_text())
    gate = next(region["gate"] for region in record["regions"] if "gate" in region)
    places = ("name", "id", "anchor_m", "area_m2", "colour")
    for key, value in changes.items():
        where = gate if key in gate else record["regions"][0] if key in places else record
        where[key] = value
    path.write_text(json.dumps(record))
    refused(InputError, words, load_topology, tmp_path)


def test_missing_and_foreign_files(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected a topological map, as 'pgm-places label'"):
        load_topology(tmp_path)
    save_topology(tmp_path, floor_map())
    (tmp_path / "places.json").write_text("{")
    refused(InputError, "not a JSON file", load_topology, tmp_path)
    save_topology(tmp_path, floor_map())
    (tmp_path / "regions.png").write_bytes(b"hello")
    refused(InputError, r"regions\.png", load_topology, tmp_path)


def test_own_names(tmp_path: Path) -> None:
    assert read_own_names(tmp_path) == {}
    (tmp_path / "place_names.yaml").write_text("3: kitchen\n12: 'lab: east'\n")
    assert read_own_names(tmp_path) == {3: "kitchen", 12: "lab: east"}
    (tmp_path / "place_names.yaml").write_text("kitchen: 3\n")
    refused(LabelError, "an id must be a whole number from 1 to 65535", read_own_names, tmp_path)


def test_too_many_ids_are_refused(tmp_path: Path) -> None:
    labels = floor_labels()
    grid = floor_grid(labels)
    known = PlaceIds()
    known.next_id = 65530
    many = topological_map(grid, labels, NAMES, known=known)
    refused(OutputError, "ids have been assigned", save_topology, tmp_path, many)
