"""The labeler that a configuration describes, and the fully resolved configuration."""

from typing import Any

from pgm_places.experiment.config import (
    ExperimentConfig,
    build_features,
    build_method,
)
from pgm_places.labelers.place_labeler import PlaceLabeler, PlaceMethod
from pgm_places.options import option_values, plain_values

__all__ = ["make_labeler", "resolved_config"]


def make_labeler(config: ExperimentConfig) -> PlaceLabeler:
    """The unfitted labeler that a configuration describes."""
    names, settings = tuple(config.labels.names), config.classifier
    context_m = tuple(config.context.half_widths_m)
    methods = {
        method.id: PlaceMethod(build_method(method), method.unary) for method in config.methods
    }
    labeler = PlaceLabeler(
        names,
        methods,
        sensor=config.sensor,
        classifier=settings.classifier(names),
        connectivity=config.connectivity,
        context_m=context_m,
        space=config.space,
        learn_on=settings.learn_on,
        n_folds=settings.n_folds,
        n_node_features=settings.n_node_features,
        max_examples_per_map=settings.max_examples_per_map,
        features=build_features(config),
    )
    labeler.check_options()
    return labeler


def resolved_config(config: ExperimentConfig, labeler: PlaceLabeler) -> dict[str, Any]:
    """The configuration with every default written out, as plain data."""
    content: dict[str, Any] = plain_values(config)
    content["methods"] = [
        {
            "id": method.id,
            "name": method.name,
            "unary": labeler.methods_[method.id].unary,
            **option_values(labeler.methods_[method.id].backend),
        }
        for method in config.methods
    ]
    return content
