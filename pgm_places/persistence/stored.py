"""Saving and loading of labelers and backends."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pgm_places._arguments import public
from pgm_places._checks import plain_names
from pgm_places.errors import InputError, ModelFileError, OutputError, quoted
from pgm_places.inference.backends import Backend
from pgm_places.labelers.labeler import Labeler
from pgm_places.options import from_mapping
from pgm_places.persistence.model_folder import load_folder, readable, save_folder
from pgm_places.spaces.entered_options import EnteredOptions
from pgm_places.topology.rules import TopologyOptions, stored_options

__all__ = ["KINDS", "Stored", "load", "read", "save"]

USES = {
    "place-labeler": "pgm-places label",
    "trajectory-labeler": "pgm-places track",
    "joint-labeler": "pgm-places track LOG --map MAP, or pgm-places label",
    "structured-labeler": "pgm_places.load(folder) in Python",
    "backend": "pgm_places.load(folder) in Python",
}
"""The command or function for each kind of model, for error messages."""

KINDS = tuple(USES)
"""Kinds of stored models, as in the manifest."""


@dataclass(frozen=True, eq=False)
class Stored:
    """The content of a model folder.

    ``record`` says how the model was trained, unchanged since it was saved. ``rules`` and
    ``entered`` are its options of topological maps and of unreachable space, or the defaults.
    """

    kind: str
    item: Any
    label_names: tuple[str, ...]
    record: Mapping[str, Any]
    rules: TopologyOptions
    entered: EnteredOptions


@public
def save(
    item: Labeler | Backend,
    folder: Path | str,
    *,
    label_names: Sequence[str] = (),
    record: Mapping[str, Any] | None = None,
) -> Path:
    """Save a fitted labeler or a backend as a folder: manifest.json and arrays.safetensors.

    The files are data without pickle, so loading them runs no code.

    Parameters
    ----------
    item : PlaceLabeler, TrajectoryLabeler, JointLabeler, StructuredLabeler or Backend
        Labelers must be fitted.
    folder : Path
        Absent, empty, or a model, which is then replaced.
    label_names : sequence of str
        The labels that a backend was fitted on; not for labelers, which store their own.
    record : mapping, optional
        How it was trained, as plain data; stored unchanged.

    Raises
    ------
    NotFittedError
        The labeler is not fitted.
    OutputError
        A value cannot be stored as data, or the folder cannot be written.
    InputError
        The ``topology`` in the record's ``config`` is invalid.

    Examples
    --------
    >>> import tempfile
    >>> from pgm_places.inference.backends import build
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     load(save(build("potts", {"weight": 0.5}), f"{folder}/model")).weight
    0.5
    """
    kind = _kind_of(item)
    _options_of(dict(record or {}))
    if isinstance(item, Labeler):
        item.check_fitted()
        if label_names:
            raise InputError("a labeler stores its own label names; omit label_names")
    from pgm_places.persistence.labelers import CODECS

    manifest, arrays = CODECS[kind].dump(item)
    names = [str(name) for name in label_names]
    content = {"kind": kind, "label_names": names, **manifest, "record": dict(record or {})}
    return save_folder(folder, content, arrays)


@public
def load(folder: Path | str) -> Any:
    """The labeler or backend in a folder written by :func:`save` of this or an earlier version.

    Raises
    ------
    ModelFileError
        The folder is missing or damaged, was made for other features, or names a method or a
        feature that is not installed.
    """
    return read(folder).item


def read(folder: Path | str, *kinds: str) -> Stored:
    """The content of a model folder with its training record, if it is one of ``kinds``."""
    manifest, arrays = load_folder(folder)
    kind = manifest.get("kind")
    wanted = kinds or KINDS
    if kind not in wanted:
        listed = " or ".join(repr(name) for name in wanted)
        use = ""
        if isinstance(kind, str) and kind in USES:  # a damaged manifest may hold anything
            use = f"; use this one with {USES[kind]}"
        raise ModelFileError(f"{folder} holds a {quoted(kind)} model; expected a {listed}{use}")
    from pgm_places.persistence.labelers import CODECS

    with readable(folder):
        names = plain_names("label_names", manifest["label_names"])  # before they are written
        record = manifest.get("record", {})
        item, options = CODECS[kind].load(manifest, arrays), _options_of(record)
        return Stored(kind, item, names, record, *options)


def _options_of(record: object) -> tuple[TopologyOptions, EnteredOptions]:
    """The checked options of topological maps and of unreachable space in a record."""
    config = _table("record.config", _table("record", record).get("config", {}))
    paths = {name: f"record.config.{name}" for name in ("topology", "entered")}
    tables = {name: _table(path, config.get(name, {})) for name, path in paths.items()}
    rules = stored_options(tables["topology"], path=paths["topology"])
    return rules, from_mapping(EnteredOptions, tables["entered"], path=paths["entered"])


def _table(where: str, value: Any) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise InputError(f"{where} must be a table of keys and values, got {quoted(value)}")
    return value


def _kind_of(item: object) -> str:
    if isinstance(item, Labeler) and item.stored_as in KINDS:
        return item.stored_as
    if isinstance(item, Backend) and not isinstance(item, type | Labeler):
        return "backend"
    raise OutputError(
        f"only labelers and backends can be saved, got a {type(item).__name__}; for maps there is "
        "save_map"
    )
