"""The lists of a remote folder: of several runs, of failures, and where the store is busy."""

import errno
import io
import json
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest

from pgm_places.batch.batch_folder import index_folder
from pgm_places.batch.batch_index import BatchIndex
from pgm_places.batch.found_maps import Shard, find_maps
from pgm_places.batch.label_batch import LabelledBatch, label_batch
from pgm_places.batch.remote_maps import RemoteIndex
from pgm_places.errors import InputError
from pgm_places.labelling.options import LabelOptions
from pgm_places.progress import Silent
from tests.batch.shared import InProcessWorkers, far_rows
from tests.batch.test_remote_maps import label

fsspec = pytest.importorskip("fsspec")


def test_far_results_are_listed_anew(bucket: Any, model: Path, maps: Path, tmp_path: Path) -> None:
    label(model, "memory://out")
    label(model, tmp_path / "near")
    summary, failures = (bucket.cat_file(f"/out/{name}.csv") for name in ("summary", "failures"))
    bucket.rm_file("/out/summary.csv")
    bucket.rm_file("/out/failures.csv")
    bucket.rm("/out/floor2", recursive=True)
    found, written = index_folder(Path("memory://out"), parquet=True, progress=Silent())
    assert found.n_rows == 1
    assert found.n_failures == 1  # nobody asks whether each of the maps is still there
    assert set(written) == {
        f"memory://out/{name}"
        for name in ("failures.csv", "index.html", "summary.csv", "places.parquet")
    }
    assert bucket.cat_file("/out/failures.csv") == failures
    lines = bucket.cat_file("/out/summary.csv").decode().splitlines()
    assert lines[1].split(",")[0] == "floor1/map"
    assert lines[0] == summary.decode().splitlines()[0]
    table = pytest.importorskip("pyarrow.parquet").read_table(
        io.BytesIO(bucket.cat_file("/out/places.parquet"))
    )
    places = json.loads((tmp_path / "near/floor1/map/places.json").read_text())["regions"]
    assert table.column("name").to_pylist() == [place["name"] for place in places]
    with pytest.raises(InputError, match=r"memory://none: no labelled map "):
        index_folder(Path("memory://none"), progress=Silent())


class Meanwhile(InProcessWorkers):
    """This process; another run comes in when the first map is done."""

    def __init__(self, other: Callable[[], object]) -> None:
        self._other: Callable[[], object] | None = other

    def run(
        self, function: Callable[[Any], Any], tasks: Iterable[Any], **_: Any
    ) -> Iterator[tuple[Any, Any]]:
        for done in super().run(function, tasks):
            yield done
            if self._other is not None:
                self._other()
                self._other = None


def label_shard(model: Path, number: int, workers: InProcessWorkers, *maps: str) -> LabelledBatch:
    return label_batch(
        find_maps(maps or ["memory://maps"]),
        Path("memory://out"),
        LabelOptions(model=str(model)),
        workers,
        shard=Shard(number, 2),
        progress=Silent(),
    )


@pytest.mark.parametrize("first", [1, 2])
def test_the_lists_of_several_runs_lose_no_row(bucket: Any, model: Path, first: int) -> None:
    label_shard(model, first, Meanwhile(lambda: label_shard(model, 3 - first, InProcessWorkers())))
    names = [row["name"] for row in far_rows(bucket, "summary.csv")]
    assert names == ["floor1/map", "floor2/map"]
    assert [row["name"] for row in far_rows(bucket, "failures.csv")] == ["torn"]
    tables = {Path(name).parent.name for name in bucket.find("/out/.pgm-places-lists")}
    assert len(tables) == 1  # what other runs had is in the last one's


def test_lists_that_were_put_at_the_same_moment_are_merged(
    bucket: Any, model: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The other run reads before, and writes after, whatever the first one puts at its end."""
    put, other = RemoteIndex.put, [lambda: label_shard(model, 2, InProcessWorkers())]

    def in_between(self: RemoteIndex, *, patient: bool = True) -> None:
        if other and patient:
            other.pop()()
        put(self, patient=patient)

    monkeypatch.setattr(RemoteIndex, "put", in_between)
    label_shard(model, 1, InProcessWorkers())
    assert len(far_rows(bucket, "summary.csv")) == 2
    assert len(far_rows(bucket, "failures.csv")) == 1


def test_lists_that_cannot_be_written_now_are_written_later(
    bucket: Any, model: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(BatchIndex, "_is_due", lambda _: True)
    put_file, refused = type(bucket).put_file, list[str]()

    def busy(self: Any, local: str, target: str, **options: Any) -> None:
        if target.endswith("out/index.html") and not refused:
            refused.append(target)
            raise OSError(errno.EBUSY, "Please reduce your request rate.")
        put_file(self, local, target, **options)

    monkeypatch.setattr(type(bucket), "put_file", busy)
    assert label(model, "memory://out").n_labelled == 2
    assert refused and bucket.exists("/out/index.html")
    assert len(far_rows(bucket, "summary.csv")) == 2
