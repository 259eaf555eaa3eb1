"""The same experiment with other seeds: everything that is drawn while learning is drawn anew."""

from typing import Any

from pgm_places.experiment.config import ExperimentConfig, build_method
from pgm_places.experiment.config_changes import changed_config
from pgm_places.options import option_values


def seeded_config(config: ExperimentConfig, seed: int) -> ExperimentConfig:
    """The configuration with this seed wherever learning draws something.

    These are the features offered to each tree and the examples taken where there are more
    (``classifier.seed``, ``space.seed``), the simulated runs in maps (``steps.seed``), the cells of
    a lesson (``teaching.seed``), and the ``seed`` of methods that have one. What is tested, and
    drives and maps that are simulated, stay what they are.

    Examples
    --------
    >>> from pgm_places.experiment.config import parse_config
    >>> config = parse_config(
    ...     {
    ...         "labels": {"names": ["corridor", "room"]},
    ...         "train": [{"generated": 1}],
    ...         "methods": [{"name": "relaxation"}],
    ...     }
    ... )
    >>> changed = seeded_config(config, 5)
    >>> changed.classifier.seed, changed.space.seed
    (5, 5)
    """
    if config.base_model is not None:
        return changed_config(config, {"teaching.seed": seed})
    changes: dict[str, Any] = {"classifier.seed": seed}
    if config.nodes in ("cells", "both"):
        changes["space.seed"] = seed
    if config.nodes in ("steps", "both"):
        changes["steps.seed"] = seed
    for method in config.methods:
        if "seed" in option_values(build_method(method)):
            changes[f"methods.{method.id}.seed"] = seed
    return changed_config(config, changes)
