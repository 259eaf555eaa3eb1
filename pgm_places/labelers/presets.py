"""Presets: the options of the paper, for configurations and for labelers made in Python."""

import copy
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal, NamedTuple, get_args

from pgm_places.errors import ConfigError, nearest_name
from pgm_places.inference.backends import METHODS
from pgm_places.labelers.place_labeler import PlaceLabeler, PlaceMethod
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.sensing.sensor import Sensor, SensorNoise
from pgm_places.unary.options import ClassifierOptions

Preset = Literal["paper", "paper-noise"]

ANY_METHOD = "*"
"""Placeholder for any method's name in a key."""


class _Value(NamedTuple):
    """An option's dotted key, its value, and the kinds of nodes that it applies to."""

    key: str
    value: Any
    nodes: tuple[str, ...]


_CELLS, _DRIVES, _ALL = ("cells",), ("steps", "both"), ("cells", "steps", "both", "graph")
_MAPS = ("cells", "steps", "both")

_PAPER = (
    _Value("classifier.order", "heuristic", _ALL),
    _Value("classifier.prior_weight", 0.0, _ALL),
    _Value("steps.every_m", 0.35, _DRIVES),
    _Value("steps.n_runs", 1000, _DRIVES),
    _Value("methods.*.unary", "laser", ("cells", "both")),
    _Value("methods.relaxation.max_iterations", 10, _ALL),
    _Value("methods.hmm.observation", "hard", _ALL),
    _Value("methods.hmm.evidence_weight", 1.0, _ALL),
    _Value("methods.amn.node_features", "raw", _CELLS),
    _Value("methods.amn.C", 100.0, _ALL),
)
_NOISE = (
    _Value("sensor.noise.sigma_m", 0.05, _MAPS),
    _Value("sensor.noise.p_random", 0.01, _MAPS),
    _Value("sensor.noise.p_max", 0.01, _MAPS),
)
_PRESETS: Mapping[str, tuple[_Value, ...]] = {"paper": _PAPER, "paper-noise": _PAPER + _NOISE}


def preset_values(preset: str, nodes: str = "cells") -> dict[str, Any]:
    """The values of a preset by dotted key; ``methods.*.unary`` applies to every method.

    Options that do not apply to the kind of nodes are omitted. ConfigError for an unknown preset.

    Examples
    --------
    >>> preset_values("paper", "graph")["methods.relaxation.max_iterations"]
    10
    """
    if preset not in _PRESETS:
        raise ConfigError(f"no preset {preset!r}. {nearest_name(preset, get_args(Preset))}")
    return {entry.key: entry.value for entry in _PRESETS[preset] if nodes in entry.nodes}


def preset_place_labeler(
    preset: str,
    label_names: Sequence[str],
    methods: Sequence[str] = ("independent",),
    **options: Any,
) -> PlaceLabeler:
    """An unfitted PlaceLabeler with the options of a preset, overridden by ``options``.

    Raises
    ------
    ConfigError
        No preset or no method has that name.

    Examples
    --------
    >>> labeler = preset_place_labeler("paper", ("corridor", "room"), ["relaxation"])
    >>> labeler.methods["relaxation"].unary, labeler.methods["relaxation"].backend.max_iterations
    ('laser', 10)
    """
    values = preset_values(preset, "cells")
    built = {name: PlaceMethod(_method(values, name), _unary(values)) for name in methods}
    return PlaceLabeler(
        label_names, built, **_shared(values, label_names, PlaceLabeler.sensor) | options
    )


def preset_trajectory_labeler(
    preset: str, label_names: Sequence[str], method: str = "hmm", **options: Any
) -> TrajectoryLabeler:
    """An unfitted TrajectoryLabeler with the options of a preset, overridden by ``options``.

    Raises
    ------
    ConfigError
        No preset or no method has that name.

    Examples
    --------
    >>> labeler = preset_trajectory_labeler("paper", ("corridor", "room"))
    >>> labeler.every_m, labeler.method.observation
    (0.35, 'hard')
    """
    values = preset_values(preset, "steps")
    shared = _shared(values, label_names, TrajectoryLabeler.sensor)
    made = {"method": _method(values, method), **_table(values, "steps"), **shared}
    return TrajectoryLabeler(label_names, **made | options)


def _shared(values: Mapping[str, Any], names: Sequence[str], sensor: Sensor) -> dict[str, Any]:
    """The sensor and the list."""
    listed = ClassifierOptions(**_table(values, "classifier"))
    noise = _table(values, "sensor.noise")
    sensor = replace(sensor, noise=SensorNoise(**noise) if noise else None)
    return {"classifier": listed.classifier(names), "sensor": sensor}


def _table(values: Mapping[str, Any], name: str) -> dict[str, Any]:
    """The options of a table without its name."""
    split_keys = {key.rpartition("."): value for key, value in values.items()}
    return {option: value for (table, _, option), value in split_keys.items() if table == name}


def _method(values: Mapping[str, Any], name: str) -> Any:
    return METHODS.build(name, _table(values, f"methods.{name}"))


def _unary(values: Mapping[str, Any]) -> Any:
    return values[f"methods.{ANY_METHOD}.unary"]


def with_preset(content: Mapping[str, Any]) -> dict[str, Any]:
    """A configuration with the values of its ``preset`` for options that are not set.

    An unknown preset, or one together with a base model, adds nothing: validation rejects it.
    """
    filled = copy.deepcopy(dict(content))
    preset: Any = filled.get("preset")
    if preset in get_args(Preset) and "base_model" not in filled:
        for key, value in preset_values(preset, filled.get("nodes", "cells")).items():
            *path, option = key.split(".")
            for table in _tables(filled, path):
                table.setdefault(option, value)
    return filled


def preset_record(config: Mapping[str, Any]) -> dict[str, Any] | None:
    """The values set by the preset of a resolved configuration, and those set by the user."""
    preset = config.get("preset")
    if preset is None:
        return None
    of_preset, of_user = {}, {}
    for key, wanted in preset_values(preset, config["nodes"]).items():
        *path, option = key.split(".")
        values = [table.get(option) for table in _tables(copy.deepcopy(dict(config)), path)]
        others = [value for value in values if value != wanted]
        if values and len(others) < len(values):
            of_preset[key] = wanted
        if others:
            of_user[key] = others[0] if len(others) == 1 else others
    return {"name": preset, "set": of_preset, "given": of_user}


def _tables(content: dict[str, Any], path: list[str]) -> Iterator[dict[str, Any]]:
    """The tables at a path, created if missing; for methods, all with the name in the path."""
    if path[0] == "methods":
        methods = content.get("methods")
        for method in methods if isinstance(methods, list) else ():
            if isinstance(method, dict) and path[1] in (ANY_METHOD, method.get("name")):
                yield method
        return
    table: Any = content
    for name in path:
        table = table.setdefault(name, {})
        if not isinstance(table, dict):
            return  # validation refuses it
    yield table
