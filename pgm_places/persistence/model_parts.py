"""Parts of models as plain data: methods, boosted lists, features, sensors, floor networks.

Each ``dump_`` function returns a record and adds its arrays to ``arrays`` under a prefix.
"""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pgm_places.errors import ModelFileError
from pgm_places.features.custom import FEATURES
from pgm_places.features.laser import feature_set_hash
from pgm_places.floor.network import FloorNetwork
from pgm_places.inference.backends import METHODS, LearnedNames
from pgm_places.models.boosted_list import BoostedList
from pgm_places.options import option_values
from pgm_places.persistence.model_folder import Arrays, below, load_folder, put_below
from pgm_places.sensing.sensor import Sensor, SensorNoise
from pgm_places.unary.floor_model import FloorModel

_FLOOR_OPTIONS = ("views_per_network", "share", "doorway_share", "gate_share")

_SHIPPED = Path(__file__).resolve().parents[1] / "trained" / "default"
"""The shipped model, whose networks other models refer to."""


def dump_floor(arrays: Arrays, floor: FloorModel, *, name_shipped: bool = False) -> dict[str, Any]:
    """Floor networks; ``name_shipped`` only names those of the shipped model, to halve a folder."""
    options = {name: getattr(floor, name) for name in _FLOOR_OPTIONS}
    options = {"columns": list(floor.columns), **options}
    packed = [network.packed() for network in floor.networks]
    if name_shipped:
        shipped = [network.packed() for network in _shipped_networks()]
        if len(packed) == len(shipped) and all(map(np.array_equal, packed, shipped)):
            return {"networks_of": _SHIPPED.name, **options}
    arrays.update({f"floor/{number}": network for number, network in enumerate(packed)})
    return {"n_networks": len(packed), **options}


def load_floor(
    record: Mapping[str, Any] | None, arrays: Arrays, n_labels: int
) -> FloorModel | None:
    """The floor networks of a record; None without a record."""
    if record is None:
        return None
    columns = tuple(record["columns"])
    if len(columns) != n_labels:
        raise ModelFileError(f"floor.columns must have {n_labels} entries, got {len(columns)}")
    if "networks_of" in record:
        if record["networks_of"] != _SHIPPED.name:
            raise ModelFileError(
                f"floor.networks_of must be {_SHIPPED.name!r}, got {record['networks_of']!r}"
            )
        networks = _shipped_networks()
    else:
        networks = _networks(arrays, record["n_networks"])
    return FloorModel(networks, columns, **{name: record[name] for name in _FLOOR_OPTIONS})


def _networks(arrays: Arrays, n: int) -> tuple[FloorNetwork, ...]:
    return tuple(FloorNetwork.unpacked(arrays[f"floor/{k}"]) for k in range(n))


def _shipped_networks() -> tuple[FloorNetwork, ...]:
    manifest, arrays = load_folder(_SHIPPED)
    return _networks(arrays, manifest["floor"]["n_networks"])


def check_feature_set(manifest: Mapping[str, object]) -> None:
    """Refuse a model that was trained with another definition of the laser features."""
    if manifest.get("feature_set") != feature_set_hash():
        raise ModelFileError(
            "the model was trained with another definition of the laser features; train it again "
            "with this version"
        )


def load_sensor(record: Mapping[str, Any]) -> Sensor:
    """The sensor of a record made by ``dataclasses.asdict``."""
    options = dict(record)
    noise = options.pop("noise")
    return Sensor(**options, noise=None if noise is None else SensorNoise(**noise))


def dump_features(features: tuple[Any, ...]) -> list[dict[str, Any]]:
    """Custom features: their registered names, options and columns."""
    return [
        {
            "name": FEATURES.name_of(type(feature)),
            "options": option_values(feature),
            "columns": [str(name) for name in feature.column_names],
        }
        for feature in features
    ]


def load_features(manifest: Mapping[str, Any]) -> tuple[Any, ...]:
    """The custom features of a manifest, checked for their columns; none in early models."""
    features = []
    for record in manifest.get("features", []):
        feature = FEATURES.from_saved(record["name"], record["options"])
        columns = [str(name) for name in feature.column_names]
        if columns != record["columns"]:
            raise ModelFileError(
                f"the installed feature {record['name']!r} has the columns {columns}, but the "
                f"model was trained with {record['columns']}: install that version, or train again"
            )
        features.append(feature)
    return tuple(features)


def dump_list(arrays: Arrays, prefix: str, classifier: BoostedList | None) -> dict[str, Any] | None:
    """A boosted list, or None."""
    if classifier is None:
        return None
    meta, parts = classifier.to_arrays()
    put_below(arrays, prefix, parts)
    return dict(meta)


def load_list(
    arrays: Arrays, prefix: str, meta: dict[str, Any], n_columns: int, n_labels: int
) -> BoostedList:
    """The list of :func:`dump_list`, checked for its columns and labels."""
    classifier = BoostedList.from_arrays(meta, below(arrays, prefix))
    if classifier.n_features != n_columns:
        raise ModelFileError(
            f"{prefix} expects {classifier.n_features} features, the model has {n_columns}"
        )
    classes = np.asarray(classifier.classes)
    if not np.issubdtype(classes.dtype, np.integer) or (classes >= n_labels).any():
        raise ModelFileError(f"{prefix} has classes {classes.tolist()} but {n_labels} labels")
    return classifier


def dump_backend(arrays: Arrays, prefix: str, backend: Any) -> dict[str, Any]:
    """A backend: its registered name, options and learned arrays."""
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
