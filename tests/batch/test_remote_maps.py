"""Maps and results behind addresses are labelled as if they were files of this machine."""

import csv
import errno
import json
import tempfile
import threading
from pathlib import Path
from typing import Any

import pytest

from pgm_places.batch.batch_folder import recorded_root
from pgm_places.batch.found_maps import find_maps
from pgm_places.batch.label_batch import LabelledBatch, Plan, label_batch, plan
from pgm_places.batch.map_task import Failure, MapTask, NoSpaceError
from pgm_places.batch.remote_maps import label_anywhere
from pgm_places.errors import MapError, OutputError
from pgm_places.io.remote_files import RemoteFolder, address_of
from pgm_places.labelling.model import LoadedModel
from pgm_places.labelling.options import LabelOptions
from pgm_places.progress import Silent
from tests.batch.shared import InProcessWorkers, failures, far_rows
from tests.batch.simulated_clock import REQUEST_S, Clock

fsspec = pytest.importorskip("fsspec")


def label(model: Path, out: str | Path, *maps: str) -> LabelledBatch:
    found = find_maps(maps or ["memory://maps"])
    return label_batch(
        found, Path(out), LabelOptions(model=str(model)), InProcessWorkers(), progress=Silent()
    )


def test_far_maps_are_labelled_as_near_ones_are(
    bucket: Any, model: Path, maps: Path, tmp_path: Path
) -> None:
    far, near = tmp_path / "far", tmp_path / "near"
    label(model, far)
    label(model, near, str(maps))
    for name in ("labels.png", "places.json", "regions.png"):
        path = Path("floor1") / "map" / name
        assert (far / path).read_bytes() == (near / path).read_bytes()
    with (far / "summary.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["map"] for row in rows] == [
        f"memory://maps/floor{number}/map.yaml" for number in (1, 2)
    ]
    assert label(model, far).summary() == "3 maps: 0 labelled, 2 already done, 1 failed"


def test_far_results_are_kept_and_completed(bucket: Any, model: Path) -> None:
    found = label(model, "memory://out")
    assert found.written == tuple(
        f"memory://out/{name}" for name in ("failures.csv", "index.html", "summary.csv")
    )
    names = {Path(name).name for name in bucket.find("/out/floor1/map")}
    assert {"labels.png", "thumbnail.png", "manifest.json", ".pgm-places.json"} <= names
    before = bucket.modified("/out/floor1/map/labels.png")
    bucket.rm_file("/out/floor2/map/labels.png")
    again = label(model, "memory://out")
    assert (again.n_labelled, again.n_skipped, again.overview.n_rows) == (1, 1, 2)
    assert bucket.modified("/out/floor1/map/labels.png") == before
    manifest = json.loads(bucket.cat_file("/out/floor2/map/details/manifest.json"))
    assert manifest["map"] == "memory://maps/floor2/map.yaml"


def test_names_that_a_user_gave_places_are_kept(bucket: Any, model: Path) -> None:
    label(model, "memory://out")
    bucket.pipe_file("/out/floor1/map/place_names.yaml", b"1: Reception\n")
    assert label(model, "memory://out").n_labelled == 1
    assert bucket.cat_file("/out/floor1/map/place_names.yaml") == b"1: Reception\n"
    places = json.loads(bucket.cat_file("/out/floor1/map/places.json"))["regions"]
    assert places[0]["name"] == "Reception"


def break_off_copying(bucket: Any, model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Label all maps, and interrupt the copying of the first result at its places."""
    put_file = type(bucket).put_file

    def until(self: Any, local: str, target: str, **options: Any) -> None:
        if target.endswith("/places.json"):
            raise KeyboardInterrupt
        put_file(self, local, target, **options)

    with monkeypatch.context() as changed, pytest.raises(KeyboardInterrupt):
        changed.setattr(type(bucket), "put_file", until)
        label(model, "memory://out")


def test_a_result_whose_copying_was_broken_off_is_not_done(
    bucket: Any, model: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    break_off_copying(bucket, model, monkeypatch)
    assert bucket.exists("/out/floor1/map/labels.png")
    assert not bucket.exists("/out/floor1/map/details/manifest.json")
    bucket.pipe_file("/out/floor1/map/notes.txt", b"mine")
    bucket.pipe_file("/out/floor1/map/place_names.yaml", b"1: Reception\n")
    assert label(model, "memory://out").n_labelled == 2
    assert bucket.cat_file("/out/floor1/map/notes.txt") == b"mine"
    assert bucket.cat_file("/out/floor1/map/place_names.yaml") == b"1: Reception\n"


def test_a_result_whose_replacement_was_broken_off_is_not_done(
    bucket: Any, model: Path, maps: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    label(model, "memory://out")
    bucket.pipe_file("/maps/floor1/map.png", bucket.cat_file("/maps/floor2/map.png"))
    break_off_copying(bucket, model, monkeypatch)
    assert not bucket.exists("/out/floor1/map/details/manifest.json")
    bucket.put_file(str(maps / "floor1" / "map.png"), "/maps/floor1/map.png")
    assert label(model, "memory://out").n_labelled == 1


@pytest.mark.parametrize("out", ["memory://out", "near"])
def test_what_would_be_done_is_said_without_writing(
    out: str, bucket: Any, model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = Path(out) if out != "near" else tmp_path / "near"

    def planned(*, only_failed: bool = False) -> Plan:
        options = LabelOptions(model=str(model))
        return plan(find_maps(["memory://maps"]), target, options, only_failed=only_failed)

    assert planned().to_label == ("floor1/map", "floor2/map", "torn")
    assert not bucket.exists("/out") and not target.exists()
    label(model, target)
    before = {path: bucket.modified(path) for path in bucket.find("/out")}
    fetched: list[str] = []
    get_file = type(bucket).get_file

    def watched(self: Any, path: str, *more: Any, **options: Any) -> None:
        fetched.append(path)
        get_file(self, path, *more, **options)

    monkeypatch.setattr(type(bucket), "get_file", watched)
    found = planned()
    assert (found.done, found.to_label) == (("floor1/map", "floor2/map"), ("torn",))
    assert found.again == ("torn",)
    assert not [path for path in fetched if "torn" in path]  # it has no result to compare with
    assert planned(only_failed=True).to_label == ("torn",)
    bucket.pipe_file("/maps/floor2/map.png", b"another picture")
    assert planned().to_label == ("floor2/map", "torn")
    assert {path: bucket.modified(path) for path in bucket.find("/out")} == before


def test_a_far_folder_keeps_the_root_of_its_names(bucket: Any, model: Path) -> None:
    label(model, "memory://out")
    out = Path("memory://out")
    root = recorded_root(out)
    assert root == Path("memory://maps")
    found = find_maps(["memory://maps/floor1"], out, root=root)
    done = label_batch(
        found, out, LabelOptions(model=str(model)), InProcessWorkers(), progress=Silent()
    )
    assert (done.n_skipped, done.n_labelled) == (1, 0)
    assert [row["name"] for row in far_rows(bucket, "failures.csv")] == ["torn"]
    bucket.rm_file("/maps/torn.yaml")
    label_batch(found, out, LabelOptions(model=str(model)), InProcessWorkers(), progress=Silent())
    assert not bucket.exists("/out/failures.csv")


def test_results_name_addresses_and_no_local_folder(
    bucket: Any, model: Path, tmp_path: Path
) -> None:
    bucket.pipe_file("/maps/cut.yaml", b"image: [")
    bucket.pipe_file("/maps/wrong.yaml", b"image: cut.yaml\nresolution: 0.05\norigin: [0, 0, 0]\n")
    label(model, "memory://out")
    label(model, tmp_path / "near")
    names = bucket.find("/out/floor1/map")
    assert len(names) > 10
    for name in names:
        here = tmp_path / "near" / Path(name).relative_to("/out")
        if here.name not in ("manifest.json", ".pgm-places.json"):  # the seconds that it took
            assert bucket.cat_file(name) == here.read_bytes()
    summary = json.loads(bucket.cat_file("/out/floor1/map/details/summary.json"))
    assert summary["map"] == "memory://maps/floor1/map.yaml"
    far, near = far_rows(bucket, "failures.csv"), failures(tmp_path / "near")
    assert [row["name"] for row in far] == ["cut", "torn", "wrong"]
    for row in far:
        assert row["message"].startswith(f"memory://maps/{row['name']}.yaml: ")
        assert row["message"] == near[row["name"]]["message"]
        assert tempfile.gettempdir() not in row["message"]


def test_a_full_temporary_disk_is_told_from_a_map_that_is_wrong(
    bucket: Any, model: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: Any, **__: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(type(bucket), "get_file", full)
    with pytest.raises(NoSpaceError, match="no space left for temporary files; set TMPDIR"):
        label_anywhere(task_of(model, "memory://maps/floor1/map.yaml"))


@pytest.mark.parametrize(
    ("name", "expected"), [("torn.yaml", False), ("none.yaml", True), ("cut.yaml", False)]
)
def test_what_may_be_the_fault_of_a_worker(
    bucket: Any, model: Path, name: str, expected: bool
) -> None:
    bucket.pipe_file("/maps/cut.yaml", b"image: [")
    found = label_anywhere(task_of(model, f"memory://maps/{name}"))
    assert isinstance(found, Failure)
    assert found.of_worker is expected


def task_of(model: Path, address: str) -> MapTask:
    options = LabelOptions(model=str(model))
    sha256 = LoadedModel.load(options).sha256
    return MapTask("floor1/map", Path(address), Path("memory://out/floor1/map"), options, sha256)


def test_what_is_done_is_found_with_many_requests_at_once(bucket: Any, model: Path) -> None:
    bucket.rm_file("/maps/torn.yaml")
    label(model, "memory://out")
    for number in range(118):
        for folder in ("maps", "out"):
            target = f"/{folder}/site{number % 10}/{number}"
            for name in bucket.find(f"/{folder}/floor1"):
                bucket.cp_file(name, target + name.removeprefix(f"/{folder}/floor1"))
    assert label(model, "memory://out").n_skipped == 120
    before = {path: bucket.modified(path) for path in bucket.find("/out")}
    out, options = Path("memory://out"), LabelOptions(model=str(model))
    planning, labelling = Clock(), Clock()
    with planning.running():
        found = find_maps(["memory://maps"], out, root=recorded_root(out))
        assert len(plan(found, out, options).done) == 120
    with labelling.running():
        found = find_maps(["memory://maps"], out, root=recorded_root(out))
        done = label_batch(found, out, options, InProcessWorkers(), progress=Silent())
        assert done.n_skipped == 120
    assert max(planning.now_s, labelling.now_s) <= 2.0
    assert {path: bucket.modified(path) for path in bucket.find("/out")} == before


def test_a_new_map_costs_no_request_for_an_earlier_result(bucket: Any, model: Path) -> None:
    clock = Clock()
    with clock.running():
        label_anywhere(task_of(model, "memory://maps/floor1/map.yaml"))
    assert clock.requests["find"] == 1
    assert clock.requests["rm_file"] == 1  # the manifest: another run may have put it meanwhile


def test_a_refused_request_is_counted(bucket: Any) -> None:
    clock = Clock()
    with clock.running(), pytest.raises(FileNotFoundError, match="none"):
        bucket.cat_file("/maps/none.yaml")
    assert clock.requests == {"cat_file": 1}
    assert clock.now_s == REQUEST_S


def test_requests_are_made_at_once_where_the_system_can_do_that(bucket: Any) -> None:
    class Shared(type(bucket)):  # type: ignore[misc]
        async_impl = True

    barrier = threading.Barrier(8, timeout=60)
    far = RemoteFolder("s3://b", Shared(skip_instance_cache=True), "/b")
    assert far.at_once(lambda item: (barrier.wait(), item)[1], range(8)) == list(range(8))
    alone = RemoteFolder("memory://b", bucket, "/b")
    me = threading.get_ident()
    assert alone.at_once(lambda _: threading.get_ident(), range(8)) == [me] * 8


def test_an_empty_far_file_gets_a_row_rather_than_ending_the_batch(
    bucket: Any, model: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bucket.pipe_file("/maps/empty.yaml", b"")
    cat_file = type(bucket).cat_file

    def strict(self: Any, path: str, **more: Any) -> Any:
        if path.endswith("empty.yaml"):
            raise OSError(errno.EINVAL, "The requested range is not satisfiable")
        return cat_file(self, path, **more)

    monkeypatch.setattr(type(bucket), "cat_file", strict)
    assert label(model, "memory://out").n_failed == 2


def test_results_among_the_far_maps_are_no_maps(bucket: Any, model: Path) -> None:
    bucket.pipe_file("/maps/out/floor1/map.yaml", b"image: map.png\n")
    found = find_maps(["memory://maps"], Path("memory://maps/out"))
    assert [item.name for item in found.maps] == ["floor1/map", "floor2/map", "torn"]


def test_an_image_elsewhere_is_not_fetched(bucket: Any, model: Path, tmp_path: Path) -> None:
    bucket.pipe_file("/maps/torn.yaml", b"image: ../secret.png\nresolution: 0.05\n")
    label(model, tmp_path / "out")
    assert "is outside the map's folder" in (tmp_path / "out" / "failures.csv").read_text()


def test_addresses_are_refused_in_a_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(MapError, match=r"nonsense://maps: .*Protocol not known"):
        find_maps(["nonsense://maps"])
    with pytest.raises(MapError, match=r"memory://none/\*.yaml: no map found"):
        find_maps(["memory://none/*.yaml", "memory://none"])
    with pytest.raises(MapError, match="the maps have no common folder"):
        find_maps(["memory://a/b.yaml", str(tmp_path / "c.yaml")])
    monkeypatch.setattr("pgm_places.io.remote_files.find_spec", lambda _: None)
    with pytest.raises(MapError, match=r"s3://b/m: an address, .*\[remote\]"):
        find_maps(["s3://b/m"])
    with pytest.raises(OutputError, match=r"s3://b/m: an address, .*\[remote\]"):
        RemoteFolder.at("s3://b/m", OutputError)


@pytest.mark.parametrize("address", ["s3://bucket/m.yaml", "file:///tmp/m.yaml", "memory://m"])
def test_a_path_is_an_address_again(address: str) -> None:
    assert address_of(Path(address)) == address_of(address) == address
