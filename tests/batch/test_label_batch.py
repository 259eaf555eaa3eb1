"""A batch labels every map once, keeps what is done, and lists what went wrong."""

import csv
import errno
import json
import os
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest

from pgm_places.batch import map_task
from pgm_places.batch.found_maps import find_maps
from pgm_places.batch.label_batch import LabelledBatch, label_batch
from pgm_places.batch.label_options import LabelOptions
from pgm_places.batch.map_files import LabelledFile, label_file
from pgm_places.batch.map_task import NoSpaceError
from pgm_places.batch.workers import Done
from pgm_places.errors import OutputError
from pgm_places.io.maps.map_server import MapFile
from pgm_places.io.output_set import OutputSet
from pgm_places.progress import Silent


class Here:
    """Workers that are this process."""

    def run(self, function: Callable[[Any], Any], tasks: Iterable[Any]) -> Iterator[Done]:
        return (Done(task, function(task)) for task in tasks)


class Dying:
    """Workers that die on every task."""

    def run(self, function: Callable[[Any], Any], tasks: Iterable[Any]) -> Iterator[Done]:
        return (Done(task, None) for task in tasks)


Batch = Callable[..., LabelledBatch]


@pytest.fixture
def batch(model: Path, maps: Path) -> Batch:
    def run(workers: Any = None, *, force: bool = False, **changes: Any) -> LabelledBatch:
        out = maps.parent / "out"
        found = find_maps([str(maps)], out)
        options = LabelOptions(model=str(model), **changes)
        return label_batch(
            found.maps, out, options, workers or Here(), force=force, progress=Silent()
        )

    return run


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def labelled_now(found: LabelledBatch) -> list[str]:
    return [row.name for row in found.rows if not row.kept]


def test_every_map_gets_a_folder_and_what_is_wrong_a_row(batch: Batch, maps: Path) -> None:
    found = batch()
    out = maps.parent / "out"
    assert found.summary() == "3 maps: 2 labelled, 1 failed"
    assert (out / "floor1" / "labels.png").exists()
    assert not (out / "torn").exists()
    [failed] = rows(out / "failures.csv")
    assert (failed["name"], failed["error"]) == ("torn", "MapError")
    assert "torn.yaml" in failed["message"]
    first, second = rows(out / "summary.csv")
    assert (first["name"], second["name"]) == ("floor1", "floor2")
    kept = json.loads((out / "floor1" / "summary.json").read_text())["area_m2"]
    assert float(first["room_m2"]) == pytest.approx(kept["room"], abs=1e-3)
    assert float(first["area_m2"]) == pytest.approx(sum(kept.values()), abs=1e-3)
    places = json.loads((out / "floor1" / "topology.json").read_text())["regions"]
    assert int(first["places"]) == len(places)
    page = (out / "index.html").read_text()
    assert "floor1/thumbnail.png" in page
    assert "torn.yaml" in page


def test_what_is_done_is_kept_with_the_same_row(batch: Batch, maps: Path) -> None:
    batch()
    out = maps.parent / "out"
    before = (out / "summary.csv").read_text(), (out / "index.html").read_text()
    again = batch()
    assert again.summary() == "3 maps: 0 labelled, 2 done before, 1 failed"
    assert ((out / "summary.csv").read_text(), (out / "index.html").read_text()) == before


@pytest.mark.parametrize("change", ["map", "image", "file", "own names"])
def test_what_has_changed_is_labelled_again(batch: Batch, maps: Path, change: str) -> None:
    batch()
    source, folder = maps / "floor1", maps.parent / "out" / "floor1"
    if change == "map":
        with (source / "map.yaml").open("a") as file:
            file.write("# looked through\n")
    elif change == "image":
        (source / "map.png").write_bytes((maps / "floor2" / "map.png").read_bytes())
    elif change == "file":
        (folder / "topology.json").unlink()
    else:
        (folder / "place_names.yaml").write_text("1: Reception\n")
    assert labelled_now(batch()) == ["floor1"]
    assert labelled_now(batch()) == []


def test_a_manifest_changed_by_hand_is_overwritten_only_by_force(batch: Batch, maps: Path) -> None:
    batch()
    manifest = maps.parent / "out" / "floor1" / "manifest.json"
    manifest.write_text("{}")
    assert "manifest.json: it was changed" in batch().failures[0].message
    manifest.unlink()
    assert labelled_now(batch()) == ["floor1"]
    manifest.write_text("{}")
    assert labelled_now(batch(force=True)) == ["floor1"]


def test_other_options_label_again(batch: Batch) -> None:
    batch()
    assert labelled_now(batch(doorways="labels")) == ["floor1", "floor2"]
    assert labelled_now(batch(doorways="labels", unknown_value=205)) == ["floor1", "floor2"]


def test_labels_that_were_corrected_by_hand_are_kept(batch: Batch, maps: Path) -> None:
    batch()
    labels = maps.parent / "out" / "floor1" / "labels.png"
    labels.write_bytes(b"mine")
    assert labelled_now(batch()) == []
    assert labels.read_bytes() == b"mine"


def test_failures_go_when_nothing_fails_any_more(batch: Batch, maps: Path) -> None:
    batch()
    (maps / "torn.yaml").unlink()
    assert batch().failures == ()
    assert not (maps.parent / "out" / "failures.csv").exists()


def test_a_dead_worker_is_a_failure_of_its_map(batch: Batch) -> None:
    found = batch(Dying())
    assert [item.name for item in found.failures] == ["floor1", "floor2", "torn"]
    assert all("its worker died" in item.message for item in found.failures)


def test_any_error_is_a_failure_of_its_map(batch: Batch, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(map_task, "label_file", lambda *_, **__: [][1])
    messages = {item.name: item for item in batch().failures}
    assert messages["floor1"].kind == "IndexError"
    assert messages["floor1"].message.startswith("list index out of range (test_label_batch.py:")


@pytest.mark.parametrize("reason", [errno.ENOSPC, errno.EDQUOT])
def test_a_full_disk_or_quota_ends_the_batch_and_keeps_what_is_done(
    batch: Batch, maps: Path, monkeypatch: pytest.MonkeyPatch, reason: int
) -> None:
    def until_full(model: Any, source: MapFile, files: OutputSet, **options: Any) -> LabelledFile:
        if files.folder.name == "floor2":
            error = OSError(reason, os.strerror(reason))
            raise OutputError(f"cannot write {files.folder}") from error
        return label_file(model, source, files, **options)

    with monkeypatch.context() as changed, pytest.raises(NoSpaceError, match="floor2"):
        changed.setattr(map_task, "label_file", until_full)
        batch()
    assert not (maps.parent / "out" / "floor2").exists()
    assert labelled_now(batch()) == ["floor2"]


def test_a_folder_of_somebody_else_is_refused(batch: Batch, maps: Path) -> None:
    (maps.parent / "out").mkdir()
    (maps.parent / "out" / "thesis.tex").write_text("\\begin")
    with pytest.raises(OutputError, match="holds files that pgm-places did not write"):
        batch()


def test_a_map_may_not_be_called_like_the_list_of_all_maps(batch: Batch, maps: Path) -> None:
    (maps / "torn.yaml").rename(maps / "Index.html.yaml")
    with pytest.raises(OutputError, match=r"Index.html, which is reserved for the list of all"):
        batch()
    assert not list((maps.parent / "out").glob("floor*"))
