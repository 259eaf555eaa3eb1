"""A fitted PlaceLabeler as plain data: a manifest and arrays."""

import dataclasses
from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np

from pgm_places.errors import ModelFileError
from pgm_places.features.custom import FEATURES, as_features, n_columns
from pgm_places.features.laser import feature_set_hash
from pgm_places.inference.backends import METHODS
from pgm_places.labelers.method import unfitted
from pgm_places.labelers.place_labeler import PlaceLabeler, PlaceMethod
from pgm_places.labelers.place_problem import shown_names
from pgm_places.maps.occupancy_grid import check_resolution
from pgm_places.options import Positive, check_option
from pgm_places.options.marks import Ge, Lt
from pgm_places.persistence import unary as parts
from pgm_places.persistence.backend import dump_backend, load_backend
from pgm_places.persistence.model_folder import Arrays
from pgm_places.spaces.space_spec import EARLIER_SPACE_FEATURES, GATE_FEATURES, space_features_hash
from pgm_places.unary.choice import UnaryChoice
from pgm_places.unary.map_model import EVEN, UnaryModel
from pgm_places.unary.options import SpaceOptions
from pgm_places.unary.space_model import N_SPACE_COLUMNS, SpaceModel

OPTIONS = (
    "learn_on",
    "n_folds",
    "n_node_features",
    "max_examples_per_map",
    "whole_spaces",
    "doorway_depth_m",
)
"""Stored options: for another fit of the loaded labeler, and for labelling."""


def dump(labeler: PlaceLabeler) -> tuple[dict[str, Any], Arrays]:
    """The manifest and the arrays of a fitted labeler."""
    unary = labeler.unary_model_
    arrays: Arrays = {"unary/node_columns": np.asarray(unary.node_columns, np.int64)}
    second, movement = unary.context_classifier, labeler.movement_
    manifest = {
        "label_names": list(labeler.learned_names),
        "feature_set": feature_set_hash(),
        "features": parts.dump_features(unary.features),
        "resolution_m": labeler.resolution_m_,
        "connectivity": labeler.connectivity,
        "options": {name: getattr(labeler, name) for name in OPTIONS},
        "sensor": dataclasses.asdict(unary.sensor),
        "context_m": list(unary.context_m),
        "classifier": parts.dump_list(arrays, "classifier", unary.classifier),
        "context_classifier": None
        if second is None
        else parts.dump_list(arrays, "context", second),
        "methods": [
            {"name": name, "unary": method.unary}
            | dump_backend(arrays, f"method/{name}", method.backend)
            for name, method in labeler.methods_.items()
        ],
        "movement": None if movement is None else dump_backend(arrays, "movement", movement),
    }
    if unary.knows_halls:
        manifest["halls"] = labeler.halls
    if unary.space is not None:
        manifest["space"] = _dump_space(arrays, unary.space)
        manifest["exponents"] = list(unary.exponents)
    if labeler.unary_choice_ is not None:
        manifest["unary_choice"] = dataclasses.asdict(labeler.unary_choice_)
    if unary.floor is not None:
        manifest["floor"] = parts.dump_floor(arrays, unary.floor)
    return manifest, arrays


def load(manifest: Mapping[str, Any], arrays: Arrays) -> PlaceLabeler:
    """The labeler of :func:`dump`.

    The unfitted classifier is not stored, so that labelling does not need scikit-learn. Another fit
    of the loaded labeler uses the default classifier.
    """
    parts.check_feature_set(manifest)
    resolution_m = check_option("resolution_m", float, manifest["resolution_m"])
    check_resolution(resolution_m)
    unary = _unary_model(manifest, arrays)
    methods = {
        name: PlaceMethod(load_backend(arrays, f"method/{name}", entry), entry["unary"])
        for entry in manifest["methods"]
        for name in [entry["name"]]
    }
    choice = manifest.get("unary_choice")  # absent from models saved by earlier versions
    record = manifest.get("movement")  # absent from models saved by earlier versions
    names = tuple(str(name) for name in manifest["label_names"])
    labeler = PlaceLabeler(
        (*names, "hall") if unary.knows_halls else names,
        {
            name: dataclasses.replace(method, backend=unfitted(method.backend))
            for name, method in methods.items()
        },
        unary.sensor,
        connectivity=manifest["connectivity"],
        context_m=unary.context_m,
        space=None if unary.space is None else SpaceOptions(),
        features=unary.features,
        halls=manifest.get("halls", "corridor"),  # absent from models without halls
        floor=unary.floor,
        **manifest.get("options", {}),  # absent from models saved by earlier versions
    )
    labeler.check_options()
    return labeler.set_learned(
        unary_model_=unary,
        methods_=methods,
        learn_seconds_={},
        resolution_m_=resolution_m,
        movement_=None if record is None else load_backend(arrays, "movement", record),
        label_names_=shown_names(names, unary, labeler.halls),
        unary_choice_=None if choice is None else UnaryChoice.from_record(choice),
    )


def check_savable(labeler: PlaceLabeler) -> None:
    """Check before a long training that the labeler can be saved.

    Raises
    ------
    OutputError
        A method or a feature is not registered.
    """
    for method in labeler.resolved_methods().values():
        METHODS.name_of(type(method.backend))
    for feature in as_features(labeler.features):
        FEATURES.name_of(type(feature))


def _unary_model(manifest: Mapping[str, Any], arrays: Arrays) -> UnaryModel:
    context_m = tuple(float(width) for width in manifest["context_m"])
    features, n_labels = parts.load_features(manifest), len(manifest["label_names"])
    n_own = n_columns(features)
    context = None
    if manifest["context_classifier"] is not None:
        meta, n_all = manifest["context_classifier"], n_own + len(context_m) * n_labels
        context = parts.load_list(arrays, "context", meta, n_all, n_labels)
    columns = arrays["unary/node_columns"].astype(np.int64)
    if columns.ndim != 1 or (columns < 0).any() or (columns >= n_own).any():
        raise ModelFileError(f"unary/node_columns must be feature indices below {n_own}")
    return UnaryModel(
        parts.load_sensor(manifest["sensor"]),
        parts.load_list(arrays, "classifier", manifest["classifier"], n_own, n_labels),
        n_labels,
        columns,
        context_m,
        context,
        features,
        _load_space(manifest.get("space"), arrays, n_own, n_labels),
        parts.load_floor(manifest.get("floor"), arrays, n_labels),
        # Absent from models saved by earlier versions.
        check_option("exponents", tuple[Positive, Positive], manifest.get("exponents", EVEN)),
    )


def _dump_space(arrays: Arrays, space: SpaceModel) -> dict[str, object]:
    return {
        "feature_set": space_features_hash(),
        "classifier": parts.dump_list(arrays, "space", space.classifier),
        "gates": None if space.gates is None else parts.dump_list(arrays, "gates", space.gates),
        "doorway": space.doorway,
        "corridor": space.corridor,
    }


def _load_space(
    record: Mapping[str, Any] | None, arrays: Arrays, n_own: int, n_labels: int
) -> SpaceModel | None:
    if record is None:  # as in all models saved by earlier versions
        return None
    if record["feature_set"] not in (space_features_hash(), *EARLIER_SPACE_FEATURES):
        raise ModelFileError(
            "the model was trained with another definition of the space features; train it again "
            "with this version"
        )
    doorway, gates = record["doorway"], record["gates"]
    corridor = record.get("corridor")  # absent from models saved by earlier versions
    known = Annotated[int, Ge(0), Lt(n_labels)] | None
    for name, label in (("doorway", doorway), ("corridor", corridor)):
        check_option(f"space.{name}", known, label)
    n_classes = n_labels + (corridor is not None)
    return SpaceModel(
        parts.load_list(arrays, "space", record["classifier"], n_own + N_SPACE_COLUMNS, n_classes),
        None if gates is None else parts.load_list(arrays, "gates", gates, len(GATE_FEATURES), 2),
        doorway,
        corridor,
    )
