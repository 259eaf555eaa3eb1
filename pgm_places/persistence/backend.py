"""A backend as plain data: its registered name, its options, and its learned arrays."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pgm_places.errors import ModelFileError
from pgm_places.inference.backends import METHODS, Backend
from pgm_places.inference.learned_names import LearnedNames
from pgm_places.options import option_values
from pgm_places.persistence.model_folder import Arrays

KIND = "backend"


def dump(backend: Backend, label_names: Sequence[str] = ()) -> tuple[dict[str, Any], Arrays]:
    """The manifest and the arrays of a backend by itself.

    The label names are stored with it, because learned weights apply to these labels only.
    """
    arrays: Arrays = {}
    names = [str(name) for name in label_names]
    return {"label_names": names, **dump_backend(arrays, KIND, backend)}, arrays


def load(manifest: Mapping[str, Any], arrays: Arrays) -> Any:
    """The backend that :func:`dump` described so."""
    return load_backend(arrays, KIND, manifest)


def dump_backend(arrays: Arrays, prefix: str, backend: Any) -> dict[str, Any]:
    """The backend as plain data; its learned arrays go into ``arrays`` under the prefix."""
    kept = []
    for item in dataclasses.fields(backend):
        value = getattr(backend, item.name)
        if item.metadata.get("learned") and value is not None:
            arrays[f"{prefix}/{item.name}"] = np.asarray(value)
            kept.append(item.name)
    return {
        "backend": METHODS.name_of(type(backend)),
        "options": option_values(backend),
        "learned": kept,
    }


def load_backend(arrays: Arrays, prefix: str, record: Mapping[str, Any]) -> Any:
    """The backend that :func:`dump_backend` described."""
    name = record["backend"]
    backend = METHODS.restored(name, record["options"])
    known = {item.name for item in dataclasses.fields(backend) if item.metadata.get("learned")}
    values = {}
    for field_name in record["learned"]:
        if field_name not in known:
            raise ModelFileError(f"{prefix}: {name} learns no {field_name!r}")
        values[field_name] = arrays[f"{prefix}/{field_name}"]
    restored = dataclasses.replace(backend, **values)
    if isinstance(restored, LearnedNames):
        _ = restored.learned_names  # bytes of a damaged file may be no text
    return restored
