"""Building the labelers of a configuration, and its fully resolved form."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

from pgm_places.errors import ConfigError
from pgm_places.experiment.config import ExperimentConfig, MethodConfig, build_features
from pgm_places.inference.backends import METHODS
from pgm_places.labelers.joint_labeler import JointLabeler
from pgm_places.labelers.method import Unary, check_labels_maps
from pgm_places.labelers.place_labeler import PlaceLabeler, PlaceMethod
from pgm_places.labelers.structured_labeler import StructuredLabeler
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.options import option_values, plain_values
from pgm_places.trained import trained_floor


def make_labeler(config: ExperimentConfig) -> PlaceLabeler:
    """The unfitted labeler of maps of a configuration."""
    names, settings = tuple(config.labels.names), config.classifier
    methods = {
        method.id: PlaceMethod(method.backend, _of_maps(method)) for method in config.methods
    }
    labeler = PlaceLabeler(
        names,
        methods,
        sensor=config.sensor,
        classifier=settings.classifier(names),
        connectivity=config.connectivity,
        context_m=tuple(config.context.half_widths_m),
        space=config.space,
        learn_on=settings.learn_on,
        n_folds=settings.n_folds,
        n_node_features=settings.n_node_features,
        max_examples_per_map=settings.max_examples_per_map,
        features=build_features(config),
        halls=config.labels.halls,
        doorway_depth_m=config.labels.doorway_depth_m,
        floor=trained_floor() if any(m.unary == "floor" for m in config.methods) else None,
    )
    labeler.check_options()
    return labeler


def _of_maps(method: MethodConfig) -> Unary:
    assert method.unary != "none"  # checked by ExperimentConfig
    return method.unary


def one_method(config: ExperimentConfig, what: str) -> None:
    """Raise ConfigError for several methods; a stored model of drives or graphs has one."""
    if len(config.methods) > 1:
        ids = ", ".join(method.id for method in config.methods)
        raise ConfigError(
            f"a model of {what} has one method, but the configuration has {ids}; put the one to "
            "train into a separate file ('compare' accepts several)"
        )


def step_methods(config: ExperimentConfig) -> dict[str, object]:
    """The unfitted methods for steps, or for steps and cells, by their ids.

    ConfigError if a method for chains is used for graphs with cycles, or ``unary`` is set.
    """
    methods = {}
    for method in config.methods:
        if method.unary != "auto" and config.nodes == "steps":
            raise ConfigError(f"methods.{method.id}: unary is for cells of maps; remove it")
        methods[method.id] = method.backend
        if config.nodes == "both":
            check_labels_maps(f"method {method.id!r}", methods[method.id])
    return methods


def step_labeler(config: ExperimentConfig) -> TrajectoryLabeler:
    """The unfitted labeler of drives of a configuration."""
    names, steps, settings = tuple(config.labels.names), config.steps, config.classifier
    labeler = TrajectoryLabeler(
        names,
        every_m=steps.every_m,
        loop_m=steps.loop_m,
        beams=steps.beams,
        sensor=replace(config.sensor, max_range_m=steps.max_range_m),
        # The prior is part of the method, which models the frequency of labels on a path.
        classifier=settings.classifier(names, auto_prior=0.0),
        n_folds=settings.n_folds,
        n_runs=steps.n_runs,
        seed=steps.seed,
        features=build_features(config),
    )
    labeler.check_options()
    return labeler


def joint_labeler(config: ExperimentConfig) -> JointLabeler:
    """The unfitted labeler of maps with drives of a configuration."""
    unaries = list(dict.fromkeys(method.unary for method in config.methods))
    if len(unaries) > 1:
        raise ConfigError(f"with nodes = 'both', methods must have one unary, got {unaries}")
    independent = MethodConfig("independent", "independent", {}, unaries[0])
    places = make_labeler(replace(config, methods=(independent,)))
    return JointLabeler(tuple(config.labels.names), places=places, steps=step_labeler(config))


def graph_labelers(config: ExperimentConfig) -> dict[str, StructuredLabeler]:
    """The unfitted labelers of user-defined graphs, by the ids of their methods."""
    settings = config.classifier
    labelers = {}
    for method in config.methods:
        classifier = settings.classifier(config.labels.names) if method.unary != "none" else None
        labelers[method.id] = StructuredLabeler(
            method.backend, classifier, learn_on=settings.learn_on, n_folds=settings.n_folds
        )
        labelers[method.id].check_options()
    return labelers


class GraphMethod(NamedTuple):
    """A method on user-defined graphs, with the node data that it uses."""

    backend: Any
    unary: str


AnyMethod = PlaceMethod | GraphMethod


def resolved_config(config: ExperimentConfig, methods: Mapping[str, AnyMethod]) -> dict[str, Any]:
    """The configuration with all defaults of its methods, as plain data.

    Maps and drives, of which there may be many, have only the keys that are set.
    """
    content: dict[str, Any] = plain_values(config)
    for part in ("train", "test"):
        content[part] = [
            {key: value for key, value in item.items() if value is not None}
            for item in content[part]
        ]
    names = {method.id: method.name for method in config.methods}  # a base model has its own
    content["methods"] = [
        {
            "id": name,
            "name": names.get(name) or METHODS.name_of(type(method.backend)),
            "unary": method.unary,
            **option_values(method.backend),
        }
        for name, method in methods.items()
    ]
    return content
