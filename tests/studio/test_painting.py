"""Edits, the way back, and what is left of them after a kill."""

import json
import sys
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from pgm_places.errors import InputError, OutputError
from pgm_places.maps.occupancy_grid import FREE, OccupancyGrid
from pgm_places.studio.journal import Journal
from pgm_places.studio.painting import Classes, Painting
from pgm_places.studio.runs import runs_of_mask
from pgm_places.studio.session import MapSession
from tests.refusals import refused

Reopen = Callable[[], MapSession]


def brush(label: int, *points: tuple[float, float], radius: float = 1.0) -> dict[str, object]:
    stroke = {"tool": "brush", "points": [list(point) for point in points], "radius": radius}
    return {"kind": "stroke", "label": label, "stroke": stroke}


def reopened(session: MapSession, open_session: Reopen) -> MapSession:
    session.close()
    return open_session()


def test_every_edit_is_there_after_a_restart(session: MapSession, open_session: Reopen) -> None:
    session.edit(brush(0, (10.5, 10.5), (12.5, 14.5)))
    session.edit({"kind": "class", "index": 3, "name": "lab", "colour": "#112233"})
    session.edit(brush(3, (30.5, 10.5)))
    session.edit({"kind": "undo"})
    session.edit({"kind": "version", "name": "first"})
    again = reopened(session, open_session)
    assert (again.painting.labels == session.painting.labels).all()
    assert again.painting.classes == session.painting.classes
    assert again.painting.versions == session.painting.versions
    assert again.painting.revision == session.painting.revision == 5
    again.edit({"kind": "redo"})
    assert again.painting.labels[10, 30] == 3


def test_undo_goes_back_through_every_edit_and_redo_forth_again(session: MapSession) -> None:
    seen = [session.painting.labels.copy()]
    generator = np.random.default_rng(3)
    for _ in range(60):
        x, y = generator.uniform(6, 44), generator.uniform(6, 24)
        revision = session.painting.revision
        try:
            session.edit(brush(int(generator.integers(-1, 3)), (x, y), radius=3))
        except InputError:
            continue
        if session.painting.revision > revision:
            seen.append(session.painting.labels.copy())
    for expected in reversed(seen[:-1]):
        session.edit({"kind": "undo"})
        assert (session.painting.labels == expected).all()
    refused(InputError, "nothing to undo", session.edit, {"kind": "undo"})
    for expected in seen[1:]:
        session.edit({"kind": "redo"})
        assert (session.painting.labels == expected).all()


def test_a_new_edit_ends_redo(session: MapSession) -> None:
    session.edit(brush(0, (10, 10)))
    session.edit({"kind": "undo"})
    session.edit(brush(1, (10, 10)))
    refused(InputError, "nothing to redo", session.edit, {"kind": "redo"})


def test_a_version_can_be_gone_back_to_and_that_undone(
    session: MapSession, open_session: Reopen
) -> None:
    session.edit(brush(0, (10, 10), radius=3))
    session.edit({"kind": "version", "name": "good"})
    then, revision = session.painting.labels.copy(), session.painting.versions[0].revision
    session.edit(brush(1, (10, 10), (30, 12), radius=4))
    later = session.painting.labels.copy()
    session.edit({"kind": "restore", "revision": revision})
    assert (session.painting.labels == then).all()
    session.edit({"kind": "undo"})
    assert (session.painting.labels == later).all()
    session.edit({"kind": "redo"})
    assert (reopened(session, open_session).painting.labels == then).all()


@contextmanager
def counted_calls() -> Iterator[list[int]]:
    """A list that gets the number of calls made in the block."""
    count = 0
    found: list[int] = []

    def note(*_: object) -> None:
        nonlocal count
        count += 1

    before = sys.getprofile()
    sys.setprofile(note)
    try:
        yield found
    finally:
        sys.setprofile(before)
        found.append(count)


def blank(folder: Path, shape: tuple[int, int] = (30, 30)) -> Painting:
    """The painting of an empty map, kept in a folder."""
    journal = Journal(folder / "journal.jsonl", {"map": "0" * 64})
    return Painting(
        OccupancyGrid(np.zeros(shape, np.int8), 0.1), Classes.named(("a", "b")), journal
    )


def test_going_back_takes_as_long_however_often_it_was_done_before(tmp_path: Path) -> None:
    painting = blank(tmp_path)
    calls: list[int] = []
    for number in range(12):
        painting.paint_runs(np.array([[0, number, 1]]), 0)
        painting.save_version(f"version {number}")
        painting.paint_runs(np.array([[1, number, 1]]), 1)
        with counted_calls() as found:
            painting.restore(painting.versions[-1].revision)
        calls += found
    assert calls[-1] < 2 * calls[2]
    painting.journal.close()
    with counted_calls() as opened:
        again = blank(tmp_path)
    assert (again.labels == painting.labels).all()
    assert opened[0] < 12 * 4 * calls[2]
    again.journal.close()


def test_every_version_is_gone_back_to_as_it_was(session: MapSession, open_session: Reopen) -> None:
    generator = np.random.default_rng(8)
    kept: dict[int, tuple[np.ndarray, object, object]] = {}
    painting = session.painting
    for number in range(80):
        kind = generator.choice(["paint", "undo", "redo", "class", "name", "version", "restore"])
        if kind == "paint":
            runs = runs_of_mask(generator.random(painting.labels.shape) < 0.01)
            painting.paint_runs(runs, int(generator.integers(-1, 3)))
        elif kind == "class":
            painting.set_class(int(generator.integers(3)), f"class {number}", "#112233")
        elif kind == "name":
            painting.rename((float(number), 0.0), f"place {number}", [])
        elif kind == "version":
            painting.save_version(f"version {number}")
            state = painting.labels.copy(), painting.classes, dict(painting.names)
            kept[painting.revision] = state
        elif kind == "restore" and kept:
            revision = int(generator.choice(list(kept)))
            painting.restore(revision)
            labels, classes, names = kept[revision]
            assert (painting.labels == labels).all()
            assert (painting.classes, painting.names) == (classes, names)
        elif (kind == "undo" and painting.can_undo) or (kind == "redo" and painting.can_redo):
            getattr(painting, kind)()
    assert len(kept) > 5
    again = reopened(session, open_session).painting
    assert (again.labels == painting.labels).all()
    assert (again.classes, again.names) == (painting.classes, painting.names)


def test_a_journal_of_an_earlier_studio_is_read(tmp_path: Path) -> None:
    entries = [
        {"op": "paint", "label": 0, "runs": [0, 0, 3, 1, 0, 2]},
        {"op": "version", "name": "one", "at": 1.5},
        {"op": "paint", "label": 1, "runs": [0, 1, 2]},
        {"op": "class", "index": 2, "name": "lab", "colour": "#112233"},
        {"op": "version", "name": "two", "at": 2.5},
        {"op": "restore", "revision": 2},
        {"op": "name", "at": [0.1, 0.2], "name": "hall", "replaces": []},
        {"op": "restore", "revision": 5},
        {"op": "undo"},
        {"op": "undo"},
        {"op": "undo"},
        {"op": "redo"},
        {"op": "paint", "label": -1, "runs": [1, 0, 1]},
    ]
    header = {"format": "pgm-places-studio", "schema": 1, "map": "0" * 64}
    lines = [json.dumps(entry) for entry in [header, *entries]]
    (tmp_path / "journal.jsonl").write_text("\n".join([*lines, ""]))
    painting = blank(tmp_path, (2, 4))
    assert painting.labels.tolist() == [[0, 0, 0, -1], [-1, 0, -1, -1]]
    assert list(painting.classes.names) == ["a", "b"] and painting.names == {}
    painting.restore(5)
    assert painting.labels.tolist() == [[0, 1, 1, -1], [0, 0, -1, -1]]
    assert list(painting.classes.names) == ["a", "b", "lab"]
    painting.journal.close()


def test_an_edit_takes_memory_for_its_runs_and_not_for_each_cell(tmp_path: Path) -> None:
    painting = blank(tmp_path, (1000, 1000))
    everything = np.array([[row, 0, 1000] for row in range(1000)])
    painting.paint_runs(everything[:1], 0)  # what is made once
    tracemalloc.start()
    try:
        painting.paint_runs(everything, 1)
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert most < painting.labels.size
    painting.journal.close()


def test_a_line_torn_by_a_kill_is_dropped_and_all_before_it_kept(
    session: MapSession, open_session: Reopen
) -> None:
    session.edit(brush(0, (10, 10)))
    labels = session.painting.labels.copy()
    session.edit(brush(1, (30, 12)))
    path = session.painting.journal.path
    session.close()
    path.write_bytes(path.read_bytes()[:-5])
    again = open_session()
    assert (again.painting.labels == labels).all()
    again.edit(brush(2, (30, 12)))
    assert (reopened(again, open_session).painting.labels == again.painting.labels).all()


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('{"op":"paint","label":9,"runs":[1,1,1]}', ""),
        ("what?", "; restore"),
        ('{"op":"paint","label":0,"runs":[1,1,' + "9" * 30 + "]}", r" \(Python int too large"),
        ('{"op":"restore","revision":3}', r" \(no revision 3\)"),
        ('{"op":"' + "\\u001b" * 3000 + '"}', r" \(unknown edit"),
    ],
)
def test_a_damaged_line_is_named(
    session: MapSession, open_session: Reopen, line: str, message: str
) -> None:
    session.edit(brush(0, (10.5, 10.5), radius=0))
    path = session.painting.journal.path
    session.close()
    lines = path.read_text().splitlines()
    assert json.loads(lines[1]) == {"op": "paint", "label": 0, "runs": [10, 10, 1]}
    path.write_text("\n".join([*lines, line, ""]))
    with pytest.raises(InputError, match=rf"journal\.jsonl: line 3 is damaged{message}") as caught:
        open_session()
    assert len(str(caught.value)) < 2000 and str(caught.value).isprintable()


def test_two_studios_do_not_share_a_folder(session: MapSession, open_session: Reopen) -> None:
    refused(OutputError, "open in another studio", open_session)


def test_a_journal_that_others_wrote_to_is_not_written_to(session: MapSession) -> None:
    path = session.painting.journal.path
    with path.open("a") as file:
        file.write("x\n")
    with pytest.raises(OutputError, match="changed by another program"):
        session.edit(brush(0, (10, 10)))
    assert session.painting.n_painted == 0


@pytest.mark.parametrize(
    "request_, words",
    [
        ({"kind": "stroke"}, "takes label, stroke"),
        ({"kind": "melt"}, "unknown edit"),
        (brush(7, (10, 10)), "there is no class 7"),
        (brush(0), "a brush has 1 to"),
        (brush(0, (1.0, 1.0)), "no free cell"),
        (brush(0, (1e300, 1.0)), "finite"),
        ({"kind": "fill", "label": 0, "point": [1, 1]}, "free cell"),
        ({"kind": "fill", "label": 0, "point": [1]}, "a list of two: a number from"),
        ({"kind": "fill", "label": 0, "point": [True, 1]}, "a list of two: a number from"),
        ({"kind": "fill", "label": 0, "point": [10**400, 1]}, "a list of two: a number from"),
        ({"kind": "rename", "point_m": [1, np.nan], "name": "hall"}, "a list of two: a number"),
        (brush(0, (10**400, 1.0)), "finite"),
        ({"kind": "class", "index": 0, "name": "room", "colour": "#000000"}, "twice"),
        ({"kind": "class", "index": 3, "name": "a/b", "colour": "#000000"}, "file name"),
        ({"kind": "class", "index": 3, "name": "lab", "colour": "red"}, "#rrggbb"),
        ({"kind": "restore", "revision": 4}, "no version 4"),
        ({"kind": "merge", "first": 1, "second": 2}, "no labels yet"),
    ],
)
def test_what_cannot_be_done_changes_nothing(
    session: MapSession, request_: dict[str, object], words: str
) -> None:
    refused(InputError, words, session.edit, request_)
    assert session.painting.revision == 0
    assert session.painting.journal.path.read_text().count("\n") == 1


def test_only_free_cells_are_painted(session: MapSession) -> None:
    session.edit(brush(1, (2, 2), (48, 28), radius=12))
    painted = session.painting.labels >= 0
    assert painted.any() and (session.grid.cells[painted] == FREE).all()


def test_without_places_a_fill_covers_what_is_connected(session: MapSession) -> None:
    door = {"tool": "doorway", "points": [[25.5, 14.2], [25.5, 15.8]], "radius": 0.5}
    session.edit({"kind": "stroke", "label": 2, "stroke": door})
    assert (session.painting.labels[13:17, 25] == 2).all()  # from wall to wall
    session.edit({"kind": "fill", "label": 1, "point": [10.5, 10.5]})
    assert (session.painting.labels[5:25, 5:25] == 1).all()
    assert (session.painting.labels[5:25, 26:46] == -1).all()


def test_a_deleted_class_takes_its_paint_along_and_comes_back(
    session: MapSession, open_session: Reopen
) -> None:
    for number, name in enumerate(("lab", "shop"), start=3):
        session.edit({"kind": "class", "index": number, "name": name, "colour": "#112233"})
    session.edit(brush(3, (10.5, 10.5)))
    session.edit(brush(4, (30.5, 10.5)))
    before = session.painting.labels.copy()
    session.edit({"kind": "drop", "index": 3})
    assert session.painting.classes.names == ("corridor", "room", "doorway", "shop")
    assert session.painting.labels[10, 10] == -1 and session.painting.labels[10, 30] == 3
    again = reopened(session, open_session)
    assert again.painting.classes == session.painting.classes
    assert (again.painting.labels == session.painting.labels).all()
    again.edit({"kind": "undo"})
    assert again.painting.classes.names[3:] == ("lab", "shop")
    assert (again.painting.labels == before).all()
    again.edit({"kind": "redo"})
    for _ in range(2):
        again.edit({"kind": "drop", "index": 0})
    refused(InputError, "two classes must be left", again.edit, {"kind": "drop", "index": 0})


def test_a_link_in_place_of_the_journal_is_refused(tmp_path: Path) -> None:
    (tmp_path / "precious").write_text("")
    (tmp_path / "j").symlink_to("precious")
    with pytest.raises(OutputError, match="j: it is a symbolic link; remove it"):
        Journal(tmp_path / "j", {"map": "one"})
    assert (tmp_path / "precious").read_text() == ""


@pytest.mark.parametrize("text", ["precious", '{"format":"other"}', "a\nb", '{"a":1}\nb', None])
def test_a_file_that_is_no_journal_stays_as_it_is(tmp_path: Path, text: str | None) -> None:
    path = tmp_path / "j"
    if text is None:
        Journal(path, {"map": "two"}).close()
        text = path.read_text()
    path.write_text(text)
    with pytest.raises(InputError, match="belongs to another map" if "two" in text else "j"):
        Journal(path, {"map": "one"})
    assert path.read_text() == text


@pytest.mark.parametrize("length", [1, 10, 40, 55])
def test_a_first_line_that_was_cut_is_written_anew(tmp_path: Path, length: int) -> None:
    Journal(tmp_path / "j", {"map": "one"}).close()
    whole = (tmp_path / "j").read_text()
    (tmp_path / "j").write_text(whole[:length])
    Journal(tmp_path / "j", {"map": "one"}).close()
    assert (tmp_path / "j").read_text() == whole
