"""A fitted TrajectoryLabeler as a folder: manifest.json and arrays.safetensors, data only."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import ModelFileError, NotFittedError
from pgm_places.features.laser import feature_set_hash
from pgm_places.features.own import n_columns
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.persistence.backend import get_backend, put_backend
from pgm_places.persistence.model_folder import load_folder, save_folder
from pgm_places.persistence.place_labeler import KIND as PLACES_KIND
from pgm_places.persistence.place_labeler import (
    get_features,
    get_labeler,
    get_list,
    get_sensor,
    put_feature,
    put_list,
    restored,
)
from pgm_places.unary.scan_model import BeamOptions, ScanModel

__all__ = ["load_trajectory_labeler", "save_trajectory_labeler"]

KIND = "trajectory-labeler"

Arrays = dict[str, NDArray[Any]]


def save_trajectory_labeler(
    folder: Path | str, labeler: TrajectoryLabeler, *, record: Mapping[str, Any] | None = None
) -> Path:
    """The folder with a fitted labeler; ``record`` says how it was trained, kept word for word.

    Raises
    ------
    NotFittedError
        It has not learned.
    OutputError
        The folder cannot be written, or the method's class is not registered.
    """
    model = labeler.scan_model
    if model is None:
        raise NotFittedError("only a fitted TrajectoryLabeler can be saved; call fit first")
    arrays: Arrays = {}
    manifest = {
        "kind": KIND,
        "label_names": list(labeler.label_names),
        "feature_set": feature_set_hash(),
        "features": [put_feature(item) for item in model.features],
        "sensor": dataclasses.asdict(model.sensor),
        "extra_names": list(model.extra_names),
        "every_m": float(labeler.every_m),
        "beams": dataclasses.asdict(labeler.beams),
        "classifier": put_list(arrays, "classifier", model.classifier),
        "method": put_backend(arrays, "method", labeler.method),
        "record": dict(record or {}),
    }
    return save_folder(folder, manifest, arrays)


def load_trajectory_labeler(folder: Path | str) -> tuple[TrajectoryLabeler, dict[str, Any]]:
    """The labeler in a folder and its training record.

    A folder that ``pgm-places train`` wrote from labelled maps gives a labeler as well: its list,
    with what was learned of moving robots.

    Raises
    ------
    ModelFileError
        The folder is missing, damaged, of another kind, or was made for other features.
    NotFittedError
        It labels maps, and was stored without the statistics of moving robots.
    """
    path = Path(folder)
    manifest, arrays = load_folder(path)
    if manifest.get("kind") == PLACES_KIND:
        places, record = restored(path, manifest, arrays, get_labeler)
        return TrajectoryLabeler.from_places(places), record
    if manifest.get("kind") != KIND:
        raise ModelFileError(
            f"{path} holds a {manifest.get('kind')!r} model; a {KIND!r} or a {PLACES_KIND!r} is "
            "wanted"
        )
    return restored(path, manifest, arrays, _labeler)


def _labeler(manifest: dict[str, Any], arrays: Arrays) -> TrajectoryLabeler:
    names = tuple(str(name) for name in manifest["label_names"])
    extra_names = tuple(str(name) for name in manifest["extra_names"])
    features = get_features(manifest)
    n_all = n_columns(features) + len(extra_names)
    classifier = get_list(arrays, "classifier", manifest["classifier"], n_all, len(names))
    sensor = get_sensor(manifest["sensor"])
    model = ScanModel(classifier, len(names), sensor, extra_names, features)
    method = get_backend(arrays, "method", manifest["method"], where="method")
    every_m = float(manifest["every_m"])
    if not np.isfinite(every_m):
        raise ModelFileError(f"every_m must be a finite number, got {every_m}")
    beams = BeamOptions(**manifest["beams"])
    return TrajectoryLabeler(names, method, every_m, beams, model)
