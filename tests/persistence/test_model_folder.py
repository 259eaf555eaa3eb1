"""Models as folders: round trips, damage, and that nothing is left half-written."""

import hashlib
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pgm_places.errors import ModelFileError, OutputError
from pgm_places.persistence import model_folder
from pgm_places.persistence.model_folder import check_target, is_model, load_folder, save_folder

MANIFEST = {"kind": "test", "names": ["grün", "b"], "nested": {"x": [1, 2.5, None, True]}}


def arrays() -> dict[str, Any]:
    return {
        "classifier/0/thresholds": np.array([[1.0, -np.inf], [np.inf, 0.1]]),
        "scalar": np.array(3, np.int64),
        "empty": np.empty((0, 4), np.float32),
        "flags": np.array([True, False]),
        "strided": np.arange(12, dtype=np.int16).reshape(3, 4).T[::2],
        "big endian": np.array([1, 2], ">i4"),
    }


def saved(folder: Path) -> Path:
    return save_folder(folder / "model", MANIFEST, arrays())


def edit(path: Path, **changes: Any) -> None:
    record = json.loads((path / "manifest.json").read_text())
    (path / "manifest.json").write_text(json.dumps({**record, **changes}))


def test_what_is_saved_reads_back(tmp_path: Path) -> None:
    path = saved(tmp_path)
    assert sorted(item.name for item in path.iterdir()) == ["arrays.safetensors", "manifest.json"]
    manifest, found = load_folder(path)
    assert manifest == MANIFEST
    assert found.keys() == arrays().keys()
    for name, array in arrays().items():
        assert found[name].shape == array.shape
        assert found[name].dtype == array.dtype.newbyteorder("=")
        assert (found[name] == array).all()
        assert not found[name].flags.writeable


def test_the_manifest_can_be_read_by_people(tmp_path: Path) -> None:
    record = json.loads((saved(tmp_path) / "manifest.json").read_text())
    assert record["format"] == "pgm_places model"
    assert record["schema"] == 1
    assert record["kind"] == "test"
    assert record["arrays"]["strided"] == {"shape": [2, 3], "dtype": "int16"}
    assert len(record["arrays_sha256"]) == 64


def test_the_same_model_gives_the_same_bytes(tmp_path: Path) -> None:
    one, other = saved(tmp_path / "a"), saved(tmp_path / "b")
    for name in ("manifest.json", "arrays.safetensors"):
        assert (one / name).read_bytes() == (other / name).read_bytes()


def test_a_model_is_replaced_and_nothing_else_is(tmp_path: Path) -> None:
    path = saved(tmp_path)
    check_target(path)
    save_folder(path, {"kind": "other"}, {})
    assert load_folder(path) == ({"kind": "other"}, {})
    (path / "notes.txt").write_text("mine")
    assert not is_model(path)
    for refused in (lambda: check_target(path), lambda: save_folder(path, MANIFEST, {})):
        with pytest.raises(OutputError, match="it exists and holds other files; choose another"):
            refused()
    assert (path / "notes.txt").read_text() == "mine"
    assert [item.name for item in tmp_path.iterdir()] == ["model"]


def test_a_path_that_cannot_be_written_is_refused_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="a file of that name is in the way"):
        check_target(tmp_path / "file")
    with pytest.raises(OutputError, match="is a file, not a folder"):
        check_target(tmp_path / "file" / "model")
    check_target(tmp_path / "new" / "model")


def test_a_failed_write_keeps_the_old_model(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = saved(tmp_path)

    def interrupt(self: Path, *arguments: Any, **options: Any) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "write_text", interrupt)
    with pytest.raises(KeyboardInterrupt):
        save_folder(path, {"kind": "other"}, {})
    monkeypatch.undo()
    assert load_folder(path)[0] == MANIFEST
    assert [item.name for item in tmp_path.iterdir()] == ["model"]


def test_nan_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    holed = {"x": np.array([1.0, np.nan, np.nan]), "y": np.array([1.0])}
    with pytest.raises(ModelFileError, match="array 'x' holds 2 NaN of 3 values; train again"):
        save_folder(tmp_path / "model", MANIFEST, holed)
    with monkeypatch.context() as unchecked:
        unchecked.setattr(model_folder, "_check_numbers", lambda *arguments: None)
        path = save_folder(tmp_path / "model", MANIFEST, holed)
    with pytest.raises(ModelFileError, match="array 'x' holds 2 NaN of 3 values"):
        load_folder(path)


@pytest.mark.parametrize(
    ("manifest", "content", "message"),
    [
        ({"kind": "k", "x": {1, 2}}, {}, "the manifest must be plain JSON data: Object of type"),
        ({"kind": "k", "x": float("nan")}, {}, "the manifest must be plain JSON data: Out of"),
        ({"kind": "k"}, {"x": [1, 2]}, "array 'x' must be a NumPy array of booleans, integers or "),
        ({"kind": "k"}, {"x": np.array(["a"])}, "integers or floats, got <U1"),
        ({"kind": "k"}, {"x": np.array([None])}, "integers or floats, got object"),
    ],
)
def test_what_cannot_be_stored_is_refused(
    tmp_path: Path, manifest: dict[str, Any], content: dict[str, Any], message: str
) -> None:
    with pytest.raises(ModelFileError) as caught:
        save_folder(tmp_path / "model", manifest, content)
    assert message in str(caught.value)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": "other"}, "manifest.json does not describe a pgm_places model"),
        ({"schema": 2}, "has schema 2 (written by version '"),
        ({"content": 3}, "key 'content' is missing or damaged; train again"),
        (
            {"arrays_sha256": "0" * 64},
            "the SHA-256 differs from manifest.json, so the file was damaged or",
        ),
    ],
)
def test_edited_manifests_are_refused(
    tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    path = saved(tmp_path)
    edit(path, **changes)
    with pytest.raises(ModelFileError) as caught:
        load_folder(path)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    "data", [b"", struct.pack("<Q", 1 << 60) + b"{}", struct.pack("<Q", 2) + b"[]" + bytes(8)]
)
def test_arrays_that_are_no_safetensors_are_refused_even_with_a_matching_hash(
    data: bytes, tmp_path: Path
) -> None:
    path = saved(tmp_path)
    (path / "arrays.safetensors").write_bytes(data)
    edit(path, arrays_sha256=hashlib.sha256(data).hexdigest())
    with pytest.raises(ModelFileError, match=r"arrays\.safetensors is damaged: .*; copy the fold"):
        load_folder(path)


def test_missing_parts_are_named(tmp_path: Path) -> None:
    with pytest.raises(ModelFileError, match="absent is not there; a model is a folder written by"):
        load_folder(tmp_path / "absent")
    (tmp_path / "file").write_text("")
    with pytest.raises(ModelFileError, match="file is a file; a model is a folder"):
        load_folder(tmp_path / "file")
    path = saved(tmp_path)
    (path / "arrays.safetensors").unlink()
    with pytest.raises(ModelFileError, match=r"safetensors: no such file; expected the arrays"):
        load_folder(path)
    (path / "manifest.json").write_bytes(b'{"a": \xff')
    with pytest.raises(ModelFileError, match=r"manifest\.json: not UTF-8 text"):
        load_folder(path)
    (path / "manifest.json").write_text('{"a": NaN}')
    with pytest.raises(ModelFileError, match="NaN is not a JSON number"):
        load_folder(path)
