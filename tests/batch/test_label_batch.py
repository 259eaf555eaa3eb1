"""A batch labels every map once, keeps what is done, and lists what went wrong."""

import csv
import errno
import io
import json
import os
import shutil
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest

from pgm_places.batch import map_task
from pgm_places.batch.batch_folder import recorded_root
from pgm_places.batch.found_maps import Shard, find_maps
from pgm_places.batch.label_batch import Plan, label_batch, plan
from pgm_places.batch.map_task import NoSpaceError
from pgm_places.errors import OutputError
from pgm_places.io.maps.map_server import MapFile
from pgm_places.io.output_set import OutputSet, claim
from pgm_places.labelers.labelled_places import LabelledPlaces
from pgm_places.labelling.files import WrittenMap, write_labelled
from pgm_places.labelling.options import LabelOptions, Outputs
from pgm_places.progress import Silent
from tests.batch.shared import (
    Batch,
    CrashingWorkers,
    InProcessWorkers,
    RecordingWorkers,
    failures,
    rows,
)

Again = Callable[..., list[str]]


@pytest.fixture
def again(batch: Batch) -> Again:
    """Runs the batch again; the names of the maps that it labels."""

    def run(**options: Any) -> list[str]:
        watched = RecordingWorkers()
        batch(watched, **options)
        return watched.labelled

    return run


def test_every_map_gets_a_folder_and_what_is_wrong_a_row(batch: Batch, maps: Path) -> None:
    found = batch()
    out = maps.parent / "out"
    assert found.summary() == "3 maps: 2 labelled, 1 failed"
    assert (out / "floor1" / "map" / "labels.png").exists()
    assert not (out / "torn").exists()
    [failed] = rows(out / "failures.csv")
    assert (failed["name"], failed["error"]) == ("torn", "MapError")
    assert "torn.yaml" in failed["message"]
    first, second = rows(out / "summary.csv")
    assert (first["name"], second["name"]) == ("floor1/map", "floor2/map")
    kept = json.loads((out / "floor1" / "map" / "details/summary.json").read_text())["area_m2"]
    assert float(first["room_m2"]) == pytest.approx(kept["room"], abs=1e-3)
    assert float(first["area_m2"]) == pytest.approx(sum(kept.values()), abs=1e-3)
    places = json.loads((out / "floor1" / "map" / "places.json").read_text())["regions"]
    assert int(first["places"]) == len(places)
    page = (out / "index.html").read_text()
    for part in (
        "floor1/map/details/thumbnail.png",
        "torn.yaml",
        '<input type="search">',
        '<a href="#maps" data-search="floor1/">',
        '<tr data-name="floor1/map">',
    ):
        assert part in page
    folders, total = found.overview.folders, found.overview.total
    assert [(name, item.n_rows) for name, item in folders.items()] == [
        ("floor1", 1),
        ("floor2", 1),
        ("", 0),
    ]
    assert folders[""].n_failures == total.n_failures == 1
    for name in ("n_places", "area_m2", "known_m2", "doubtful_m2"):
        assert sum(getattr(item, name) for item in folders.values()) == getattr(total, name) > 0


def test_what_is_done_is_kept_with_the_same_row_though_it_was_corrected_by_hand(
    batch: Batch, maps: Path
) -> None:
    batch()
    out = maps.parent / "out"
    labels = out / "floor1" / "map" / "labels.png"
    labels.write_bytes(b"mine")
    before = (out / "summary.csv").read_text(), (out / "index.html").read_text()
    assert batch().summary() == "3 maps: 0 labelled, 2 already done, 1 failed"
    assert ((out / "summary.csv").read_text(), (out / "index.html").read_text()) == before
    assert labels.read_bytes() == b"mine"
    (maps / "torn.yaml").unlink()
    assert batch().n_failed == 0
    assert not (out / "failures.csv").exists()
    assert recorded_root(out) == maps
    maps.rename(maps.parent / "moved")
    assert recorded_root(out) is None


@pytest.mark.parametrize("change", ["map", "image", "file", "own names"])
def test_what_has_changed_is_labelled_again(
    batch: Batch, again: Again, maps: Path, change: str
) -> None:
    batch()
    source, folder = maps / "floor1", maps.parent / "out" / "floor1" / "map"
    if change == "map":
        with (source / "map.yaml").open("a") as file:
            file.write("# looked through\n")
    elif change == "image":
        (source / "map.png").write_bytes((maps / "floor2" / "map.png").read_bytes())
    elif change == "file":
        (folder / "places.json").unlink()
    else:
        (folder / "place_names.yaml").write_text("1: Reception\n")
    assert again() == ["floor1/map"]
    assert again() == []


def test_a_manifest_changed_by_hand_is_overwritten_only_by_force(
    batch: Batch, again: Again, maps: Path
) -> None:
    batch()
    manifest = maps.parent / "out" / "floor1" / "map" / "details/manifest.json"
    manifest.write_text("{}")
    batch()
    failed = failures(maps.parent / "out")["floor1/map"]
    assert "manifest.json: it was changed" in failed["message"]
    manifest.unlink()
    assert again() == ["floor1/map"]
    manifest.write_text("{}")
    assert again(force=True) == ["floor1/map"]


def test_other_options_label_again(batch: Batch, again: Again) -> None:
    batch()
    both = ["floor1/map", "floor2/map"]
    assert again(doorways="labels") == both
    assert again(doorways="labels", unknown_value=205) == both


def test_a_dead_worker_is_a_failure_of_its_map(batch: Batch, maps: Path) -> None:
    batch(CrashingWorkers())
    found = failures(maps.parent / "out")
    assert list(found) == ["floor1/map", "floor2/map", "torn"]
    assert all("its worker was killed" in row["message"] for row in found.values())


def test_any_error_is_a_failure_of_its_map(
    batch: Batch, maps: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(map_task, "write_labelled", lambda *_, **__: [][1])
    batch()
    failed = failures(maps.parent / "out")["floor1/map"]
    assert failed["error"] == "IndexError"
    assert failed["message"].startswith("list index out of range (test_label_batch.py:")


@pytest.mark.parametrize("reason", [errno.ENOSPC, errno.EDQUOT])
def test_a_full_disk_or_quota_ends_the_batch_and_keeps_what_is_done(
    batch: Batch, again: Again, maps: Path, monkeypatch: pytest.MonkeyPatch, reason: int
) -> None:
    def until_full(
        result: LabelledPlaces, source: MapFile, files: OutputSet, *rest: Any, **options: Any
    ) -> WrittenMap:
        if files.folder.parent.name == "floor2":
            error = OSError(reason, os.strerror(reason))
            raise OutputError(f"cannot write {files.folder}") from error
        return write_labelled(result, source, files, *rest, **options)

    with monkeypatch.context() as changed, pytest.raises(NoSpaceError, match="floor2"):
        changed.setattr(map_task, "write_labelled", until_full)
        batch()
    assert not (maps.parent / "out" / "floor2").exists()
    assert again() == ["floor2/map"]


def test_a_folder_of_somebody_else_is_refused(batch: Batch, maps: Path) -> None:
    (maps.parent / "out").mkdir()
    (maps.parent / "out" / "thesis.tex").write_text("\\begin")
    with pytest.raises(OutputError, match="holds files that pgm-places did not write"):
        batch()


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("Index.html.yaml", "have the name of an index file"),
        ("floor1.yaml", "its folder would contain the folder of"),
        ("Torn.yaml", "only in capital letters"),
    ],
)
def test_a_map_whose_folder_is_in_the_way_is_refused_alone(
    batch: Batch, maps: Path, path: str, message: str
) -> None:
    (maps / path).write_bytes((maps / "floor1" / "map.yaml").read_bytes())
    found = batch()
    assert (found.n_labelled, found.n_failed) == (2, 2)
    texts = [row["message"] for row in failures(maps.parent / "out").values()]
    assert sum(message in text and "rename the map" in text for text in texts) == 1


def test_what_only_looks_like_a_map_gets_a_row(batch: Batch, maps: Path) -> None:
    (maps / "dangling.yaml").symlink_to("gone.yaml")
    (maps / "folder.yml").mkdir()
    found = batch()
    assert (found.n_labelled, found.n_failed) == (2, 3)
    failed = failures(maps.parent / "out")
    assert "dangling.yaml: no such file" in failed["dangling"]["message"]
    assert "folder.yml: is a folder" in failed["folder.yml"]["message"]


def test_what_is_no_longer_in_the_input_is_listed(batch: Batch, maps: Path) -> None:
    batch()
    out = maps.parent / "out"
    (maps / "floor1" / "map.yaml").unlink()
    found = batch()
    assert (found.overview.gone, found.n_skipped) == (["floor1/map"], 1)
    assert [row["in_input"] for row in rows(out / "summary.csv")] == ["no", "yes"]
    assert "No longer in the input" in (out / "index.html").read_text()
    shutil.rmtree(out / "floor1")
    assert batch().overview.gone == []
    assert [row["name"] for row in rows(out / "summary.csv")] == ["floor2/map"]


def test_lists_are_of_the_whole_folder(batch: Batch, maps: Path, model: Path) -> None:
    batch()
    out = maps.parent / "out"
    before = (out / "summary.csv").read_text(), (out / "failures.csv").read_text()
    found = find_maps([str(maps / "floor2")], out, root=recorded_root(out))
    options = LabelOptions(model=str(model))
    done = label_batch(found, out, options, InProcessWorkers(), progress=Silent())
    assert (done.n_skipped, done.overview.n_rows, done.overview.n_failures) == (1, 2, 1)
    assert ((out / "summary.csv").read_text(), (out / "failures.csv").read_text()) == before


def test_rows_are_there_as_soon_as_their_maps_are_done(batch: Batch, maps: Path) -> None:
    summary = maps.parent / "out" / "summary.csv"
    seen = []

    class Looking(InProcessWorkers):
        def run(
            self, function: Callable[[Any], Any], tasks: Iterable[Any], **_: Any
        ) -> Iterator[tuple[Any, Any]]:
            for done in super().run(function, tasks):
                seen.append([row["name"] for row in rows(summary)])
                yield done

    batch(Looking())
    assert seen == [[], ["floor1/map"], ["floor1/map", "floor2/map"]]


def test_a_row_that_was_torn_is_written_again(batch: Batch, maps: Path) -> None:
    batch()
    summary = maps.parent / "out" / "summary.csv"
    whole = summary.read_text()
    summary.write_text(whole[: whole.rindex("floor2") + 9])
    batch()
    again = [{**row, "time": ""} for row in rows(summary)]
    assert again == [{**row, "time": ""} for row in csv.DictReader(io.StringIO(whole))]


@pytest.mark.parametrize("name", ["summary.csv", "failures.csv", "index.html"])
def test_a_list_that_is_not_ours_is_refused(batch: Batch, maps: Path, name: str) -> None:
    out = maps.parent / "out"
    claim(out)
    (out / name).write_text("mine,too\n1,2\n")
    with pytest.raises(OutputError, match=name):
        batch()
    assert (out / name).read_text() == "mine,too\n1,2\n"


class Elsewhere(InProcessWorkers):
    """This process in the place of a worker that the judge asks about."""

    def __init__(self, spoil: Callable[[Any], None]) -> None:
        self._spoil = spoil

    def run(
        self, function: Callable[[Any], Any], tasks: Iterable[Any], *, judge: Any = None, **_: Any
    ) -> Iterator[tuple[Any, Any]]:
        for task, result in super().run(function, tasks):
            self._spoil(task)
            fault = judge.fault(task, result, "tcp://b:1")
            yield task, result if fault is None else fault.result


def test_a_result_that_cannot_be_seen_here_is_not_labelled(
    batch: Batch, maps: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(time, "sleep", lambda _: None)
    found = batch(Elsewhere(lambda task: shutil.rmtree(task.folder, ignore_errors=True)))
    assert (found.n_labelled, found.n_failed, found.overview.n_rows) == (0, 3, 0)
    failed = failures(maps.parent / "out")
    assert "worker tcp://b:1 labelled the map, but its result" in failed["floor1/map"]["message"]
    assert "tcp://b:1" not in failed["torn"]["message"]  # the map's own fault
    assert batch(Elsewhere(lambda _: None)).n_labelled == 2


def test_what_a_worker_cannot_write_may_be_its_own_fault(
    batch: Batch, maps: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: Any, **__: Any) -> None:
        raise OutputError("cannot write") from PermissionError()

    monkeypatch.setattr(map_task, "write_labelled", refuse)
    batch(Elsewhere(lambda _: None))
    failed = failures(maps.parent / "out")
    assert failed["floor1/map"]["message"] == "cannot write (worker tcp://b:1)"


def test_shards_share_all_maps_and_never_move_one(batch: Batch, maps: Path) -> None:
    counts = [batch(how={"shard": Shard(number, 3)}) for number in (1, 2, 3)]
    assert sum(found.n_labelled + found.n_failed for found in counts) == 3
    assert all(found.n_skipped == 0 for found in counts)
    last = counts[-1].overview
    assert (last.n_rows, last.n_failures) == (2, 1)
    names = [f"site{number}/map" for number in range(1000)]
    parts = [[name for name in names if Shard(part, 7).has(name)] for part in range(1, 8)]
    assert sorted(name for part in parts for name in part) == sorted(names)
    assert all(100 < len(part) < 190 for part in parts)


def test_only_what_failed_is_tried_again(batch: Batch, maps: Path) -> None:
    batch()
    (maps / "torn.yaml").write_bytes((maps / "floor2" / "map.yaml").read_bytes())
    (maps / "map.png").write_bytes((maps / "floor2" / "map.png").read_bytes())
    found = batch(how={"only_failed": True})
    assert (found.n_labelled, found.n_skipped, found.n_failed) == (1, 0, 0)
    assert found.overview.n_rows == 3
    assert batch(how={"only_failed": True}).summary() == "0 maps: 0 labelled"


def test_pictures_may_be_left_out_and_are_made_when_they_are_wanted(
    batch: Batch, again: Again, maps: Path
) -> None:
    folder = maps.parent / "out" / "floor1" / "map"
    batch(outputs=Outputs.named("none"))
    names = {path.name for path in folder.rglob("*")}
    assert {"labels.png", "places.json", "regions.png", "check.csv"} <= names
    assert not {"overview.png", "topology.png", "thumbnail.png", "probability_room.png"} & names
    assert "thumbnail.png" not in (maps.parent / "out" / "index.html").read_text()
    assert again(outputs=Outputs.named("none")) == []
    assert again() == ["floor1/map", "floor2/map"]
    assert (folder / "details/thumbnail.png").exists()
    assert again(outputs=Outputs.named("probabilities")) == []  # there is more than is wanted


def test_a_plan_says_what_would_be_done_and_writes_nothing(
    batch: Batch, maps: Path, model: Path
) -> None:
    out, options = maps.parent / "out", LabelOptions(model=str(model))

    def planned() -> Plan:
        found = find_maps([str(maps)], out)
        return plan(found, out, options)

    assert planned().summary() == "3 maps: 3 to label; nothing was written"
    assert not out.exists()
    batch()
    assert planned() == Plan(("torn",), ("torn",), ("floor1/map", "floor2/map"), ())
