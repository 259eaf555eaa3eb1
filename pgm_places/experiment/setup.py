"""The labeler that a configuration describes, and the configuration that a labeler resolves."""

from typing import Any

from pgm_places.experiment.config import (
    ExperimentConfig,
    MethodConfig,
    build_features,
    build_method,
)
from pgm_places.labelers.place_labeler import PlaceLabeler, PlaceMethod
from pgm_places.options import option_values
from pgm_places.sensing.sensor import Sensor, SensorNoise

__all__ = ["make_labeler", "resolved_config", "resolved_unary"]


def make_labeler(config: ExperimentConfig) -> PlaceLabeler:
    """The unfitted labeler that a configuration describes."""
    from pgm_places.models.decision_list import DecisionListClassifier

    names = tuple(config.labels.names)
    noise = config.sensor.noise
    sensor = Sensor(
        n_beams=config.sensor.n_beams,
        max_range_m=config.sensor.max_range_m,
        stop_at_unknown=config.sensor.stop_at_unknown,
        noise=None if noise is None else SensorNoise(**noise.model_dump()),
    )
    settings = config.classifier
    order: Any = settings.order
    if isinstance(order, list):
        rest = [name for name in names if name not in order]
        order = [names.index(name) for name in (*order, *rest)]
    classifier = DecisionListClassifier(
        n_rounds=settings.n_rounds,
        order=order,
        decision=settings.decision,
        calibration=settings.calibration,
        prior_weight=settings.prior_weight,
    )
    context_m = tuple(config.context.half_widths_m)
    methods = {
        method.id: PlaceMethod(build_method(method), resolved_unary(method, bool(context_m)))
        for method in config.methods
    }
    if all(method.unary == "laser" for method in methods.values()):
        context_m = ()  # nobody asks for it
    return PlaceLabeler(
        names,
        methods,
        sensor,
        classifier,
        config.connectivity,
        context_m,
        settings.learn_on,
        settings.n_folds,
        settings.node_features,
        settings.max_examples_per_map,
        build_features(config),
    )


def resolved_unary(method: MethodConfig, has_context: bool) -> str:
    """Which unary a method gets: AdaBoost alone stays the paper's, structure takes context."""
    if method.unary != "auto":
        return method.unary
    return "context" if has_context and method.name != "independent" else "laser"


def resolved_config(config: ExperimentConfig, labeler: PlaceLabeler) -> dict[str, Any]:
    """The configuration with every default written out, as plain data."""
    content: dict[str, Any] = config.model_dump(mode="json")
    content["methods"] = [
        {
            "id": method.id,
            "name": method.name,
            "unary": labeler.methods[method.id].unary,
            **option_values(labeler.methods[method.id].backend),
        }
        for method in config.methods
    ]
    return content
