"""Variants of a configuration: changed values, or another seed."""

from collections.abc import Mapping
from typing import Any

from pgm_places.errors import ConfigError, nearest_name
from pgm_places.experiment.config import ExperimentConfig, validated_config
from pgm_places.options import option_values, plain_values


def changed_config(config: ExperimentConfig, changes: Mapping[str, object]) -> ExperimentConfig:
    """The configuration with values replaced by dotted keys, checked like a file.

    Keys are those of the file, such as ``"classifier.n_rounds"`` or ``"train"``; an option of a
    method has the method's id: ``"methods.amn.C"``. ConfigError if a key does not exist, or a value
    does not fit it.

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
    >>> changed = changed_config(config, {"methods.relaxation.max_iterations": 5})
    >>> changed.methods[0].options
    {'max_iterations': 5}
    """
    content = plain_values(config)
    for key, value in changes.items():
        _replace(content, key, value)
    return validated_config(content, "changed configuration")


def _replace(content: dict[str, Any], key: str, value: Any) -> None:
    table, _, rest = key.partition(".")
    if table == "preset":
        raise ConfigError("a preset is merged when the file is read; write it into the file")
    if table == "methods" and rest:
        name, _, option = rest.rpartition(".")
        methods = {method["id"]: method for method in content["methods"]}
        if name not in methods:
            raise ConfigError(
                f"{key!r} must be methods.ID.OPTION with the id of a method. "
                f"{nearest_name(name, list(methods))}"
            )
        target = methods[name] if option == "unary" else methods[name]["options"]
        target[option] = value
        return
    if table not in content:
        raise ConfigError(f"no key {key!r} to change. {nearest_name(table, list(content))}")
    if not rest:
        content[table] = value
    elif isinstance(content[table], dict):
        content[table][rest] = value
    else:
        raise ConfigError(f"no key {key!r} to change: {table!r} has no parts")


def seeded_config(config: ExperimentConfig, seed: int) -> ExperimentConfig:
    """The configuration with another seed for all random choices in training.

    It is used for the features of each tree and for subsampled examples (``classifier.seed``,
    ``space.seed``), simulated runs in maps (``steps.seed``), cells for further training
    (``teaching.seed``), and methods with an option ``seed``. Test data, simulated drives and
    simulated maps do not change.
    """
    if config.base_model is not None:
        return changed_config(config, {"teaching.seed": seed})
    changes: dict[str, object] = {"classifier.seed": seed}
    if config.nodes in ("cells", "both"):
        changes["space.seed"] = seed
    if config.nodes in ("steps", "both"):
        changes["steps.seed"] = seed
    for method in config.methods:
        if "seed" in option_values(method.backend):
            changes[f"methods.{method.id}.seed"] = seed
    return changed_config(config, changes)
