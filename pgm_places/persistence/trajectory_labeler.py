"""A fitted TrajectoryLabeler as plain data: a manifest and arrays."""

import dataclasses
from collections.abc import Mapping
from typing import Any

from pgm_places.features.custom import n_columns
from pgm_places.features.laser import feature_set_hash
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.persistence import unary as parts
from pgm_places.persistence.backend import dump_backend, load_backend
from pgm_places.persistence.model_folder import Arrays
from pgm_places.unary.local_space_features import N_LOCAL_SPACE_FEATURES
from pgm_places.unary.scan_model import BeamOptions, ScanModel

OPTIONS = ("n_folds", "n_runs", "seed", "loop_m")
"""Stored options: for another fit of the loaded labeler, and for labelling."""


def dump(labeler: TrajectoryLabeler) -> tuple[dict[str, Any], Arrays]:
    """The manifest and the arrays of a fitted labeler."""
    model, arrays = labeler.scan_model_, Arrays()
    manifest = {
        "label_names": list(labeler.label_names_),
        "feature_set": feature_set_hash(),
        "features": parts.dump_features(model.features),
        "sensor": dataclasses.asdict(model.sensor),
        "extra_names": list(model.extra_names),
        "sees_spaces": model.sees_spaces,
        "every_m": float(labeler.update_m),
        "beams": dataclasses.asdict(labeler.beams),
        "options": {name: getattr(labeler, name) for name in OPTIONS},
        "classifier": parts.dump_list(arrays, "classifier", model.classifier),
        "method": dump_backend(arrays, "method", labeler.method_),
    }
    if labeler.floor is not None:
        manifest["floor"] = parts.dump_floor(arrays, labeler.floor, name_shipped=True)
    return manifest, arrays


def load(manifest: Mapping[str, Any], arrays: Arrays) -> TrajectoryLabeler:
    """The labeler of :func:`dump`; the unfitted classifier is not stored."""
    parts.check_feature_set(manifest)
    names = tuple(str(name) for name in manifest["label_names"])
    extra_names = tuple(str(name) for name in manifest["extra_names"])
    features = parts.load_features(manifest)
    sees_spaces = bool(manifest.get("sees_spaces", False))  # absent from earlier versions
    n_all = n_columns(features) + sees_spaces * N_LOCAL_SPACE_FEATURES + len(extra_names)
    classifier = parts.load_list(arrays, "classifier", manifest["classifier"], n_all, len(names))
    sensor = parts.load_sensor(manifest["sensor"])
    labeler = TrajectoryLabeler.of_parts(
        names,
        load_backend(arrays, "method", manifest["method"]),
        ScanModel(classifier, len(names), sensor, extra_names, features, sees_spaces),
        every_m=manifest["every_m"],
        beams=BeamOptions(**manifest["beams"]),
        floor=parts.load_floor(manifest.get("floor"), arrays, len(names)),
    )
    # Absent from models saved by earlier versions.
    return labeler.with_options(**manifest.get("options", {}))
