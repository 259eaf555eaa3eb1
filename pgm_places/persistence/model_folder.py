"""A model as a folder of data: manifest.json to read, arrays.safetensors for the numbers.

No pickle anywhere: loading a model runs no code of the file's choosing. Every length in the files
is checked against the file's size before anything of that length is allocated.
"""

import hashlib
import json
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from pgm_places._version import __version__
from pgm_places.errors import ModelFileError
from pgm_places.io.atomic import atomic_folder, check_folder_target, check_writable_folder

__all__ = ["check_target", "is_model", "load_folder", "save_folder"]

MANIFEST, ARRAYS = "manifest.json", "arrays.safetensors"
FORMAT = "pgm_places model"
SCHEMA = 1
MAX_MANIFEST_BYTES = 16 << 20
MAX_ARRAYS_BYTES = 4 << 30
MAX_ARRAYS = 10_000
_DTYPES = (
    *("bool", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64"),
    *("float16", "float32", "float64"),
)

Arrays = Mapping[str, NDArray[Any]]


def save_folder(
    path: Path | str,
    manifest: Mapping[str, Any],
    arrays: Arrays,
    *,
    may_hold_nan: Collection[str] = (),
) -> Path:
    """The folder, written as a whole or not at all; a model that stood there is replaced.

    Parameters
    ----------
    path : Path
        The folder. It must be absent, empty, or itself a model.
    manifest : mapping
        Plain data that JSON can hold, with a text ``kind`` that says what the model is.
    arrays : mapping of str to array
        Booleans, integers and floats of any shape.
    may_hold_nan : collection of str
        Names of arrays in which NaN has a meaning; in all others it is refused.

    Raises
    ------
    ModelFileError
        Where the content cannot be stored.
    OutputError
        Where the folder cannot be written or something else stands there.
    """
    folder = Path(path)
    if not isinstance(manifest.get("kind"), str):
        raise ModelFileError(
            f"{folder}: the manifest needs a text 'kind', got {manifest.get('kind')!r}"
        )
    stored = {name: _storable(folder, name, array) for name, array in arrays.items()}
    _check_nan(folder, stored, may_hold_nan)
    from safetensors.numpy import save

    data = save(stored)
    record = {
        "format": FORMAT,
        "schema": SCHEMA,
        "package_version": __version__,
        "kind": manifest["kind"],
        "arrays_sha256": hashlib.sha256(data).hexdigest(),
        "arrays": {
            name: {"shape": list(array.shape), "dtype": array.dtype.name}
            for name, array in stored.items()
        },
        "may_hold_nan": sorted(set(may_hold_nan) & set(stored)),
        "content": dict(manifest),
    }
    try:
        text = json.dumps(record, indent=1, allow_nan=False) + "\n"
    except (TypeError, ValueError, RecursionError) as error:
        raise ModelFileError(f"{folder}: the manifest must be plain JSON data: {error}") from None
    with atomic_folder(folder, replaces=is_model) as temporary:
        (temporary / ARRAYS).write_bytes(data)
        (temporary / MANIFEST).write_text(text, encoding="utf-8", newline="\n")
    return folder


def load_folder(path: Path | str) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """The manifest and the read-only arrays that ``save_folder`` was given.

    Raises
    ------
    ModelFileError
        Where the folder is missing or no model, a file is missing, damaged, too large or changed
        since it was written, a shape or a type differs from the manifest, or an array holds NaN.
    """
    folder = Path(path)
    if not folder.is_dir():
        what = "a file" if folder.exists() else "not there"
        raise ModelFileError(
            f"{folder} is {what}; a model is a folder written by 'pgm-places train'"
        )
    record = _read_manifest(folder)
    data = _read_bytes(folder / ARRAYS, MAX_ARRAYS_BYTES)
    _check_header(folder / ARRAYS, data)
    if hashlib.sha256(data).hexdigest() != record["arrays_sha256"]:
        raise ModelFileError(
            f"{folder / ARRAYS} is not the file that {MANIFEST} describes (another SHA-256): it "
            "was damaged or exchanged; copy the folder again or train again"
        )
    arrays = _read_arrays(folder / ARRAYS, data)
    _check_declared(folder, arrays, record["arrays"])
    _check_nan(folder, arrays, record["may_hold_nan"])
    for array in arrays.values():
        array.setflags(write=False)
    return record["content"], arrays


def is_model(path: Path | str) -> bool:
    """Whether a folder holds a model and nothing else, so that it may be replaced by another."""
    folder = Path(path)
    try:
        if {item.name for item in folder.iterdir()} - {MANIFEST, ARRAYS}:
            return False
        return bool(_read_manifest(folder)["format"] == FORMAT)
    except (OSError, ModelFileError):
        return False


def check_target(path: Path | str) -> None:
    """Refuse a path that ``save_folder`` would refuse; for before a long computation.

    Raises
    ------
    OutputError
        Where the parent folder cannot be written or something other than a model stands there.
    """
    check_folder_target(path, replaces=is_model)
    check_writable_folder(Path(path).absolute().parent)


def _storable(folder: Path, name: str, array: NDArray[Any]) -> NDArray[Any]:
    if not isinstance(array, np.ndarray) or array.dtype.name not in _DTYPES:
        kind = array.dtype if isinstance(array, np.ndarray) else type(array).__name__
        raise ModelFileError(
            f"{folder}: array {name!r} must be a NumPy array of booleans, integers or floats, "
            f"got {kind}"
        )
    native = array.astype(array.dtype.newbyteorder("="), copy=False)
    return np.asarray(native, order="C")  # keeps a shape of () as it is


def _check_nan(folder: Path, arrays: Arrays, may_hold_nan: Collection[str]) -> None:
    for name, array in arrays.items():
        if array.dtype.kind == "f" and name not in may_hold_nan and np.isnan(array).any():
            raise ModelFileError(
                f"{folder}: array {name!r} holds {int(np.isnan(array).sum())} NaN of {array.size} "
                "values; train again"
            )


def _read_bytes(path: Path, limit: int) -> bytes:
    try:
        if not path.is_file():
            raise ModelFileError(
                f"{path} is missing; a model folder holds {MANIFEST} and {ARRAYS}, copy both"
            )
        if path.stat().st_size > limit:
            raise ModelFileError(f"{path} has more than {limit} bytes; no model is so large")
        return path.read_bytes()
    except OSError as error:
        raise ModelFileError(f"{path} cannot be read: {error.strerror or error}") from None


def _read_manifest(folder: Path) -> dict[str, Any]:
    path = folder / MANIFEST
    try:
        record = json.loads(
            _read_bytes(path, MAX_MANIFEST_BYTES).decode("utf-8"), parse_constant=_no_constant
        )
    except (ValueError, RecursionError) as error:
        if isinstance(error, ModelFileError):
            raise
        raise ModelFileError(f"{path} is damaged: {error}; copy the folder again") from None
    if not isinstance(record, dict) or record.get("format") != FORMAT:
        raise ModelFileError(f"{path} does not describe a {FORMAT}")
    if record.get("schema") != SCHEMA:
        raise ModelFileError(
            f"{path} has schema {record.get('schema')!r} (written by version "
            f"{record.get('package_version')!r}), this version {__version__} reads {SCHEMA}; "
            "use a matching version or train again"
        )
    _check_fields(path, record)
    return record


def _no_constant(text: str) -> NoReturn:
    raise ValueError(f"{text} is no JSON number")


def _check_fields(path: Path, record: dict[str, Any]) -> None:
    wanted: dict[str, type] = {
        "kind": str,
        "arrays_sha256": str,
        "arrays": dict,
        "may_hold_nan": list,
        "content": dict,
    }
    for key, kind in wanted.items():
        if not isinstance(record.get(key), kind):
            raise ModelFileError(f"{path}: key {key!r} is missing or damaged; train again")
    if record["content"].get("kind") != record["kind"]:
        raise ModelFileError(f"{path}: it states two kinds of model; train again")
    if len(record["arrays"]) > MAX_ARRAYS:
        raise ModelFileError(f"{path}: lists more than {MAX_ARRAYS} arrays; no model has so many")


def _check_header(path: Path, data: bytes) -> None:
    """Refuse a header length that the file cannot hold before anything parses it."""
    length = int.from_bytes(data[:8], "little")
    if len(data) < 8 or length > min(len(data) - 8, MAX_MANIFEST_BYTES):
        raise ModelFileError(f"{path} is damaged: its header does not fit the file; copy it again")


def _read_arrays(path: Path, data: bytes) -> dict[str, NDArray[Any]]:
    from safetensors import SafetensorError
    from safetensors.numpy import load

    try:
        return dict(load(data))
    except (SafetensorError, ValueError, KeyError, TypeError) as error:
        raise ModelFileError(f"{path} is damaged: {error}; copy the folder again") from None


def _check_declared(folder: Path, arrays: Arrays, declared: dict[str, Any]) -> None:
    if set(arrays) != set(declared):
        differing = ", ".join(sorted(set(arrays) ^ set(declared))[:5])
        raise ModelFileError(
            f"{folder}: {MANIFEST} and {ARRAYS} list different arrays: {differing}; train again"
        )
    for name, array in arrays.items():
        found = {"shape": list(array.shape), "dtype": array.dtype.name}
        if declared[name] != found:
            raise ModelFileError(
                f"{folder}: array {name!r} is {found}, {MANIFEST} says {declared[name]}; "
                "train again"
            )
