"""Configuration files: TOML in, checked records out; nothing unknown is let through."""

import json
import tomllib
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    model_validator,
)

from pgm_places._checks import nearest_name
from pgm_places.datasets.style import HallsAs, StyleName
from pgm_places.errors import ConfigError
from pgm_places.features.own import FEATURES, as_features
from pgm_places.inference.backends import METHODS

__all__ = [
    "ClassifierConfig",
    "ExperimentConfig",
    "FeatureConfig",
    "LabelsConfig",
    "MapConfig",
    "MethodConfig",
    "SelectConfig",
    "SensorConfig",
    "TopologyConfig",
    "load_config",
    "parse_config",
]

CONTEXT_M = (0.3, 0.75, 1.5, 3.0)
"""Half-widths of the windows of the second list; chosen on training buildings (docs/results)."""

MAX_CONFIG_BYTES = 1_000_000
"""A configuration larger than this is some other file."""

Range = tuple[float | None, float | None]
IndexRange = tuple[int | None, int | None]


def _open_ended(value: Any) -> Any:
    """TOML has no null: the strings ``""`` and ``"end"`` stand for an open end of a window."""
    if isinstance(value, list):
        return tuple(None if item in ("", "end") else item for item in value)
    return value


class _Record(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class LabelsConfig(_Record):
    """The labels to tell apart; their order is the order of every table."""

    names: Annotated[list[str], Field(min_length=2)]

    @model_validator(mode="after")
    def _unique(self) -> Self:
        if len(set(self.names)) != len(self.names):
            raise ValueError(f"names must differ, got {self.names}")
        return self


class MapConfig(_Record):
    """A map, where its labels are, and which part of it to use.

    ``map`` is a map_server YAML file, or ``generated`` the seed of a generated building with its
    labels (corridor, room, doorway; see ``pgm_places.datasets``). ``labels`` is a label image on
    the map image's raster, or ``regions`` a GeoJSON file of polygons in map metres whose property
    ``class`` is translated by ``classes``. ``columns`` and ``rows`` are half-open ranges of image
    columns and rows counted from the left and the top; ``x_m`` and ``y_m`` are ranges in map
    metres; ``half`` is the part of a generated building left or right of the border between its
    wings, ``style``, ``halls``, ``furniture`` and ``slam_noise`` say how it is drawn
    (:func:`pgm_places.datasets.generate_building`). Maps of one ``building`` are held out together;
    by default, parts of the same map are.
    """

    map: str | None = None
    generated: Annotated[int, Field(ge=0)] | None = None
    labels: str | None = None
    regions: str | None = None
    classes: dict[str, str] | None = None
    name: str | None = None
    building: str | None = None
    half: Literal["left", "right"] | None = None
    style: StyleName | None = None
    halls: HallsAs | None = None
    furniture: bool | None = None
    slam_noise: bool | None = None
    columns: Annotated[IndexRange | None, BeforeValidator(_open_ended)] = None
    rows: Annotated[IndexRange | None, BeforeValidator(_open_ended)] = None
    x_m: Annotated[Range | None, BeforeValidator(_open_ended)] = None
    y_m: Annotated[Range | None, BeforeValidator(_open_ended)] = None
    unknown_value: Annotated[int, Field(ge=0, le=255)] | None = None
    compat: Literal["nav2", "ros1"] = "nav2"

    @model_validator(mode="after")
    def _one_source_of_labels(self) -> Self:
        if (self.map is None) == (self.generated is None):
            raise ValueError("give map (a YAML file) or generated (a seed), one of them")
        if self.generated is not None:
            if self.labels is not None or self.regions is not None:
                raise ValueError("a generated building brings its own labels; drop labels, regions")
        elif self.half is not None:
            raise ValueError("half is for generated buildings; give columns or x_m of a map")
        elif self.drawn:
            raise ValueError(f"{', '.join(self.drawn)}: for generated buildings only")
        elif (self.labels is None) == (self.regions is None):
            raise ValueError("give labels (an image) or regions (a GeoJSON file), one of them")
        if self.classes is not None and self.regions is None:
            raise ValueError("classes translates the classes of regions; there are no regions")
        return self

    @property
    def drawn(self) -> dict[str, Any]:
        """How to draw a generated building, where it is not the default."""
        named = {
            "style": self.style,
            "halls": self.halls,
            "furniture": self.furniture,
            "slam_noise": self.slam_noise,
        }
        return {key: value for key, value in named.items() if value is not None}


class NoiseConfig(_Record):
    """The noise of a real sensor (paper section 7)."""

    sigma_m: Annotated[float, Field(ge=0)] = 0.0
    p_random: Annotated[float, Field(ge=0, le=1)] = 0.0
    p_max: Annotated[float, Field(ge=0, le=1)] = 0.0
    seed: Annotated[int, Field(ge=0)] = 0


class SensorConfig(_Record):
    """The simulated range sensor."""

    n_beams: Annotated[int, Field(ge=3, le=3600)] = 360
    max_range_m: Annotated[float, Field(gt=0)] = 30.0
    stop_at_unknown: bool = True
    noise: NoiseConfig | None = None


class ClassifierConfig(_Record):
    """The boosted decision list that gives every cell its unary potential.

    ``order`` is ``"rarest-first"``, ``"heuristic"`` (the paper's), ``"exhaustive"`` or a list of
    label names. ``learn_on`` says which scores the structured methods learn from: those of cells
    the list was trained on (``"in-sample"``), or of cells held out (``"out-of-fold"``): whole
    buildings where there are several, contiguous blocks of the only one else. ``prior_weight``
    says how far z follows the frequencies of the labels in training, and
    ``max_examples_per_map`` how many cells of a map the lists are trained on at most.
    """

    n_rounds: Annotated[int, Field(ge=1, le=100_000)] = 100
    order: Literal["rarest-first", "heuristic", "exhaustive"] | list[str] = "rarest-first"
    decision: Literal["list", "argmax"] = "list"
    calibration: Literal["none", "platt"] = "none"
    prior_weight: Annotated[float, Field(ge=0, le=2)] = 0.5
    max_examples_per_map: Annotated[int, Field(ge=100)] | None = None
    learn_on: Literal["in-sample", "out-of-fold"] = "out-of-fold"
    n_folds: Annotated[int, Field(ge=2, le=50)] = 5
    node_features: Annotated[int, Field(ge=1, le=321)] = 30


class ContextConfig(_Record):
    """The second list, which also sees the mean scores in windows around each cell.

    It serves the methods with ``unary = "context"``; an empty list does without it.
    """

    half_widths_m: list[Annotated[float, Field(gt=0)]] = list(CONTEXT_M)


class TopologyConfig(_Record):
    """When a region of a labelled map is taken for an error (paper section 6.2).

    Rooms and corridors below ``min_area_m2``, doorways below ``min_doorway_area_m2``, and, where
    ``doorways_join_two``, doorways that touch fewer than two regions take a neighbour's label.
    Passages narrower than ``min_width_m`` connect nothing. The other widths are those of
    corrections that are not the paper's; 0 leaves one out.
    """

    correct: bool = True
    min_area_m2: Annotated[float, Field(ge=0)] = 1.0
    min_doorway_area_m2: Annotated[float, Field(ge=0)] = 0.1
    doorways_join_two: bool = True
    doorway_label: str = "doorway"
    min_width_m: Annotated[float, Field(ge=0)] = 0.0
    widest_doorway_m: Annotated[float, Field(ge=0)] = 0.0
    close_leaks_m: Annotated[float, Field(ge=0)] = 0.0
    split_rooms_m: Annotated[float, Field(ge=0)] = 0.0
    min_part_m2: Annotated[float, Field(ge=0)] = 4.0


class FeatureConfig(_Record):
    """A feature of one's own by name, and its options (all other keys)."""

    name: str
    options: dict[str, Any]


class SelectConfig(_Record):
    """Options to choose on the training maps, whole buildings or contiguous blocks held out.

    ``options`` lists values by dotted key (``"classifier.n_rounds" = [100, 300]``,
    ``"methods.amn.C" = [10.0, 100.0]``); every combination is tried with ``method``, by default
    the last one.
    """

    options: Annotated[dict[str, Annotated[list[Any], Field(min_length=1)]], Field(min_length=1)]
    method: str | None = None
    criterion: Literal["balanced_accuracy", "accuracy", "macro_f1"] = "balanced_accuracy"
    n_folds: Annotated[int, Field(ge=2, le=50)] = 5


class MethodConfig(_Record):
    """A method by name, what to call it, which unary it gets, and its options (all other keys).

    ``unary`` is ``"laser"`` (the list on laser features alone), ``"context"`` (the list that also
    sees its neighbourhood), or ``"auto"``: laser for ``independent``, which is AdaBoost alone, and
    context for all other methods, where there is one.
    """

    name: str
    id: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.+ -]{0,79}$")]
    unary: Literal["auto", "laser", "context"] = "auto"
    options: dict[str, Any]


class ExperimentConfig(_Record):
    """A whole experiment: labels, sensor, classifier, maps and methods."""

    title: str | None = None
    resolution_m: Annotated[float, Field(gt=0)] | None = None
    connectivity: Literal[4, 8] = 8
    labels: LabelsConfig
    sensor: SensorConfig = SensorConfig()
    classifier: ClassifierConfig = ClassifierConfig()
    context: ContextConfig = ContextConfig()
    topology: TopologyConfig = TopologyConfig()
    train: Annotated[list[MapConfig], Field(min_length=1)]
    test: list[MapConfig] = []
    features: list[FeatureConfig] = []
    select: SelectConfig | None = None
    methods: Annotated[list[MethodConfig], Field(min_length=1)]

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        _check_label_names(self)
        wants = any(method.unary == "context" for method in self.methods)
        if wants and not self.context.half_widths_m:
            raise ValueError("a method has unary = 'context' but [context] half_widths_m is empty")
        ids = [method.id for method in self.methods]
        twice = sorted({name for name in ids if ids.count(name) > 1})
        if twice:
            raise ValueError(
                f"methods: {', '.join(twice)} comes more than once; give each its own id"
            )
        if self.select is not None and self.select.method not in (None, *ids):
            raise ValueError(
                f"select.method: no method {self.select.method!r}. "
                f"{nearest_name(str(self.select.method), ids)}"
            )
        return self


def _check_label_names(config: ExperimentConfig) -> None:
    names = config.labels.names
    order = config.classifier.order
    if isinstance(order, list) and sorted(order) not in (sorted(names), *_all_but_one(names)):
        raise ValueError(
            f"classifier.order must name each of {names} once (the last may be left out), "
            f"got {order}"
        )
    for part, maps in (("train", config.train), ("test", config.test)):
        for index, item in enumerate(maps):
            for code, label in (item.classes or {}).items():
                if label not in names:
                    raise ValueError(
                        f"{part}[{index}].classes: {code!r} is translated to {label!r}, which is "
                        f"no label. {nearest_name(label, names)}"
                    )


def _all_but_one(names: list[str]) -> list[list[str]]:
    return [sorted(set(names) - {name}) for name in names]


def load_config(path: Path) -> ExperimentConfig:
    """The checked configuration in a TOML file.

    Raises
    ------
    ConfigError
        The file is missing, is not TOML, or holds a key, a value or a method that is not known.
    """
    try:
        if path.stat().st_size > MAX_CONFIG_BYTES:
            raise ConfigError(f"{path} is larger than {MAX_CONFIG_BYTES} bytes; is it a config?")
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ConfigError(f"no configuration file at {path}") from None
    except OSError as error:
        raise ConfigError(f"cannot read {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ConfigError(f"{path} is not UTF-8 text; is it a TOML file?") from None
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path} is not valid TOML: {error}") from None
    return parse_config(content, str(path))


def parse_config(content: Mapping[str, Any], where: str = "config") -> ExperimentConfig:
    """The checked configuration from a mapping such as ``tomllib`` returns."""
    content = dict(content)
    if "methods" in content:
        content["methods"] = _split(content["methods"], "methods", ("id", "unary"), where)
        for item in content["methods"]:
            item.setdefault("id", item["name"])
    if "features" in content:
        content["features"] = _split(content["features"], "features", (), where)
    return validated_config(content, where)


def validated_config(content: Mapping[str, Any], where: str) -> ExperimentConfig:
    """The checked configuration from a mapping in the records' own form, options apart."""
    try:
        # JSON mode keeps strictness (no "50" for 50) but lets a list be a pair.
        config = ExperimentConfig.model_validate_json(json.dumps(content, default=str))
    except ValidationError as error:
        raise ConfigError(f"{where}: {_first_problem(error)}") from None
    try:
        build_features(config)
        for method in config.methods:
            build_method(method)
    except ConfigError as error:
        raise ConfigError(f"{where}: {error}") from None
    return config


def _split(tables: Any, key: str, own_keys: tuple[str, ...], where: str) -> list[dict[str, Any]]:
    """Tables as records: name, the keys that are the record's own, and all others as options."""
    if not isinstance(tables, list) or not all(isinstance(item, dict) for item in tables):
        raise ConfigError(f"{where}: {key} must be tables; write [[{key}]] above each")
    split = []
    for index, item in enumerate(tables):
        if "name" not in item:
            raise ConfigError(f"{where}: {key}[{index}] has no name")
        own = {name: item[name] for name in ("name", *own_keys) if name in item}
        options = {name: value for name, value in item.items() if name not in own}
        split.append({**own, "options": options})
    return split


def build_method(method: MethodConfig) -> Any:
    """The backend that a method's table describes; names, types and values are checked."""
    return METHODS.build(method.name, method.options)


def build_features(config: ExperimentConfig) -> tuple[Any, ...]:
    """The features of one's own that the tables describe, checked in the same way."""
    return as_features([FEATURES.build(item.name, item.options) for item in config.features])


def _first_problem(error: ValidationError) -> str:
    """One problem in the reader's words: where, what was wanted, what came."""
    problems = error.errors()
    first = next((p for p in problems if p["type"] == "extra_forbidden"), problems[0])
    place = _place(first["loc"])
    if first["type"] == "extra_forbidden":
        known = _known_keys(first["loc"][:-1])
        return f"unknown key {place!r}. {nearest_name(str(first['loc'][-1]), known)}"
    if first["type"] == "missing":
        return f"{place!r} is missing"
    message = first["msg"].removeprefix("Value error, ")
    got = first.get("input")
    shown = "" if isinstance(got, dict) or first["type"] == "value_error" else f", got {got!r}"
    return f"{place}: {message}{shown}" if place else f"{message}{shown}"


def _place(location: tuple[int | str, ...]) -> str:
    text = ""
    for part in location:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text


def _known_keys(location: tuple[int | str, ...]) -> list[str]:
    """The keys of the record at a location of the configuration."""
    record: type[BaseModel] | None = ExperimentConfig
    for part in location:
        if isinstance(part, str) and record is not None and part in record.model_fields:
            record = _record_in(record.model_fields[part].annotation)
    return [] if record is None else list(record.model_fields)


def _record_in(annotation: Any) -> type[BaseModel] | None:
    """The first record in a type such as ``list[MapConfig] | None``."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for inner in typing.get_args(annotation):
        found = _record_in(inner)
        if found is not None:
            return found
    return None
