"""A fitted PlaceLabeler as a folder: manifest.json and arrays.safetensors, data only."""

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import ConfigError, ModelFileError, NotFittedError
from pgm_places.features.laser import feature_set_hash
from pgm_places.features.own import FEATURES, n_columns
from pgm_places.inference.backends import METHODS
from pgm_places.labelers.place_labeler import PlaceLabeler, PlaceMethod
from pgm_places.models.boosted_list import BoostedList
from pgm_places.persistence.backend import get_backend, put_backend
from pgm_places.persistence.model_folder import load_folder, save_folder
from pgm_places.plugins import option_values
from pgm_places.sensing.sensor import Sensor, SensorNoise
from pgm_places.unary.map_model import UnaryModel

__all__ = [
    "check_savable",
    "get_features",
    "get_labeler",
    "get_list",
    "get_sensor",
    "load_labeler",
    "put_feature",
    "put_list",
    "restored",
    "save_labeler",
]

KIND = "place-labeler"

Arrays = dict[str, NDArray[Any]]
T = TypeVar("T")


def save_labeler(
    folder: Path, labeler: PlaceLabeler, *, record: Mapping[str, Any] | None = None
) -> None:
    """Write a fitted labeler; ``record`` says how it was trained and is kept word for word."""
    unary = labeler.unary_model
    if unary is None:
        raise NotFittedError("only a fitted PlaceLabeler can be saved; call fit(maps) first")
    arrays: Arrays = {"unary/node_columns": np.asarray(unary.node_columns, np.int64)}
    manifest: dict[str, Any] = {
        "kind": KIND,
        "label_names": list(labeler.label_names),
        "feature_set": feature_set_hash(),
        "features": [put_feature(item) for item in unary.features],
        "resolution_m": labeler.resolution_m,
        "connectivity": labeler.connectivity,
        "sensor": dataclasses.asdict(unary.sensor),
        "context_m": list(unary.context_m),
        "classifier": put_list(arrays, "classifier", unary.classifier),
        "context_classifier": None,
        "methods": [],
        "movement": None,
        "record": dict(record or {}),
    }
    if unary.context_classifier is not None:
        manifest["context_classifier"] = put_list(arrays, "context", unary.context_classifier)
    for name, method in labeler.methods.items():
        manifest["methods"].append(_put_method(arrays, name, method))
    if labeler.movement is not None:
        manifest["movement"] = put_backend(arrays, "movement", labeler.movement)
    save_folder(folder, manifest, arrays)


def check_savable(labeler: PlaceLabeler) -> None:
    """Refuse a labeler that could not be saved, for before a long training.

    Raises
    ------
    OutputError
        A method or a feature is not registered.
    """
    for method in labeler.methods.values():
        METHODS.name_of(type(method.backend))
    for feature in labeler.features:
        FEATURES.name_of(type(feature))


def load_labeler(folder: Path) -> tuple[PlaceLabeler, dict[str, Any]]:
    """The labeler in a folder and its training record.

    Raises
    ------
    ModelFileError
        The folder is missing, damaged, of another kind, or was made for other features.
    """
    manifest, arrays = load_folder(folder)
    if manifest.get("kind") != KIND:
        raise ModelFileError(
            f"{folder} holds a {manifest.get('kind')!r} model; a {KIND!r} is wanted"
        )
    return restored(folder, manifest, arrays, get_labeler)


def restored(
    folder: Path,
    manifest: dict[str, Any],
    arrays: Arrays,
    build: Callable[[dict[str, Any], Arrays], T],
) -> tuple[T, dict[str, Any]]:
    """What ``build`` makes of a model folder's content, and the training record.

    Raises
    ------
    ModelFileError
        It was made for other features, or the content is not what this version writes.
    """
    if manifest.get("feature_set") != feature_set_hash():
        raise ModelFileError(
            f"{folder} was trained with another definition of the laser features; train it again "
            "with this version"
        )
    try:
        return build(manifest, arrays), dict(manifest["record"])
    except ModelFileError as error:
        raise ModelFileError(f"{folder}: {error}") from None
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ModelFileError(
            f"{folder}/manifest.json is not what this version writes ({error!r}); train again"
        ) from None


def get_labeler(manifest: dict[str, Any], arrays: Arrays) -> PlaceLabeler:
    """The labeler that :func:`save_labeler` described so."""
    sensor = get_sensor(manifest["sensor"])
    context_m = tuple(float(width) for width in manifest["context_m"])
    label_names = tuple(str(name) for name in manifest["label_names"])
    features = get_features(manifest)
    n_own, n_labels = n_columns(features), len(label_names)
    classifier = get_list(arrays, "classifier", manifest["classifier"], n_own, n_labels)
    context = None
    if manifest["context_classifier"] is not None:
        n_all = n_own + len(context_m) * n_labels
        context = get_list(arrays, "context", manifest["context_classifier"], n_all, n_labels)
    columns = arrays["unary/node_columns"].astype(np.int64)
    if columns.ndim != 1 or (columns < 0).any() or (columns >= n_own).any():
        raise ModelFileError(f"unary/node_columns must be feature indices below {n_own}")
    unary = UnaryModel(sensor, classifier, n_labels, columns, context_m, context, features)
    methods = {
        item["name"]: _get_method(arrays, number, item)
        for number, item in enumerate(manifest["methods"])
    }
    movement = None
    if manifest.get("movement") is not None:  # absent from models of before
        movement = get_backend(arrays, "movement", manifest["movement"], where="movement")
    return PlaceLabeler(
        label_names,
        methods,
        sensor,
        connectivity=int(manifest["connectivity"]),
        context_m=context_m,
        features=features,
        unary_model=unary,
        resolution_m=float(manifest["resolution_m"]),
        movement=movement,
    )


def get_sensor(record: Mapping[str, Any]) -> Sensor:
    """The sensor that ``dataclasses.asdict`` described."""
    options = dict(record)
    noise = options.pop("noise")
    return Sensor(**options, noise=None if noise is None else SensorNoise(**noise))


def put_feature(feature: Any) -> dict[str, Any]:
    """A feature of one's own as plain data: its registered name, options and columns."""
    return {
        "name": FEATURES.name_of(type(feature)),
        "options": option_values(feature),
        "columns": [str(name) for name in feature.column_names],
    }


def get_features(manifest: Mapping[str, Any]) -> tuple[Any, ...]:
    """The features that a manifest names; none in models of before.

    Raises
    ------
    ModelFileError
        One is not installed, refuses its options, or has other columns now.
    """
    features = []
    for record in manifest.get("features", []):
        try:
            feature = FEATURES.restored(record["name"], record["options"])
        except ConfigError as error:
            raise ModelFileError(str(error)) from None
        columns = [str(name) for name in feature.column_names]
        if columns != record["columns"]:
            raise ModelFileError(
                f"feature {record['name']!r} has the columns {columns} now; the model was trained "
                f"with {record['columns']}: install that version, or train again"
            )
        features.append(feature)
    return tuple(features)


def put_list(arrays: Arrays, prefix: str, classifier: BoostedList) -> dict[str, Any]:
    """The list as plain data; its arrays go into ``arrays`` under the prefix."""
    meta, parts = classifier.to_arrays()
    arrays.update({f"{prefix}/{name}": array for name, array in parts.items()})
    return dict(meta)


def get_list(
    arrays: Arrays, prefix: str, meta: dict[str, Any], n_columns: int, n_labels: int
) -> BoostedList:
    """The list that :func:`put_list` described, if it has these columns and labels."""
    parts = {
        name.removeprefix(f"{prefix}/"): array
        for name, array in arrays.items()
        if name.startswith(f"{prefix}/")
    }
    classifier = BoostedList.from_arrays(meta, parts)
    if classifier.n_features != n_columns:
        raise ModelFileError(
            f"{prefix} expects {classifier.n_features} features, the model has {n_columns}"
        )
    classes = np.asarray(classifier.classes)
    if not np.issubdtype(classes.dtype, np.integer) or (classes >= n_labels).any():
        raise ModelFileError(f"{prefix} has classes {classes.tolist()} but {n_labels} labels")
    return classifier


def _put_method(arrays: Arrays, name: str, method: PlaceMethod) -> dict[str, Any]:
    return {
        "name": name,
        "unary": method.unary,
        **put_backend(arrays, f"method/{name}", method.backend),
    }


def _get_method(arrays: Arrays, number: int, item: dict[str, Any]) -> PlaceMethod:
    backend = get_backend(arrays, f"method/{item['name']}", item, where=f"methods[{number}]")
    return PlaceMethod(backend, item["unary"])
