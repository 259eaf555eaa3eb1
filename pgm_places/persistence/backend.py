"""Backends as plain data: registered name, options and learned arrays."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pgm_places.errors import ModelFileError
from pgm_places.inference.backends import METHODS, Backend, LearnedNames
from pgm_places.options import option_values
from pgm_places.persistence.model_folder import Arrays

KIND = "backend"


def dump(backend: Backend, label_names: Sequence[str] = ()) -> tuple[dict[str, Any], Arrays]:
    """The manifest and the arrays of a backend.

    The label names are included, because learned weights apply to these labels only.
    """
    arrays: Arrays = {}
    names = [str(name) for name in label_names]
    return {"label_names": names, **dump_backend(arrays, KIND, backend)}, arrays


def load(manifest: Mapping[str, Any], arrays: Arrays) -> Any:
    """The backend of :func:`dump`."""
    return load_backend(arrays, KIND, manifest)


def dump_backend(arrays: Arrays, prefix: str, backend: Any) -> dict[str, Any]:
    """The backend as plain data; its learned arrays are added to ``arrays`` under the prefix."""
    learned = []
    for field in dataclasses.fields(backend):
        value = getattr(backend, field.name)
        if field.metadata.get("learned") and value is not None:
            arrays[f"{prefix}/{field.name}"] = np.asarray(value)
            learned.append(field.name)
    return {
        "backend": METHODS.name_of(type(backend)),
        "options": option_values(backend),
        "learned": learned,
    }


def load_backend(arrays: Arrays, prefix: str, record: Mapping[str, Any]) -> Any:
    """The backend of :func:`dump_backend`."""
    name = record["backend"]
    backend = METHODS.from_saved(name, record["options"])
    known = {field.name for field in dataclasses.fields(backend) if field.metadata.get("learned")}
    values = {}
    for field_name in record["learned"]:
        if field_name not in known:
            raise ModelFileError(f"{prefix}: {name} has no learned array {field_name!r}")
        values[field_name] = arrays[f"{prefix}/{field_name}"]
    fitted = dataclasses.replace(backend, **values)
    if isinstance(fitted, LearnedNames):
        _ = fitted.learned_names  # raises if a damaged file holds invalid text
    return fitted
