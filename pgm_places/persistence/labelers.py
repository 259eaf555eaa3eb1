"""Fitted labelers and backends as plain data: a manifest and arrays for each kind."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Annotated, Any, NamedTuple

import numpy as np

from pgm_places._checks import finite_array, integer_array
from pgm_places.errors import ModelFileError
from pgm_places.features.custom import FEATURES, as_features, n_columns
from pgm_places.features.laser import feature_set_hash
from pgm_places.inference.backends import METHODS, Backend
from pgm_places.labelers.joint_labeler import JointLabeler
from pgm_places.labelers.method import unfitted
from pgm_places.labelers.place_labeler import PlaceLabeler, PlaceMethod
from pgm_places.labelers.place_problem import shown_names
from pgm_places.labelers.structured_labeler import StructuredLabeler
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.maps.occupancy_grid import check_resolution
from pgm_places.options import Positive, check_option
from pgm_places.options.marks import Ge, Lt
from pgm_places.persistence import model_parts as parts
from pgm_places.persistence.model_folder import Arrays, below, put_below
from pgm_places.spaces.space_spec import EARLIER_SPACE_FEATURES, GATE_FEATURES, space_features_hash
from pgm_places.unary.local_features import N_LOCAL_SPACE_FEATURES
from pgm_places.unary.map_model import EVEN, UnaryModel
from pgm_places.unary.options import SpaceOptions, UnaryChoice
from pgm_places.unary.scan_model import BeamOptions, ScanModel
from pgm_places.unary.space_model import N_SPACE_COLUMNS, SpaceModel

Record = dict[str, Any]

# Options for another fit of the loaded labeler, and for labelling.
_PLACE_OPTIONS = (
    "learn_on",
    "n_folds",
    "n_node_features",
    "max_examples_per_map",
    "whole_spaces",
    "doorway_depth_m",
)
_TRAJECTORY_OPTIONS = ("n_folds", "n_runs", "seed", "loop_m")
_STRUCTURED_OPTIONS = ("learn_on", "n_folds", "min_probability", "metric")

_MOST_FEATURES = 1_000_000


class Codec(NamedTuple):
    """The functions for a kind of model; both raise errors that do not name the folder."""

    dump: Callable[[Any], tuple[Record, Arrays]]
    load: Callable[[Mapping[str, Any], Arrays], Any]


def check_savable(labeler: PlaceLabeler) -> None:
    """Check before a long training that the methods and features are registered."""
    for method in labeler.resolved_methods().values():
        METHODS.name_of(type(method.backend))
    for feature in as_features(labeler.features):
        FEATURES.name_of(type(feature))


def _dump_backend(backend: Backend) -> tuple[Record, Arrays]:
    arrays: Arrays = {}
    return parts.dump_backend(arrays, "backend", backend), arrays


def _load_backend(manifest: Mapping[str, Any], arrays: Arrays) -> Any:
    return parts.load_backend(arrays, "backend", manifest)


def _dump_places(labeler: PlaceLabeler) -> tuple[Record, Arrays]:
    unary = labeler.unary_model_
    arrays: Arrays = {"unary/node_columns": np.asarray(unary.node_columns, np.int64)}
    context, movement = unary.context_classifier, labeler.movement_
    manifest = {
        "label_names": list(labeler.learned_names),
        "feature_set": feature_set_hash(),
        "features": parts.dump_features(unary.features),
        "resolution_m": labeler.resolution_m_,
        "connectivity": labeler.connectivity,
        "options": {name: getattr(labeler, name) for name in _PLACE_OPTIONS},
        "sensor": dataclasses.asdict(unary.sensor),
        "context_m": list(unary.context_m),
        "classifier": parts.dump_list(arrays, "classifier", unary.classifier),
        "context_classifier": parts.dump_list(arrays, "context", context),
        "methods": [
            {"name": name, "unary": method.unary}
            | parts.dump_backend(arrays, f"method/{name}", method.backend)
            for name, method in labeler.methods_.items()
        ],
        "movement": None if movement is None else parts.dump_backend(arrays, "movement", movement),
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


def _load_places(manifest: Mapping[str, Any], arrays: Arrays) -> PlaceLabeler:
    """The labeler without its classifier, which only another fit needs, so without scikit-learn.

    Keys read by ``get`` are absent from models of earlier versions.
    """
    parts.check_feature_set(manifest)
    resolution_m = check_option("resolution_m", float, manifest["resolution_m"])
    check_resolution(resolution_m)
    unary = _load_unary(manifest, arrays)
    methods = {
        name: PlaceMethod(parts.load_backend(arrays, f"method/{name}", entry), entry["unary"])
        for entry in manifest["methods"]
        for name in [entry["name"]]
    }
    choice, movement = manifest.get("unary_choice"), manifest.get("movement")
    names = _label_names(manifest)
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
        halls=manifest.get("halls", "corridor"),
        floor=unary.floor,
        **manifest.get("options", {}),
    )
    labeler.check_options()
    return labeler.set_learned(
        unary_model_=unary,
        methods_=methods,
        learn_seconds_={},
        resolution_m_=resolution_m,
        movement_=None if movement is None else parts.load_backend(arrays, "movement", movement),
        label_names_=shown_names(names, unary, labeler.halls),
        unary_choice_=None if choice is None else UnaryChoice.from_record(choice),
    )


def _label_names(manifest: Mapping[str, Any]) -> tuple[str, ...]:
    return tuple(str(name) for name in manifest["label_names"])


def _load_unary(manifest: Mapping[str, Any], arrays: Arrays) -> UnaryModel:
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
        check_option("exponents", tuple[Positive, Positive], manifest.get("exponents", EVEN)),
    )


def _dump_space(arrays: Arrays, space: SpaceModel) -> Record:
    return {
        "feature_set": space_features_hash(),
        "classifier": parts.dump_list(arrays, "space", space.classifier),
        "gates": parts.dump_list(arrays, "gates", space.gates),
        "doorway": space.doorway,
        "corridor": space.corridor,
    }


def _load_space(
    record: Mapping[str, Any] | None, arrays: Arrays, n_own: int, n_labels: int
) -> SpaceModel | None:
    if record is None:
        return None
    if record["feature_set"] not in (space_features_hash(), *EARLIER_SPACE_FEATURES):
        raise ModelFileError(
            "the model was trained with another definition of the space features; train it again "
            "with this version"
        )
    doorway, corridor, gates = record["doorway"], record.get("corridor"), record["gates"]
    label = Annotated[int, Ge(0), Lt(n_labels)] | None
    check_option("space.doorway", label, doorway)
    check_option("space.corridor", label, corridor)
    n_classes = n_labels + (corridor is not None)
    return SpaceModel(
        parts.load_list(arrays, "space", record["classifier"], n_own + N_SPACE_COLUMNS, n_classes),
        None if gates is None else parts.load_list(arrays, "gates", gates, len(GATE_FEATURES), 2),
        doorway,
        corridor,
    )


def dump_trajectory(labeler: TrajectoryLabeler) -> tuple[Record, Arrays]:
    """The manifest and the arrays of a fitted TrajectoryLabeler."""
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
        "options": {name: getattr(labeler, name) for name in _TRAJECTORY_OPTIONS},
        "classifier": parts.dump_list(arrays, "classifier", model.classifier),
        "method": parts.dump_backend(arrays, "method", labeler.method_),
    }
    if labeler.floor is not None:
        manifest["floor"] = parts.dump_floor(arrays, labeler.floor, name_shipped=True)
    return manifest, arrays


def load_trajectory(manifest: Mapping[str, Any], arrays: Arrays) -> TrajectoryLabeler:
    """The labeler of :func:`dump_trajectory`; the unfitted classifier is not stored."""
    parts.check_feature_set(manifest)
    names = _label_names(manifest)
    extra_names = tuple(str(name) for name in manifest["extra_names"])
    features = parts.load_features(manifest)
    sees_spaces = bool(manifest.get("sees_spaces", False))  # absent from earlier versions
    n_all = n_columns(features) + sees_spaces * N_LOCAL_SPACE_FEATURES + len(extra_names)
    classifier = parts.load_list(arrays, "classifier", manifest["classifier"], n_all, len(names))
    sensor = parts.load_sensor(manifest["sensor"])
    labeler = TrajectoryLabeler.of_parts(
        names,
        parts.load_backend(arrays, "method", manifest["method"]),
        ScanModel(classifier, len(names), sensor, extra_names, features, sees_spaces),
        every_m=manifest["every_m"],
        beams=BeamOptions(**manifest["beams"]),
        floor=parts.load_floor(manifest.get("floor"), arrays, len(names)),
    )
    return labeler.with_options(**manifest.get("options", {}))  # absent from earlier versions


_OF_JOINT = {
    "places": Codec(_dump_places, _load_places),
    "steps": Codec(dump_trajectory, load_trajectory),
}


def _dump_joint(labeler: JointLabeler) -> tuple[Record, Arrays]:
    arrays: Arrays = {}
    manifest: Record = {
        "label_names": list(labeler.label_names_),
        "options": {"link_weight": labeler.link_weight},
        "link_weight": labeler.link_weight_,
        "method": parts.dump_backend(arrays, "method", labeler.method_),
    }
    for name, codec in _OF_JOINT.items():
        manifest[name], inner = codec.dump(getattr(labeler, f"{name}_"))
        put_below(arrays, name, inner)
    return manifest, arrays


def _load_joint(manifest: Mapping[str, Any], arrays: Arrays) -> JointLabeler:
    names = _label_names(manifest)
    method = parts.load_backend(arrays, "method", manifest["method"])
    labelers = {
        name: codec.load(manifest[name], below(arrays, name)) for name, codec in _OF_JOINT.items()
    }
    for name, inner in labelers.items():
        if inner.label_names_ != names:
            raise ModelFileError(f"{name} has labels {list(inner.label_names_)}, not {list(names)}")
    labeler = JointLabeler(names, unfitted(method), **manifest["options"])
    labeler.check_options()
    weight = check_option("link_weight", Positive | None, manifest["link_weight"])
    return labeler.set_learned(
        places_=labelers["places"],
        steps_=labelers["steps"],
        method_=method,
        link_weight_=weight,
        label_names_=names,
    )


def _dump_structured(labeler: StructuredLabeler) -> tuple[Record, Arrays]:
    arrays: Arrays = {}
    classifier = None
    if labeler.classifier_ is not None:
        from pgm_places.persistence.estimator import dump_estimator  # imports scikit-learn

        classifier = dump_estimator(arrays, "classifier", labeler.classifier_)
    manifest = {
        "label_names": list(labeler.label_names_),
        "named": labeler.named_,
        "options": {name: getattr(labeler, name) for name in _STRUCTURED_OPTIONS},
        "classifier": classifier,
        "backend": parts.dump_backend(arrays, "backend", labeler.backend_),
    }
    return manifest, arrays


def _load_structured(manifest: Mapping[str, Any], arrays: Arrays) -> StructuredLabeler:
    backend = parts.load_backend(arrays, "backend", manifest["backend"])
    record, before, fitted = manifest["classifier"], None, None
    if record is not None:
        from pgm_places.persistence.estimator import load_estimator, unfitted_estimator

        before = unfitted_estimator(record)
        fitted = load_estimator(arrays, "classifier", record)
        _try_out(fitted, len(manifest["label_names"]))
    options = {name: manifest["options"][name] for name in _STRUCTURED_OPTIONS}
    labeler = StructuredLabeler(unfitted(backend), before, **options)
    labeler.check_options()
    return labeler.set_learned(
        classifier_=fitted,
        backend_=backend,
        label_names_=_label_names(manifest),
        named_=bool(manifest.get("named", False)),
    )


def _try_out(classifier: Any, n_labels: int) -> None:
    """Run a loaded classifier on one node, so that damaged numbers are detected here."""
    classes, n_features = np.asarray(classifier.classes_), classifier.n_features_in_
    classes = integer_array("classes_", classes, ("C",), low=0, high=n_labels)
    if type(n_features) is not int or not 1 <= n_features <= _MOST_FEATURES:
        raise ModelFileError(f"n_features_in_ must be 1 to {_MOST_FEATURES}, got {n_features!r}")
    probabilities = classifier.predict_proba(np.zeros((1, n_features)))
    finite_array("probabilities", probabilities, (1, len(classes)))


CODECS = {
    "place-labeler": _OF_JOINT["places"],
    "trajectory-labeler": _OF_JOINT["steps"],
    "joint-labeler": Codec(_dump_joint, _load_joint),
    "structured-labeler": Codec(_dump_structured, _load_structured),
    "backend": Codec(_dump_backend, _load_backend),
}
"""The codec of each kind of model."""
