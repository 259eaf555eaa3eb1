"""What a restart of the studio keeps: labels, teaching, ids and names; exports up to date."""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pgm_places.cli.places import rename
from pgm_places.errors import InputError, OutputError
from pgm_places.io.maps.map_server import load_map
from pgm_places.io.places.export_record import recorded_exports
from pgm_places.io.places.topology_files import load_named_topology, save_topology
from pgm_places.labelling.files import write_labels
from pgm_places.labelling.places import places_of
from pgm_places.studio.desk import Desk
from pgm_places.studio.export_folders import ExportFolders
from pgm_places.studio.exports import EXPORTS, edit_with_exports, exports_record, write_export
from pgm_places.studio.records import state_record
from pgm_places.topology.place_edits import renamed
from pgm_places.topology.place_ids import PlaceIds
from tests.quick_labeler import places

Open = Callable[[], Desk]


@pytest.fixture
def studio(map_yaml: Path) -> Iterator[Open]:
    """Opens the map with a model and labels it; the desk before is closed."""
    made: list[Desk] = []

    def opened() -> Desk:
        if made:
            made[-1].close()
        made.append(Desk(load_map(map_yaml), map_yaml.parent / "kept", places(), model="quick"))
        made[-1].start()
        wait(made[-1])
        return made[-1]

    yield opened
    made[-1].close()


def wait(desk: Desk) -> None:
    """Wait until the newest labels follow the painting."""
    deadline = time.monotonic() + 300
    while desk.lesson is None or desk.learner.state.working or desk.learner._waiting:
        assert not desk.learner.state.problem and time.monotonic() < deadline
        time.sleep(0.02)


def paint(desk: Desk, label: str, *corners: tuple[float, float], tool: str = "rectangle") -> None:
    stroke = {"tool": tool, "points": [list(corner) for corner in corners], "radius": 1}
    number = desk.painting.classes.names.index(label)
    desk.edit({"kind": "stroke", "label": number, "stroke": stroke})
    wait(desk)


def numbered(desk: Desk) -> list[tuple[int, str, tuple[float, float]]]:
    return [(item.id, item.name, item.anchor_m) for item in desk.answer.topology.regions]


def taught(desk: Desk) -> None:
    """Teach, part a room by a doorway and join it again, and name a place."""
    paint(desk, "room", (6, 6), (24, 24))
    paint(desk, "corridor", (27, 6), (45, 24))
    paint(desk, "doorway", (15, 5.5), (15, 24.5), tool="doorway")
    desk.edit({"kind": "undo"})
    desk.edit({"kind": "learn", "on": True})
    wait(desk)
    paint(desk, "doorway", (36, 5.5), (36, 24.5), tool="doorway")
    desk.edit({"kind": "rename", "point_m": [2.8, -0.4], "name": "kitchen"})


def test_labels_teaching_and_ids_are_those_from_before(studio: Open) -> None:
    desk = studio()
    taught(desk)
    before, names = desk.answer, numbered(desk)
    assert before.labeler is not desk.labeler and "kitchen" in [name for _, name, _ in names]
    assert [number for number, _, _ in names] != list(range(1, len(names) + 1))
    desk = studio()
    assert desk.learns and desk.answer.labeler is not desk.labeler
    np.testing.assert_array_equal(desk.answer.labels, before.labels)
    beliefs = (desk.answer.labelled.labeling.beliefs, before.labelled.labeling.beliefs)
    assert beliefs[0] is not None and beliefs[1] is not None
    assert beliefs[0].tobytes() == beliefs[1].tobytes()
    np.testing.assert_array_equal(desk.answer.topology.region, before.topology.region)
    assert numbered(desk) == names


def test_teaching_can_be_undone_and_belongs_to_versions(studio: Open) -> None:
    desk = studio()
    paint(desk, "room", (6, 6), (24, 24))
    desk.edit({"kind": "version", "name": "not taught"})
    revision = desk.painting.versions[0].revision
    desk.edit({"kind": "learn", "on": True})
    assert desk.learns
    desk.edit({"kind": "undo"})
    assert not desk.learns
    desk.edit({"kind": "redo"})
    assert desk.learns
    desk.edit({"kind": "restore", "revision": revision})
    assert not desk.learns
    desk.edit({"kind": "undo"})
    wait(desk)
    assert desk.learns and desk.answer.labeler is not desk.labeler


def edit_origin(map_yaml: Path) -> None:
    text = map_yaml.read_text()
    line = next(line for line in text.splitlines() if line.startswith("origin:"))
    map_yaml.write_text(text.replace(line, "origin: [101.0, 48.0, 0.0]"))


def test_an_edited_origin_is_said_and_keeps_paint_names_and_ids(
    studio: Open, map_yaml: Path
) -> None:
    desk = studio()
    taught(desk)
    labels, before = desk.answer.labels, numbered(desk)
    edit_origin(map_yaml)
    desk = studio()
    np.testing.assert_array_equal(desk.answer.labels, labels)
    after = numbered(desk)
    assert [(number, name) for number, name, _ in after] == [(n, name) for n, name, _ in before]
    for (*_, one), (*_, other) in zip(before, after, strict=True):
        assert np.subtract(other, one).tolist() == pytest.approx([100.0, 50.0])
    notices = " ".join(state_record(desk)["notices"])
    assert "The origin of the map was (1, -2) m, 0 rad" in notices
    assert "is (101, 48) m, 0 rad now; they keep their ids." in notices
    assert not studio().ids_notice


def older(desk: Desk) -> set[str]:
    items = exports_record(desk, ExportFolders.started_here())["items"]
    return {item["name"] for item in items if item["older"]}


def test_an_export_is_up_to_date_while_it_would_be_written_the_same(studio: Open) -> None:
    desk = studio()
    paint(desk, "room", (6, 6), (24, 24))
    paint(desk, "corridor", (27, 6), (45, 24))
    desk.edit({"kind": "learn", "on": True})
    wait(desk)
    for what in ("labels", "corrections", "places", "nav2", "model", "training"):
        write_export(desk, what)
    assert older(desk) == set()
    desk.edit({"kind": "version", "name": "v"})  # the journal is newer, what it says is not
    assert older(desk) == set()
    desk.edit({"kind": "rename", "point_m": [2.8, -0.4], "name": "kitchen"})
    assert older(desk) == {"places", "nav2"}
    desk.edit({"kind": "undo"})
    assert older(desk) == set()
    desk.edit({"kind": "learn", "on": False})
    assert older(desk) == {"labels", "places", "nav2", "model"}
    desk.edit({"kind": "undo"})
    paint(desk, "corridor", (27, 6), (30, 9))  # as it is already
    assert older(desk) == set()
    paint(desk, "room", (27, 6), (30, 9))
    assert older(desk) == {"labels", "corrections", "places", "nav2", "model", "training"}
    desk.edit({"kind": "undo"})
    desk = studio()
    assert older(desk) == set()
    path = desk.folder / "labels.yaml"
    path.write_text(path.read_text() + "# edited\n")
    assert older(desk) == {"labels"}


def test_an_export_while_the_labels_are_those_of_earlier_paint_is_out_of_date(studio: Open) -> None:
    desk = studio()
    paint(desk, "room", (6, 6), (24, 24))
    desk.learner.ask = lambda question: None  # type: ignore[method-assign]  # it is busy
    stroke = {"tool": "rectangle", "points": [[27, 6], [45, 24]], "radius": 1}
    desk.edit({"kind": "stroke", "label": 0, "stroke": stroke})
    write_export(desk, "labels")
    write_export(desk, "corrections")
    assert older(desk) == {"labels"}


def test_a_folder_with_places_keeps_its_ids_and_names(studio: Open, tmp_path: Path) -> None:
    desk, folder = studio(), tmp_path / "labelled"
    folder.mkdir()
    ids = PlaceIds()
    ids.next_id = 40
    earlier = places_of(desk.answer.labelled.cells, desk.rules, ids=ids)
    save_topology(folder, renamed(earlier, {40: "lab"}))
    (folder / "place_names.yaml").write_text("41: store\n")
    there = ExportFolders(tmp_path)
    for _ in range(2):
        write_export(desk, "places", there, chosen="labelled")
        found = load_named_topology(folder)
        np.testing.assert_array_equal(found.region, earlier.region)
        assert (found.place(40).name, found.place(41).name) == ("lab", "store")
    assert (folder / "place_names.yaml").read_text() == '41: "store"\n'


def test_a_name_that_was_taken_back_is_not_in_the_next_export(studio: Open) -> None:
    desk = studio()
    desk.edit({"kind": "rename", "point_m": [2.8, -0.4], "name": "kitchen"})
    write_export(desk, "places")
    assert "kitchen" in (desk.folder / "place_names.yaml").read_text()
    desk.edit({"kind": "undo"})
    write_export(desk, "places")
    assert not (desk.folder / "place_names.yaml").exists()
    assert "kitchen" not in [item.name for item in load_named_topology(desk.folder).regions]


@pytest.mark.parametrize("at", [(15.0, 8.0), (10.0, 15.0)])
def test_filling_never_removes_a_doorway_that_was_drawn(
    studio: Open, at: tuple[float, float]
) -> None:
    desk = studio()
    paint(desk, "doorway", (15, 5.5), (15, 24.5), tool="doorway")
    names = desk.painting.classes.names
    drawn = desk.painting.labels == names.index("doorway")
    assert drawn.any()
    fill: dict[str, Any] = {"kind": "fill", "label": names.index("room"), "point": list(at)}
    try:
        desk.edit(fill)
    except InputError as error:
        assert str(error) == "a doorway was drawn there; erase it to remove it"
        assert at[0] == 15.0
    assert (desk.painting.labels[drawn] == names.index("doorway")).all()
    if at[0] == 15.0:
        desk.edit({**fill, "label": -1})
        assert not (desk.painting.labels[drawn] == names.index("doorway")).any()


def test_a_new_name_is_in_all_exports_at_once_or_in_none(studio: Open) -> None:
    desk = studio()
    for what in ("places", "nav2"):
        write_export(desk, what)
    request = {"kind": "rename", "point_m": [2.8, -0.4], "name": "kitchen"}
    edit_with_exports(desk, request)
    assert older(desk) == set()
    files = ("places.json", "regions.geojson", "place_names.yaml", "nav2_route.geojson")
    assert all("kitchen" in (desk.folder / name).read_text() for name in files)
    (desk.folder / "zones.png").unlink()
    (desk.folder / "zones.png").mkdir()  # so that it is out of date, and not written again
    edit_with_exports(desk, {**request, "name": "lab"})
    assert "lab" in (desk.folder / "places.json").read_text()
    assert "kitchen" in (desk.folder / "nav2_route.geojson").read_text()
    assert older(desk) == {"nav2"}


def test_a_new_name_that_one_export_cannot_write_is_in_none(
    studio: Open, monkeypatch: pytest.MonkeyPatch
) -> None:
    desk = studio()
    for what in ("places", "nav2"):
        write_export(desk, what)
    files = {path: path.read_bytes() for path in desk.folder.glob("*.*json")}

    def fails(*_: object) -> list[Path]:
        raise OutputError("no space left")

    monkeypatch.setitem(EXPORTS, "nav2", replace(EXPORTS["nav2"], write=fails))
    with pytest.raises(OutputError, match="no space left"):
        edit_with_exports(desk, {"kind": "rename", "point_m": [2.8, -0.4], "name": "kitchen"})
    changed = {path.name for path, text in files.items() if path.read_bytes() != text}
    assert changed <= {"exports.json"}
    assert older(desk) == {"places", "nav2"}


@pytest.mark.parametrize("what", ["places", "training", "labels"])
def test_an_export_that_fails_changes_no_file(
    studio: Open, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    desk = studio()
    paint(desk, "room", (6, 6), (24, 24))
    desk.edit({"kind": "rename", "point_m": [2.8, -0.4], "name": "kitchen"})
    write_export(desk, what)
    if what == "places":
        desk.edit({"kind": "rename", "point_m": [2.8, -0.4], "name": ""})
    paint(desk, "corridor", (27, 6), (45, 24))

    def files() -> dict[Path, bytes]:
        found = (path for path in desk.folder.rglob("*") if path.is_file())
        return {path: path.read_bytes() for path in found}

    before, write = files(), EXPORTS[what].write

    def fails(*arguments: Any) -> list[Path]:
        write(*arguments)
        raise OutputError("no space left")

    monkeypatch.setitem(EXPORTS, what, replace(EXPORTS[what], write=fails))
    with pytest.raises(OutputError, match="no space left"):
        write_export(desk, what)
    assert files() == before


def test_a_rename_by_the_command_line_makes_the_exports_of_the_studio_again(studio: Open) -> None:
    desk = studio()
    desk.edit({"kind": "rename", "point_m": [2.8, -0.4], "name": "kitchen"})
    for what in ("places", "nav2"):
        write_export(desk, what)
    assert [item.to for item in recorded_exports(desk.folder)] == ["nav2-route", "zones"]
    rename(desk.folder, "kitchen", "workshop")
    for name in ("places.json", "nav2_route.geojson"):
        text = (desk.folder / name).read_text()
        assert "workshop" in text and "kitchen" not in text


def test_the_labels_of_the_studio_come_with_probabilities_and_an_overview(
    studio: Open, tmp_path: Path
) -> None:
    desk = studio()
    written = write_export(desk, "labels")
    found = write_labels(desk.answer.labelled, desk.source, tmp_path / "same")
    assert [path.name for path in written] == [path.name for path in found]
    assert {"overview.png", "probability_room.png"} <= {path.name for path in written}
    assert [path.read_bytes() for path in written] == [path.read_bytes() for path in found]
