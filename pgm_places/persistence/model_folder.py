"""Model folders: manifest.json and arrays.safetensors.

There is no pickle: loading a model runs no code from the files. safetensors checks its header
against the file size before it allocates memory.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places._version import __version__
from pgm_places.errors import ModelFileError, PgmPlacesError, quoted
from pgm_places.io.atomic import atomic_folder, check_folder_target
from pgm_places.io.input_file import file_kind, read_bytes, read_json, user_path

MANIFEST, ARRAYS = "manifest.json", "arrays.safetensors"
FORMAT = "pgm_places model"
SCHEMA = 1
MAX_MANIFEST, MAX_ARRAYS = 16 << 20, 2 << 30

Arrays = dict[str, NDArray[Any]]


def below(arrays: Mapping[str, NDArray[Any]], prefix: str) -> Arrays:
    """The arrays named ``prefix/NAME``, by ``NAME``."""
    start = f"{prefix}/"
    return {key.removeprefix(start): a for key, a in arrays.items() if key.startswith(start)}


def put_below(arrays: Arrays, prefix: str, parts: Mapping[str, NDArray[Any]]) -> None:
    """Add arrays with the names ``prefix/NAME``."""
    arrays.update({f"{prefix}/{key}": array for key, array in parts.items()})


def save_folder(path: Path | str, manifest: Mapping[str, Any], arrays: Arrays) -> Path:
    """Write a model folder atomically; an existing model is replaced.

    The manifest is JSON data with a text ``kind``. Arrays are booleans, integers and floats of any
    shape, without NaN.
    """
    from safetensors.numpy import save

    folder = Path(path)
    stored = {name: _storable(folder, name, array) for name, array in arrays.items()}
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
        "may_hold_nan": [],  # required by the previous version
        "content": dict(manifest),
    }
    try:
        text = _json_lines(record, levels=4) + "\n"
    except (TypeError, ValueError, RecursionError) as error:
        raise ModelFileError(f"{folder}: the manifest must be plain JSON data: {error}") from None
    with atomic_folder(folder, replaces=is_model) as temporary:
        (temporary / ARRAYS).write_bytes(data)
        (temporary / MANIFEST).write_text(text, encoding="utf-8", newline="\n")
    return folder


def _json_lines(value: Any, levels: int) -> str:
    """JSON with one line per key of the outermost objects: readable, and good for diff."""
    if not levels or not isinstance(value, dict) or not value:
        return json.dumps(value, allow_nan=False)
    lines = [f"{json.dumps(key)}: {_json_lines(inner, levels - 1)}" for key, inner in value.items()]
    return "{\n" + ",\n".join(lines) + "\n}"


def load_folder(path: Path | str) -> tuple[dict[str, Any], Arrays]:
    """The manifest and the arrays (read-only) of a model folder, checked for damage and changes."""
    folder = user_path(path, ModelFileError)
    kind = file_kind(folder)
    if kind != "folder":
        what = "not there" if kind is None else "a file"
        raise ModelFileError(
            f"{folder} is {what}; a model is a folder written by 'pgm-places train'"
        )
    record = _manifest(folder)
    arrays = _arrays(folder / ARRAYS, record["arrays_sha256"])
    for name, array in arrays.items():
        _check_numbers(folder, name, array)
        array.setflags(write=False)
    return record["content"], arrays


@contextmanager
def readable(folder: Path | str) -> Iterator[None]:
    """Convert errors from a damaged or foreign model to one line that names the folder."""
    try:
        yield
    except PgmPlacesError as error:
        raise ModelFileError(f"{folder}: {_shortened(str(error))}") from None
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        raise ModelFileError(
            f"{folder}/{MANIFEST} does not have the format of this version ({quoted(error)}); "
            "train again"
        ) from None


def _shortened(message: str) -> str:
    """A message with its middle cut out if it is too long."""
    return message if len(message) <= 600 else f"{message[:400]} ... {message[-150:]}"


def is_model(path: Path | str) -> bool:
    """Whether a folder holds only a model, so that it may be replaced."""
    folder = Path(path)
    try:
        if {file.name for file in folder.iterdir()} - {MANIFEST, ARRAYS}:
            return False
        return bool(_manifest(folder))
    except (OSError, ModelFileError):
        return False


def check_target(path: Path | str) -> None:
    """Check before a long computation that ``save_folder`` can write to a path."""
    check_folder_target(path, replaces=is_model)


def _storable(folder: Path, name: str, array: NDArray[Any]) -> NDArray[Any]:
    if not isinstance(array, np.ndarray) or array.dtype.kind not in "biuf":
        kind = array.dtype if isinstance(array, np.ndarray) else type(array).__name__
        raise ModelFileError(
            f"{folder}: array {name!r} must be a NumPy array of booleans, integers or floats, "
            f"got {kind}"
        )
    _check_numbers(folder, name, array)
    native = array.astype(array.dtype.newbyteorder("="), copy=False)
    return np.asarray(native, order="C")  # preserves the shape ()


def _check_numbers(folder: Path, name: str, array: NDArray[Any]) -> None:
    """Reject NaN, a sign of damage; thresholds may be infinite."""
    if array.dtype.kind == "f" and np.isnan(array).any():
        raise ModelFileError(
            f"{folder}: array {name!r} holds {int(np.isnan(array).sum())} NaN of {array.size} "
            "values; train again"
        )


def _manifest(folder: Path) -> dict[str, Any]:
    path = folder / MANIFEST
    record = read_json(path, ModelFileError, "the manifest of a model", max_bytes=MAX_MANIFEST)
    if not isinstance(record, dict) or record.get("format") != FORMAT:
        raise ModelFileError(f"{path} does not describe a {FORMAT}")
    if record.get("schema") != SCHEMA:
        raise ModelFileError(
            f"{path} has schema {quoted(record.get('schema'))} (written by version "
            f"{quoted(record.get('package_version'))}), this version {__version__} reads {SCHEMA}; "
            "use a matching version or train again"
        )
    for key, kind in (("arrays_sha256", str), ("content", dict)):
        if not isinstance(record.get(key), kind):
            raise ModelFileError(f"{path}: key {key!r} is missing or damaged; train again")
    return record


def _arrays(path: Path, sha256: str) -> Arrays:
    from safetensors import SafetensorError
    from safetensors.numpy import load

    data = read_bytes(path, ModelFileError, "the arrays of a model", max_bytes=MAX_ARRAYS)
    if hashlib.sha256(data).hexdigest() != sha256:
        raise ModelFileError(
            f"{path}: the SHA-256 differs from {MANIFEST}, so the file was damaged or replaced; "
            "copy the folder again or train again"
        )
    try:
        return load(data)
    except (SafetensorError, LookupError, TypeError, ValueError, RecursionError) as error:
        raise ModelFileError(f"{path} is damaged: {error}; copy the folder again") from None
