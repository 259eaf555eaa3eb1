"""A backend with what it has learned as a folder: manifest.json and arrays.safetensors."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import ConfigError, ModelFileError
from pgm_places.inference.backends import METHODS, Backend
from pgm_places.persistence.model_folder import load_folder, save_folder
from pgm_places.plugins import option_values

__all__ = ["get_backend", "load_backend", "put_backend", "save_backend"]

KIND = "backend"

Arrays = dict[str, NDArray[Any]]


def save_backend(folder: Path | str, backend: Backend, label_names: Sequence[str]) -> Path:
    """The folder with a backend in it, its options and what it has learned; no pickle.

    The label names are kept beside it, because learned weights mean nothing under other ones.

    Parameters
    ----------
    folder : Path
        Absent, empty, or a model, which is then replaced.
    backend : Backend
        Any method of :func:`pgm_places.inference.backends.backend_names`, fitted or not.
    label_names : sequence of str
        The K labels that it was fitted on.

    Raises
    ------
    OutputError
        The backend's class is not registered, or the folder cannot be written.
    """
    arrays: Arrays = {}
    manifest = {
        "kind": KIND,
        "label_names": [str(name) for name in label_names],
        **put_backend(arrays, KIND, backend),
    }
    return save_folder(folder, manifest, arrays)


def load_backend(folder: Path | str) -> tuple[Any, tuple[str, ...]]:
    """The backend in a folder and the names of its labels.

    Raises
    ------
    ModelFileError
        The folder is missing, damaged, of another kind, or its method is not installed.
    """
    manifest, arrays = load_folder(folder)
    if manifest.get("kind") != KIND:
        raise ModelFileError(
            f"{folder} holds a {manifest.get('kind')!r} model; a {KIND!r} is wanted"
        )
    try:
        names = tuple(str(name) for name in manifest["label_names"])
        return get_backend(arrays, KIND, manifest, where=str(folder)), names
    except ModelFileError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ModelFileError(
            f"{folder}/manifest.json is not what this version writes ({error!r}); save it again"
        ) from None


def put_backend(arrays: Arrays, prefix: str, backend: Any) -> dict[str, Any]:
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


def get_backend(arrays: Arrays, prefix: str, record: Mapping[str, Any], *, where: str) -> Any:
    """The backend that :func:`put_backend` described; ``where`` begins the messages."""
    name = record["backend"]
    try:
        backend = METHODS.restored(name, record["options"])
    except (ConfigError, ModelFileError) as error:
        raise ModelFileError(f"{where}: {error}") from None
    known = {item.name for item in dataclasses.fields(backend) if item.metadata.get("learned")}
    values = {}
    for field_name in record["learned"]:
        if field_name not in known:
            raise ModelFileError(f"{where}: {name} learns no {field_name!r}")
        values[field_name] = arrays[f"{prefix}/{field_name}"]
    return dataclasses.replace(backend, **values)
