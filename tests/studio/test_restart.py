"""What a restart of the studio keeps: labels, teaching, ids and names; exports up to date."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pgm_places.cli.places import rename
from pgm_places.errors import InputError, OutputError
from pgm_places.io.maps.map_server import load_map
from pgm_places.io.places.result_folder import recorded_exports
from pgm_places.io.places.topology_files import load_named_topology, save_topology
from pgm_places.labelling.files import write_labels
from pgm_places.labelling.places import places_of
from pgm_places.studio.export_folders import ExportFolders
from pgm_places.studio.exports import EXPORTS, edit_with_exports, exports_record, write_export
from pgm_places.studio.records import state_record
from pgm_places.studio.session import MapSession
from pgm_places.topology.place_edits import renamed
from pgm_places.topology.place_ids import PlaceIds
from tests.quick_labeler import places
from tests.studio.conftest import rectangle, wait

Open = Callable[[], MapSession]


@pytest.fixture
def studio(map_yaml: Path) -> Iterator[Open]:
    """Opens the map with a model and labels it; the session before is closed."""
    made: list[MapSession] = []

    def opened() -> MapSession:
        if made:
            made[-1].close()
        made.append(
            MapSession(load_map(map_yaml), map_yaml.parent / "kept", places(), model="quick")
        )
        made[-1].start()
        wait(made[-1])
        return made[-1]

    yield opened
    made[-1].close()


def paint(
    session: MapSession, label: str, *corners: tuple[float, float], tool: str = "rectangle"
) -> None:
    stroke = {"tool": tool, "points": [list(corner) for corner in corners], "radius": 1}
    number = session.painting.classes.names.index(label)
    session.edit({"kind": "stroke", "label": number, "stroke": stroke})
    wait(session)


def numbered(session: MapSession) -> list[tuple[int, str, tuple[float, float]]]:
    return [(item.id, item.name, item.anchor_m) for item in session.answer.topology.regions]


def taught(session: MapSession) -> None:
    """Teach, part a room by a doorway and join it again, and name a place."""
    paint(session, "room", (6, 6), (24, 24))
    paint(session, "corridor", (27, 6), (45, 24))
    paint(session, "doorway", (15, 5.5), (15, 24.5), tool="doorway")
    session.edit({"kind": "undo"})
    session.edit({"kind": "learn", "on": True})
    wait(session)
    paint(session, "doorway", (36, 5.5), (36, 24.5), tool="doorway")
    session.edit({"kind": "rename", "point_m": [2.8, -0.4], "name": "kitchen"})


def test_labels_teaching_and_ids_are_those_from_before(studio: Open) -> None:
    session = studio()
    taught(session)
    before, names = session.answer, numbered(session)
    assert before.labeler is not session.labeler and "kitchen" in [name for _, name, _ in names]
    assert [number for number, _, _ in names] != list(range(1, len(names) + 1))
    session = studio()
    assert session.learns and session.answer.labeler is not session.labeler
    np.testing.assert_array_equal(session.answer.labels, before.labels)
    beliefs = (session.answer.labelled.labeling.beliefs, before.labelled.labeling.beliefs)
    assert beliefs[0] is not None and beliefs[1] is not None
    assert beliefs[0].tobytes() == beliefs[1].tobytes()
    np.testing.assert_array_equal(session.answer.topology.region, before.topology.region)
    assert numbered(session) == names


def test_teaching_can_be_undone_and_belongs_to_versions(studio: Open) -> None:
    session = studio()
    paint(session, "room", (6, 6), (24, 24))
    session.edit({"kind": "version", "name": "not taught"})
    revision = session.painting.versions[0].revision
    session.edit({"kind": "learn", "on": True})
    assert session.learns
    session.edit({"kind": "undo"})
    assert not session.learns
    session.edit({"kind": "redo"})
    assert session.learns
    session.edit({"kind": "restore", "revision": revision})
    assert not session.learns
    session.edit({"kind": "undo"})
    wait(session)
    assert session.learns and session.answer.labeler is not session.labeler


def edit_origin(map_yaml: Path) -> None:
    text = map_yaml.read_text()
    line = next(line for line in text.splitlines() if line.startswith("origin:"))
    map_yaml.write_text(text.replace(line, "origin: [101.0, 48.0, 0.0]"))


def test_an_edited_origin_is_said_and_keeps_paint_names_and_ids(
    studio: Open, map_yaml: Path
) -> None:
    session = studio()
    taught(session)
    labels, before = session.answer.labels, numbered(session)
    edit_origin(map_yaml)
    session = studio()
    np.testing.assert_array_equal(session.answer.labels, labels)
    after = numbered(session)
    assert [(number, name) for number, name, _ in after] == [(n, name) for n, name, _ in before]
    for (*_, one), (*_, other) in zip(before, after, strict=True):
        assert np.subtract(other, one).tolist() == pytest.approx([100.0, 50.0])
    notices = " ".join(state_record(session)["notices"])
    assert "The origin of the map was (1, -2) m, 0 rad" in notices
    assert "is (101, 48) m, 0 rad now; they keep their ids." in notices
    assert not studio().ids_notice


def older(session: MapSession) -> set[str]:
    items = exports_record(session, ExportFolders.started_here())["items"]
    return {item["name"] for item in items if item["older"]}


def test_an_export_is_up_to_date_while_it_would_be_written_the_same(studio: Open) -> None:
    session = studio()
    paint(session, "room", (6, 6), (24, 24))
    paint(session, "corridor", (27, 6), (45, 24))
    session.edit({"kind": "learn", "on": True})
    wait(session)
    for what in ("labels", "corrections", "places", "nav2", "model", "training"):
        write_export(session, what)
    assert older(session) == set()
    session.edit({"kind": "version", "name": "v"})  # the journal is newer, what it says is not
    assert older(session) == set()
    session.edit({"kind": "rename", "point_m": [2.8, -0.4], "name": "kitchen"})
    assert older(session) == {"places", "nav2"}
    session.edit({"kind": "undo"})
    assert older(session) == set()
    session.edit({"kind": "learn", "on": False})
    assert older(session) == {"labels", "places", "nav2", "model"}
    session.edit({"kind": "undo"})
    paint(session, "corridor", (27, 6), (30, 9))  # as it is already
    assert older(session) == set()
    paint(session, "room", (27, 6), (30, 9))
    assert older(session) == {"labels", "corrections", "places", "nav2", "model", "training"}
    session.edit({"kind": "undo"})
    session = studio()
    assert older(session) == set()
    path = session.folder / "labels.yaml"
    path.write_text(path.read_text() + "# edited\n")
    assert older(session) == {"labels"}


def test_an_export_while_the_labels_are_those_of_earlier_paint_is_out_of_date(studio: Open) -> None:
    session = studio()
    paint(session, "room", (6, 6), (24, 24))
    session.learner.ask = lambda question: None  # type: ignore[method-assign]  # it is busy
    session.edit(rectangle(0, (27, 6), (45, 24)))
    write_export(session, "labels")
    write_export(session, "corrections")
    assert older(session) == {"labels"}


def test_a_folder_with_places_keeps_its_ids_and_names(studio: Open, tmp_path: Path) -> None:
    session, folder = studio(), tmp_path / "labelled"
    folder.mkdir()
    ids = PlaceIds()
    ids.next_id = 40
    earlier = places_of(session.answer.labelled.cells, session.rules, ids=ids)
    save_topology(folder, renamed(earlier, {40: "lab"}))
    (folder / "place_names.yaml").write_text("41: store\n")
    there = ExportFolders(tmp_path)
    for _ in range(2):
        write_export(session, "places", there, chosen="labelled")
        found = load_named_topology(folder)
        np.testing.assert_array_equal(found.region, earlier.region)
        assert (found.place(40).name, found.place(41).name) == ("lab", "store")
    assert (folder / "place_names.yaml").read_text() == '41: "store"\n'


def test_a_name_that_was_taken_back_is_not_in_the_next_export(studio: Open) -> None:
    session = studio()
    session.edit({"kind": "rename", "point_m": [2.8, -0.4], "name": "kitchen"})
    write_export(session, "places")
    assert "kitchen" in (session.folder / "place_names.yaml").read_text()
    session.edit({"kind": "undo"})
    write_export(session, "places")
    assert not (session.folder / "place_names.yaml").exists()
    assert "kitchen" not in [item.name for item in load_named_topology(session.folder).regions]


@pytest.mark.parametrize("at", [(15.0, 8.0), (10.0, 15.0)])
def test_filling_never_removes_a_doorway_that_was_drawn(
    studio: Open, at: tuple[float, float]
) -> None:
    session = studio()
    paint(session, "doorway", (15, 5.5), (15, 24.5), tool="doorway")
    names = session.painting.classes.names
    drawn = session.painting.labels == names.index("doorway")
    assert drawn.any()
    fill: dict[str, Any] = {"kind": "fill", "label": names.index("room"), "point": list(at)}
    try:
        session.edit(fill)
    except InputError as error:
        assert str(error) == "a doorway was drawn there; erase it to remove it"
        assert at[0] == 15.0
    assert (session.painting.labels[drawn] == names.index("doorway")).all()
    if at[0] == 15.0:
        session.edit({**fill, "label": -1})
        assert not (session.painting.labels[drawn] == names.index("doorway")).any()


def test_a_new_name_is_in_all_exports_at_once_or_in_none(studio: Open) -> None:
    session = studio()
    for what in ("places", "nav2"):
        write_export(session, what)
    request = {"kind": "rename", "point_m": [2.8, -0.4], "name": "kitchen"}
    edit_with_exports(session, request)
    assert older(session) == set()
    files = ("places.json", "regions.geojson", "place_names.yaml", "nav2_route.geojson")
    assert all("kitchen" in (session.folder / name).read_text() for name in files)
    (session.folder / "zones.png").unlink()
    (session.folder / "zones.png").mkdir()  # so that it is out of date, and not written again
    edit_with_exports(session, {**request, "name": "lab"})
    assert "lab" in (session.folder / "places.json").read_text()
    assert "kitchen" in (session.folder / "nav2_route.geojson").read_text()
    assert older(session) == {"nav2"}


def test_a_new_name_that_one_export_cannot_write_is_in_none(
    studio: Open, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = studio()
    for what in ("places", "nav2"):
        write_export(session, what)
    files = {path: path.read_bytes() for path in session.folder.glob("*.*json")}

    def fails(*_: object) -> list[Path]:
        raise OutputError("no space left")

    monkeypatch.setitem(EXPORTS, "nav2", replace(EXPORTS["nav2"], write=fails))
    with pytest.raises(OutputError, match="no space left"):
        edit_with_exports(session, {"kind": "rename", "point_m": [2.8, -0.4], "name": "kitchen"})
    changed = {path.name for path, text in files.items() if path.read_bytes() != text}
    assert changed <= {"exports.json"}
    assert older(session) == {"places", "nav2"}


@pytest.mark.parametrize("what", ["places", "training", "labels"])
def test_an_export_that_fails_changes_no_file(
    studio: Open, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    session = studio()
    paint(session, "room", (6, 6), (24, 24))
    session.edit({"kind": "rename", "point_m": [2.8, -0.4], "name": "kitchen"})
    write_export(session, what)
    if what == "places":
        session.edit({"kind": "rename", "point_m": [2.8, -0.4], "name": ""})
    paint(session, "corridor", (27, 6), (45, 24))

    def files() -> dict[Path, bytes]:
        found = (path for path in session.folder.rglob("*") if path.is_file())
        return {path: path.read_bytes() for path in found}

    before, write = files(), EXPORTS[what].write

    def fails(*arguments: Any) -> list[Path]:
        write(*arguments)
        raise OutputError("no space left")

    monkeypatch.setitem(EXPORTS, what, replace(EXPORTS[what], write=fails))
    with pytest.raises(OutputError, match="no space left"):
        write_export(session, what)
    assert files() == before


def test_a_rename_by_the_command_line_makes_the_exports_of_the_studio_again(studio: Open) -> None:
    session = studio()
    session.edit({"kind": "rename", "point_m": [2.8, -0.4], "name": "kitchen"})
    for what in ("places", "nav2"):
        write_export(session, what)
    assert [item.to for item in recorded_exports(session.folder)] == ["nav2-route", "zones"]
    rename(session.folder, "kitchen", "workshop")
    for name in ("places.json", "nav2_route.geojson"):
        text = (session.folder / name).read_text()
        assert "workshop" in text and "kitchen" not in text


def test_the_labels_of_the_studio_come_with_probabilities_and_an_overview(
    studio: Open, tmp_path: Path
) -> None:
    session = studio()
    written = write_export(session, "labels")
    found = write_labels(session.answer.labelled, session.source, tmp_path / "same")
    assert [path.name for path in written] == [path.name for path in found]
    assert {"overview.png", "probability_room.png"} <= {path.name for path in written}
    assert [path.read_bytes() for path in written] == [path.read_bytes() for path in found]
