"""Unary models as plain data: the sensor, custom features, boosted lists."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from pgm_places.errors import ModelFileError
from pgm_places.features.laser import feature_set_hash
from pgm_places.features.own import FEATURES
from pgm_places.models.boosted_list import BoostedList
from pgm_places.options import option_values
from pgm_places.persistence.model_folder import Arrays
from pgm_places.sensing.sensor import Sensor, SensorNoise

__all__ = [
    "check_feature_set",
    "dump_features",
    "dump_list",
    "load_features",
    "load_list",
    "load_sensor",
]


def check_feature_set(manifest: Mapping[str, Any]) -> None:
    """Refuse lists that learned from other laser features than this version computes.

    Raises
    ------
    ModelFileError
        The definition has changed since.
    """
    if manifest.get("feature_set") != feature_set_hash():
        raise ModelFileError(
            "it was trained with another definition of the laser features; train it again with "
            "this version"
        )


def load_sensor(record: Mapping[str, Any]) -> Sensor:
    """The sensor that ``dataclasses.asdict`` described."""
    options = dict(record)
    noise = options.pop("noise")
    return Sensor(**options, noise=None if noise is None else SensorNoise(**noise))


def dump_features(features: tuple[Any, ...]) -> list[dict[str, Any]]:
    """Custom features as plain data: their registered names, options and columns."""
    return [
        {
            "name": FEATURES.name_of(type(feature)),
            "options": option_values(feature),
            "columns": [str(name) for name in feature.column_names],
        }
        for feature in features
    ]


def load_features(manifest: Mapping[str, Any]) -> tuple[Any, ...]:
    """The features that a manifest names; none in models saved by earlier versions.

    Raises
    ------
    ModelFileError
        One is not installed, or has other columns now.
    """
    features = []
    for record in manifest.get("features", []):
        feature = FEATURES.restored(record["name"], record["options"])
        columns = [str(name) for name in feature.column_names]
        if columns != record["columns"]:
            raise ModelFileError(
                f"feature {record['name']!r} has the columns {columns} now; the model was trained "
                f"with {record['columns']}: install that version, or train again"
            )
        features.append(feature)
    return tuple(features)


def dump_list(arrays: Arrays, prefix: str, classifier: BoostedList) -> dict[str, Any]:
    """The list as plain data; its arrays go into ``arrays`` under the prefix."""
    meta, parts = classifier.to_arrays()
    arrays.update({f"{prefix}/{name}": array for name, array in parts.items()})
    return dict(meta)


def load_list(
    arrays: Arrays, prefix: str, meta: dict[str, Any], n_columns: int, n_labels: int
) -> BoostedList:
    """The list that :func:`dump_list` described, if it has these columns and labels."""
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
