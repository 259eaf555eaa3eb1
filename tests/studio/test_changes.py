"""What a relabelling has changed, and what a session says and does about it."""

import json
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places.errors import InputError
from pgm_places.io.maps.map_server import load_map
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.studio.exports import write_export
from pgm_places.studio.layers import GivenLabels
from pgm_places.studio.records import _second_label, places_record, state_record
from pgm_places.studio.relabelling import LabelChanges, share_that_agrees
from pgm_places.studio.session import MapSession
from pgm_places.topology.checks import PlaceCheck
from pgm_places.topology.from_labels import topological_map
from tests.quick_labeler import places
from tests.studio.conftest import rectangle, wait


@given(st.integers(0, 2**31))
def test_what_changed_is_counted_outside_the_paint_alone(seed: int) -> None:
    rng = np.random.default_rng(seed)
    before, after, paint = rng.integers(-1, 3, (3, 7, 9)).astype(np.int16)
    found = LabelChanges.between(before, after, paint, 0.5)
    expected: dict[int, float] = {}
    for r, c in np.ndindex(before.shape):
        changes = before[r, c] != after[r, c] and min(before[r, c], after[r, c]) >= 0
        assert found.cells[r, c] == (changes and paint[r, c] < 0)
        if found.cells[r, c]:
            expected[int(after[r, c])] = expected.get(int(after[r, c]), 0.0) + 0.25
    assert found.became_m2 == pytest.approx(expected)


def test_the_share_that_agrees_is_of_cells_with_a_truth() -> None:
    truth = np.array([[-1, 0, 1, 1]], np.int16)
    assert share_that_agrees(np.array([[0, 0, 0, 1]], np.int16), truth) == pytest.approx(2 / 3)
    assert share_that_agrees(np.full((1, 4), -1, np.int16), truth) is None


@pytest.fixture
def labelled(map_yaml: Path) -> Iterator[MapSession]:
    """A session with a model, and a truth that says room everywhere."""
    loaded, names = load_map(map_yaml), tuple(places().label_names_)
    truth = np.where(loaded.grid.free, names.index("room"), -1).astype(np.int16)
    given = [GivenLabels("truth.png", truth, names)]
    session = MapSession(loaded, map_yaml.parent / "kept", places(), model="quick", given=given)
    session.start()
    wait(session)
    yield session
    session.close()


def paint(session: MapSession, label: str, *corners: tuple[float, float]) -> None:
    session.edit(rectangle(session.painting.classes.names.index(label), *corners))


def test_a_confirmed_place_keeps_the_doorways_at_its_edge(labelled: MapSession) -> None:
    relabelling = labelled.relabelling
    assert relabelling is not None
    topology, names = relabelling.taught.topology, labelled.painting.classes.names
    place = max(topology.regions, key=lambda region: region.area_m2)
    inside = topology.region == place.id
    at_the_edge = np.zeros_like(inside)
    at_the_edge[tuple(topology.cells(place.id)[:7].T)] = True
    doorway = names.index("doorway")
    labels = np.where(at_the_edge, np.int16(doorway), relabelling.labels)
    labelled.relabelling = replace(relabelling, labels=labels)
    column, row = (float(value) + 0.5 for value in topology.cells(place.id)[-1][::-1])
    request = {"kind": "fill", "point": [column, row]}
    labelled.edit({**request, "label": names.index(place.label)})
    painted = labelled.painting.labels >= 0
    np.testing.assert_array_equal(painted, inside & (labels != doorway))
    assert painted.sum() > inside.sum() / 2
    wait(labelled, labelled.painting.revision)
    assert labelled.taught is not None
    at = labelled.taught.topology.region_at(*place.anchor_m)
    assert at is not None
    listed = [check.place.id for check in labelled.taught.open_checks]
    assert at.id not in listed
    assert at.id not in [check["id"] for check in places_record(labelled.taught)["checks"]]
    assert set(listed) < {region.id for region in labelled.taught.topology.regions}
    labelled.edit({**request, "label": doorway})
    np.testing.assert_array_equal(labelled.painting.labels == doorway, inside)


def test_teaching_is_off_until_it_is_asked_for(labelled: MapSession) -> None:
    assert labelled.taught is not None and not labelled.learns
    paint(labelled, "corridor", (6, 6), (24, 12))
    paint(labelled, "room", (27, 6), (45, 12))
    wait(labelled, 2)
    assert labelled.taught.labeler is labelled.labeler
    with pytest.raises(InputError, match="press 'Teach from this' first"):
        write_export(labelled, "model")
    labelled.edit({"kind": "learn", "on": True})
    deadline = time.monotonic() + 300
    while labelled.taught.labeler is labelled.labeler:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    assert write_export(labelled, "model")


def test_a_class_that_the_model_does_not_know_is_learned_all_the_same(labelled: MapSession) -> None:
    labelled.edit({"kind": "class", "index": 3, "name": "lab", "colour": "#112233"})
    paint(labelled, "lab", (6, 6), (24, 24))
    paint(labelled, "room", (27, 6), (45, 24))
    wait(labelled, 3)
    assert labelled.taught is not None
    assert "lab" in labelled.taught.label_names


def test_what_changes_is_said_shown_and_compared_with_the_truth(labelled: MapSession) -> None:
    assert labelled.changes is None
    record = state_record(labelled)["relabelling"]
    first = record["agrees"]
    assert record["changed"] == "" and 0 <= first <= 1
    paint(labelled, "corridor", (5, 5), (25, 24))
    wait(labelled, 1)
    assert labelled.changes is not None
    changed, record = labelled.changes.cells, state_record(labelled)["relabelling"]
    assert not changed[labelled.painting.labels >= 0].any()
    assert bool(record["changed"]) == (changed.sum() * 0.04 >= 0.5)
    assert labelled.relabelling is not None
    right = labelled.relabelling.labels[labelled.grid.free] == 1
    assert record["agrees"] == pytest.approx(np.mean(right))
    tile = labelled.layers.tile(
        "changes", 0, 0, 0, classes=labelled.painting.classes, theme="light"
    )
    assert tile.startswith(b"\x89PNG")


def test_a_place_that_looks_like_two_is_split_by_one_press(labelled: MapSession) -> None:
    """Both rooms and the door between them as one room; a corner keeps the other class alive."""
    paint(labelled, "room", (5, 5), (46, 25))
    wait(labelled, 1)
    assert labelled.taught is not None
    [region] = [item.id for item in labelled.taught.topology.regions if item.area_m2 > 20]
    assert labelled.n_parts(region) == 2 and labelled.n_parts(10**6) == 1
    labelled.edit({"kind": "split", "region": region})
    doorway = labelled.painting.classes.names.index("doorway")
    rows, columns = np.nonzero(labelled.painting.labels == doorway)
    assert set(rows.tolist()) == {13, 14, 15, 16}
    assert np.abs(columns - 25).max() <= 1
    wait(labelled, 2)
    assert len([r for r in labelled.taught.topology.regions if r.label == "room"]) == 2
    with pytest.raises(InputError, match="this place looks like one"):
        rooms = [r.id for r in labelled.taught.topology.regions if r.label == "room"]
        labelled.edit({"kind": "split", "region": rooms[0]})


def test_doorways_without_area_are_not_to_be_checked(labelled: MapSession) -> None:
    assert labelled.taught is not None
    record = places_record(labelled.taught)
    areas = {region.id: region.area_m2 for region in labelled.taught.topology.regions}
    assert record["checks"] and all(areas[check["id"]] >= 0.05 for check in record["checks"])
    assert all(check["doubtful_m2"] >= 0.05 for check in record["checks"])
    rooms = [check for check in record["checks"] if check["label"] != "doorway"]
    assert rooms and all(check["second_label"] != "doorway" for check in rooms)


def test_labels_follow_the_numbers_of_classes_and_those_of_the_model_stay(
    labelled: MapSession,
) -> None:
    with pytest.raises(InputError, match="'corridor' belongs to the model or to the labels"):
        labelled.edit({"kind": "drop", "index": 0})
    for number, name in enumerate(("lab", "shop"), start=3):
        labelled.edit({"kind": "class", "index": number, "name": name, "colour": "#112233"})
    paint(labelled, "shop", (6, 6), (24, 24))
    paint(labelled, "room", (27, 6), (45, 24))
    wait(labelled, 4)
    assert labelled.relabelling is not None and labelled.relabelling.labels[10, 10] == 4
    labelled.learner.end()
    labelled.edit({"kind": "drop", "index": 3})
    assert labelled.relabelling.labels[10, 10] == 3 and labelled.relabelling.labels[10, 30] == 1
    assert labelled.relabelling.class_of.tolist()[-1] == 3
    colours = [item.colour for item in labelled.painting.classes.items]
    assert len(colours) == 4
    labelled.edit({"kind": "undo"})
    assert labelled.relabelling.labels[10, 10] == 4


def test_what_is_no_doorway_may_be_the_likeliest_of_the_other_classes() -> None:
    grid = OccupancyGrid(np.zeros((4, 4), np.int8), 1.0)
    names = ["corridor", "room", "hall", "doorway"]
    topology = topological_map(grid, np.ones(grid.shape, np.int16), names)
    place = replace(topology.regions[0], probabilities=(0.2, 0.4, 0.1, 0.3))
    check = PlaceCheck(place, 0.4, "doorway", 0.3)
    assert _second_label(check, topology) == "corridor"
    certain = replace(place, probabilities=(0.0, 0.7, 0.0, 0.3))
    assert _second_label(replace(check, place=certain), topology) is None


def test_a_place_is_cut_without_a_doorway_and_merging_takes_the_cut_back(
    labelled: MapSession,
) -> None:
    def rooms() -> list[int]:
        assert labelled.taught is not None
        regions = labelled.taught.topology.regions
        return [region.id for region in regions if region.label == "room" and region.area_m2 > 4]

    paint(labelled, "room", (5, 5), (25, 25))
    paint(labelled, "room", (26, 5), (46, 25))
    paint(labelled, "doorway", (25, 13), (26, 17))
    wait(labelled, 3)
    before = rooms()
    assert len(before) == 2
    with pytest.raises(InputError, match="this cut divides nothing"):
        labelled.edit({"kind": "cut", "start": [25.5, 13.5], "end": [25.5, 16.5]})
    labelled.edit({"kind": "cut", "start": [15.0, 6.0], "end": [15.0, 24.0]})
    wait(labelled, 4)
    cut = rooms()
    assert len(cut) == 3 and set(before) < set(cut)
    assert labelled.taught is not None
    topology = labelled.taught.topology
    parts = [topology.region[10, 10], topology.region[10, 20]]
    assert len(set(parts)) == 2
    assert int(parts[0]) in {item.id for item in topology.neighbours(int(parts[1]))}
    write_export(labelled, "places")
    places = json.loads((labelled.folder / "places.json").read_text())
    assert {item["id"] for item in places["regions"]} == {item.id for item in topology.regions}
    labelled.edit({"kind": "merge", "first": int(parts[0]), "second": int(parts[1])})
    wait(labelled, 5)
    assert rooms() == before and labelled.painting.cuts == ()
    labelled.edit({"kind": "undo"})
    wait(labelled, 6)
    assert rooms() == cut


def test_parts_of_a_cut_are_merged_though_one_was_painted_over(labelled: MapSession) -> None:
    paint(labelled, "room", (5, 5), (25, 25))
    labelled.edit({"kind": "cut", "start": [15.0, 6.0], "end": [15.0, 24.0]})
    paint(labelled, "corridor", (15, 5), (25, 25))
    wait(labelled, 3)
    region = labelled.answer.topology.region
    parts = int(region[10, 10]), int(region[10, 20])
    labelled.edit({"kind": "merge", "first": parts[0], "second": parts[1]})
    wait(labelled, 4)
    region = labelled.answer.topology.region
    assert parts[0] != parts[1] and region[10, 10] == region[10, 20] > 0
    assert labelled.painting.cuts == ()
