"""Configuration files: TOML parsed into checked options; unknown keys are rejected.

The options of the sensor, the lists, the methods and the topological maps are declared in their own
modules. This module combines them with the options of files.
"""

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

from pgm_places._checks import plain_names
from pgm_places.errors import ConfigError, nearest_name
from pgm_places.experiment.source_config import (
    SourceConfig,
    SplitConfig,
    StepOptions,
    given_options,
)
from pgm_places.experiment.source_patterns import without_patterns
from pgm_places.features.custom import FEATURES, as_features
from pgm_places.inference.backends import METHODS
from pgm_places.io.input_file import read_toml
from pgm_places.labelers.method import Unary
from pgm_places.labelers.place_labeler import Connectivity
from pgm_places.labelers.presets import Preset, with_preset
from pgm_places.options import OptionError, Options, Positive, check_options, from_mapping
from pgm_places.options.marks import Ge, Le, MinLen
from pgm_places.sensing.sensor import Sensor
from pgm_places.spaces.entered_options import EnteredOptions
from pgm_places.teaching.training_selection import OF_PAINT_ALONE, TeachingOptions
from pgm_places.topology.rules import TopologyOptions
from pgm_places.unary.options import ClassifierOptions, ContextOptions, HallsAs, SpaceOptions

NO_MODEL = "none"
"""Value of ``base_model`` for training on paint alone, as in the studio without a model."""

_OF_MAPS = frozenset(
    ("resolution_m", "connectivity", "sensor", "context", "space", "floor", "steps", "features")
)
"""Options that do not apply to user-defined graphs."""

_OF_TRAINING = _OF_MAPS | {"preset", "nodes", "classifier", "select", "methods"}
"""Options that a base model brings along."""

Nodes = Literal["cells", "steps", "both", "graph"]
Criterion = Literal["balanced_accuracy", "accuracy", "macro_f1"]


@dataclass(frozen=True)
class LabelsConfig:
    """The labels to distinguish, in the order of all tables.

    ``halls`` is the label of halls in results, if ``corridor``, ``room`` and ``hall`` are among the
    labels. ``doorway_depth_m`` is the depth of doorways along the passage, by default as in the
    training maps.
    """

    names: Annotated[tuple[str, ...], MinLen(2)]
    halls: HallsAs = "corridor"
    doorway_depth_m: Positive | None = None

    def __post_init__(self) -> None:
        check_options(self)
        plain_names("names", self.names, ConfigError)


@dataclass(frozen=True)
class FeatureConfig(Options):
    """A custom feature by name, and its options (all other keys)."""

    name: str
    options: dict[str, Any]


@dataclass(frozen=True)
class FloorOptions(Options):
    """Whether the floor networks learn from the training maps.

    Parameters
    ----------
    steps : int
        Steps of 8 pieces for which each shipped network goes on learning, half of the pieces from
        the training maps, half from generated buildings; some hundreds take minutes and need the
        extra ``train``. 0 leaves the networks as they are.
    """

    steps: Annotated[int, Ge(0), Le(100_000)] = 0


@dataclass(frozen=True)
class SelectConfig(Options):
    """Options to choose on held-out buildings, or stripes, of the training data.

    ``options`` lists candidate values by dotted key (``"classifier.n_rounds" = [100, 300]``,
    ``"methods.amn.C" = [10.0, 100.0]``). Every combination is tried with ``method``, by default the
    last one.
    """

    options: Annotated[dict[str, Annotated[list[Any], MinLen(1)]], MinLen(1)]
    method: str | None = None
    criterion: Criterion = "balanced_accuracy"
    n_folds: Annotated[int, Ge(2), Le(50)] = 5


@dataclass(frozen=True)
class MethodConfig:
    """A method by name, its id, its unary, and its options (all other keys).

    ``unary`` is ``"laser"`` (the list on laser features), ``"context"`` (the list with the features
    of the neighbourhood), ``"space"`` (the list with space features), ``"floor"`` (this list fused
    with the shipped floor networks), or ``"auto"``, which is chosen in training for all methods.
    AdaBoost alone, as in the paper, is ``independent`` with ``unary = "laser"``. For user-defined
    graphs, ``"auto"`` is the classifier's scores, and ``"none"`` leaves the node features to the
    method.
    """

    name: str
    id: str
    options: dict[str, Any]
    unary: Unary | Literal["none"] = "auto"

    def __post_init__(self) -> None:
        check_options(self)
        if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.,+=()\[\] -]{0,79}", self.id):
            raise OptionError(
                "id",
                "must be up to 80 letters, digits, spaces and _.,+=()[]-, the first a letter or "
                f"digit, got {self.id!r}",
            )

    @cached_property
    def backend(self) -> Any:
        """The unfitted method, built once; its options are checked."""
        return METHODS.build(self.name, self.options)


@dataclass(frozen=True, kw_only=True)
class ExperimentConfig:
    """A complete experiment: labels, sensor, classifier, maps and drives, and methods.

    ``preset`` names a set of options, which those of the file override
    (:mod:`pgm_places.labelers.presets`); in validated values it is already applied. ``nodes`` is
    the kind of nodes: the cells of maps, the steps of drives, both as one graph, or user-defined
    graphs. With ``base_model``, an existing model is trained further on the training maps with the
    options ``teaching``; its methods and training options do not change. ``splits`` lists buildings
    of ``train`` that ``compare`` tests on, instead of ``test``.
    """

    title: str | None = None
    preset: Preset | None = None
    nodes: Nodes = "cells"
    resolution_m: Positive | None = None
    connectivity: Connectivity = 8
    labels: LabelsConfig
    sensor: Sensor = field(default_factory=Sensor)
    classifier: ClassifierOptions = field(default_factory=ClassifierOptions)
    context: ContextOptions = field(default_factory=ContextOptions)
    space: SpaceOptions = field(default_factory=SpaceOptions)
    floor: FloorOptions = field(default_factory=FloorOptions)
    steps: StepOptions = field(default_factory=StepOptions)
    topology: TopologyOptions = field(default_factory=TopologyOptions)
    entered: EnteredOptions = field(default_factory=EnteredOptions)
    train: Annotated[tuple[SourceConfig, ...], MinLen(1)]
    test: tuple[SourceConfig, ...] = ()
    splits: tuple[SplitConfig, ...] = ()
    features: tuple[FeatureConfig, ...] = ()
    select: SelectConfig | None = None
    methods: tuple[MethodConfig, ...] = ()
    base_model: str | None = None
    teaching: TeachingOptions = field(default_factory=TeachingOptions)

    def __post_init__(self) -> None:
        check_options(self)
        _check_teaching(self)
        _check_label_names(self)
        _check_methods(self)
        _check_nodes(self)
        if self.splits and self.test:
            raise ConfigError("[[splits]] and [[test]] cannot be combined")
        build_features(self)
        for method in self.methods:
            _ = method.backend


def _check_teaching(config: ExperimentConfig) -> None:
    """Reject options that a base model fixes, and options that need a base model."""
    options = given_options(config, _OF_TRAINING)
    if config.base_model is None:
        if not config.methods:
            raise ConfigError("methods: give at least one, as a table [[methods]]")
        if config.teaching != TeachingOptions():
            raise ConfigError(
                "[teaching] has the options of further training and requires base_model"
            )
        return
    options += [f"labels.{x}" for x in given_options(config.labels, {"halls", "doorway_depth_m"})]
    if options:
        raise ConfigError(
            f"{options[0]} is for training from scratch; base_model brings its own, so remove it"
        )
    if config.base_model == NO_MODEL:
        alone = {name: getattr(config.teaching, name) for name in OF_PAINT_ALONE}
        if config.teaching != TeachingOptions(**alone):
            raise ConfigError(
                f"with base_model = {NO_MODEL!r}, [teaching] has only the options "
                f"{' and '.join(OF_PAINT_ALONE)}"
            )


def _check_methods(config: ExperimentConfig) -> None:
    wants = any(method.unary == "context" for method in config.methods)
    if wants and not config.context.half_widths_m:
        raise ConfigError("a method has unary = 'context' but [context] half_widths_m is empty")
    ids = [method.id for method in config.methods]
    if twice := sorted(name for name, count in Counter(ids).items() if count > 1):
        raise ConfigError(f"methods: {', '.join(twice)} repeated; give each its own id")
    if config.select is not None and config.select.method not in (None, *ids):
        raise ConfigError(
            f"select.method: no method {config.select.method!r}. "
            f"{nearest_name(str(config.select.method), ids)}"
        )


def _check_nodes(config: ExperimentConfig) -> None:
    """Reject sources and tables that do not fit the kind of nodes."""
    nodes = config.nodes
    if nodes == "graph":
        _check_graphs(config)
        return
    has_drive = any(source.is_drive for source in config.train)
    if nodes != "cells" and config.select is not None and not has_drive:
        raise ConfigError(
            "[select] evaluates options on held-out training drives; [[train]] has no drive"
        )
    for where, source in _sources(config):
        is_test = where.startswith("test")
        if source.graph is not None:
            raise ConfigError(f"{where} is a graph; write nodes = 'graph' at the top of the file")
        if nodes == "cells" and source.is_drive:
            raise ConfigError(
                f"{where} is a drive, but cells of maps are labelled; write nodes = 'steps' or "
                "nodes = 'both' at the top of the file"
            )
        if nodes != "cells" and is_test and not source.is_drive:
            raise ConfigError(
                f"{where} is a map, but steps of drives are labelled; give a log or a drive"
            )
        if source.counts is not None and nodes == "both":
            raise ConfigError(f"{where}: counts are for nodes = 'steps'; cells of maps have none")
        if source.map_labels is not None and not (is_test and nodes == "steps"):
            raise ConfigError(f"{where}: map_labels is for drives to test on, with nodes = 'steps'")
        if nodes == "both" and source.log is not None and source.map is None:
            raise ConfigError(f"{where}: nodes = 'both' needs the drive's map; add map")
    for method in config.methods:
        if method.unary == "none":
            raise ConfigError(f"methods.{method.id}: unary = 'none' is for nodes = 'graph'")
    if nodes == "steps":
        _check_classifier_of_steps(config.classifier)
    if nodes == "both" and not has_drive:
        raise ConfigError("train: learning cells and steps together needs at least one drive")


def _check_classifier_of_steps(options: ClassifierOptions) -> None:
    """Reject options of the list that are not used for drives."""
    default = ClassifierOptions()
    for name in ("learn_on", "n_node_features", "max_examples_per_map"):
        if getattr(options, name) != getattr(default, name):
            raise ConfigError(
                f"classifier.{name} is for cells of maps, and nodes = 'steps' labels steps of "
                "drives; remove it"
            )


def _check_graphs(config: ExperimentConfig) -> None:
    """Reject sources other than user-defined graphs, and options for maps and drives."""
    for where, item in _sources(config):
        if item.graph is None:
            raise ConfigError(
                f"{where} is not a graph; give graph = 'FILE.graphml', or its tables: "
                "graph = { nodes = 'nodes.csv', edges = 'edges.csv' }"
            )
    if options := given_options(config, _OF_MAPS | {"base_model"}):
        raise ConfigError(
            f"{options[0]} is for maps and drives, not for nodes = 'graph'; remove it"
        )
    for method in config.methods:
        if method.unary not in ("auto", "none"):
            raise ConfigError(
                f"methods.{method.id}: for graphs, unary must be 'auto' (the classifier's scores) "
                f"or 'none', got {method.unary!r}"
            )


def _check_label_names(config: ExperimentConfig) -> None:
    names, order = list(config.labels.names), config.classifier.order
    all_but_one = [sorted(set(names) - {name}) for name in names]
    if isinstance(order, tuple) and sorted(order) not in (sorted(names), *all_but_one):
        raise ConfigError(
            f"classifier.order must name each of {names} once (the last may be left out), "
            f"got {list(order)}"
        )
    for where, item in _sources(config):
        source = item.graph_options if item.graph is not None else item.drive or item
        for code, label in (source.classes or {}).items():
            if label not in ("", *names):  # "" for no label
                raise ConfigError(
                    f"{where}.classes: {code!r} is translated to {label!r}, which is not a label. "
                    f"{nearest_name(label, names)}"
                )


def _sources(config: ExperimentConfig) -> Iterator[tuple[str, SourceConfig]]:
    """The sources of training and test, with their positions in the file."""
    for part, sources in (("train", config.train), ("test", config.test)):
        yield from ((f"{part}[{index}]", source) for index, source in enumerate(sources))


def load_config(path: str | Path, *, preset: str | None = None) -> ExperimentConfig:
    """The checked configuration of a TOML file; ``preset`` overrides the file's preset.

    ConfigError if the file cannot be read, is not TOML, or contains an unknown key, value or
    method.
    """
    path = Path(path)
    content = read_toml(path, ConfigError, "a configuration (TOML)")
    if preset is not None:
        content["preset"] = preset
    return parse_config(without_patterns(content, path.resolve().parent, str(path)), str(path))


def parse_config(content: Mapping[str, Any], where: str = "config") -> ExperimentConfig:
    """The checked configuration from a mapping such as ``tomllib`` returns."""
    content = with_preset(content)
    if "methods" in content:
        content["methods"] = _split(content["methods"], "methods", ("id", "unary"), where)
        for table in content["methods"]:
            table.setdefault("id", str(table["name"]).rpartition(":")[2])  # module:Class
    if "features" in content:
        content["features"] = _split(content["features"], "features", (), where)
    return validated_config(content, where)


def validated_config(content: Mapping[str, object], where: str) -> ExperimentConfig:
    """The checked configuration from a mapping in the form of ``plain_values``."""
    try:
        return from_mapping(ExperimentConfig, content)
    except ConfigError as error:
        raise ConfigError(f"{where}: {error}") from None


def _split(
    tables: object, key: str, own_keys: tuple[str, ...], where: str
) -> list[dict[str, object]]:
    """Tables as records: name, the record's own keys, and all others as options."""
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise ConfigError(f"{where}: {key} must be tables; write [[{key}]] above each")
    split = []
    for index, table in enumerate(tables):
        if "name" not in table:
            raise ConfigError(f"{where}: {key}[{index}] has no name")
        own = {name: table[name] for name in ("name", *own_keys) if name in table}
        options = {name: value for name, value in table.items() if name not in own}
        split.append({**own, "options": options})
    return split


def build_features(config: ExperimentConfig) -> tuple[object, ...]:
    """The custom features of the configuration, built and checked."""
    return as_features([FEATURES.build(table.name, table.options) for table in config.features])
