"""Configuration of training and test data: maps, drives, graphs and splits."""

import dataclasses
from collections.abc import Set
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from pgm_places.errors import ConfigError
from pgm_places.labelers.trajectory_labeler import REACH_M
from pgm_places.options import (
    AtLeastZero,
    Options,
    Positive,
    Seed,
    UnknownGrey,
    Whole,
    check_options,
)
from pgm_places.options.marks import Ge, MinLen
from pgm_places.sensing.simulated_moves import N_RUNS
from pgm_places.simulation.map_simulation import MapSimulation
from pgm_places.simulation.robot_options import LaserOptions, RobotMotion
from pgm_places.simulation.style import StyleName
from pgm_places.trajectories.similarity import Similarity
from pgm_places.unary.options import HallsAs
from pgm_places.unary.scan_model import BeamOptions

# TOML has no null: the strings ``""`` and ``"end"`` stand for an open end of a window.
OpenEnd = Literal["", "end"] | None

Range = tuple[float | OpenEnd, float | OpenEnd]
IndexRange = tuple[int | OpenEnd, int | OpenEnd]


@dataclass(frozen=True, kw_only=True)
class MapConfig:
    """A map, its labels, and the part of it to use.

    ``map`` is a map_server YAML file, or ``generated`` the seed of a generated building with its
    labels (corridor, room, doorway; see ``pgm_places.simulation``). ``labels`` is a label image on
    the map image's raster, or ``regions`` a GeoJSON file of polygons in map metres with a property
    ``class``. ``classes`` translates the names of either; other names have no label.
    ``corrections``, a label image or GeoJSON of polygons and lines with the configuration's labels,
    overrides these labels; it may also be the only source of labels.
    ``columns`` and ``rows`` are half-open ranges of image columns and rows counted from the left
    and the top; ``x_m`` and ``y_m`` are ranges in map metres; ``half`` is the part of a generated
    building left or right of the border between its wings; ``style``, ``halls``, ``furniture`` and
    ``slam_noise`` are options of :func:`pgm_places.simulation.generate_building`.
    ``simulated`` is a seed: the map is replaced by a simulated robot map with the options
    ``simulation`` (:func:`pgm_places.simulation.simulate_map`). Maps of one ``building`` are held
    out together; by default, so are parts of the same map and maps simulated from it. ``domain``
    names the origin of maps, such as "drawn" or "simulated": with several domains, the list with
    space features is the mean of lists that are each trained without one of them.
    """

    map: str | None = None
    generated: Annotated[int, Ge(0)] | None = None
    labels: str | None = None
    regions: str | None = None
    classes: dict[str, str] | None = None
    corrections: str | None = None
    name: str | None = None
    building: str | None = None
    domain: str | None = None
    half: Literal["left", "right"] | None = None
    style: StyleName | None = None
    halls: HallsAs | None = None
    furniture: bool | None = None
    slam_noise: bool | None = None
    simulated: Annotated[int, Ge(0)] | None = None
    simulation: MapSimulation | None = None
    columns: IndexRange | None = None
    rows: IndexRange | None = None
    x_m: Range | None = None
    y_m: Range | None = None
    unknown_value: UnknownGrey | None = None
    compat: Literal["nav2", "ros1"] = "nav2"

    def __post_init__(self) -> None:
        check_options(self)
        self._check_map()

    def _check_map(self) -> None:
        if (self.map is None) == (self.generated is None):
            raise ConfigError("either map (a YAML file) or generated (a seed) is required")
        if self.generated is not None:
            if not (self.labels is self.regions is self.corrections is None):
                raise ConfigError(
                    "a generated building has its own labels; remove labels, regions and "
                    "corrections"
                )
        elif self.half is not None:
            raise ConfigError("half is for generated buildings; use columns or x_m for a map")
        elif self.drawn:
            raise ConfigError(f"{', '.join(self.drawn)}: for generated buildings only")
        elif None not in (self.labels, self.regions) or (
            self.labels is self.regions is self.corrections is None
        ):
            raise ConfigError(
                "either labels (an image), regions (a GeoJSON file) or corrections is required"
            )
        if self.classes is not None and self.generated is not None:
            raise ConfigError("classes requires labels or regions, whose names it translates")
        if self.simulation is not None and self.simulated is None:
            raise ConfigError("simulation requires simulated (a seed)")

    @property
    def window(self) -> dict[str, tuple[Any, ...]]:
        """The limits of the window by axis; None for an open end."""
        limits = {name: getattr(self, name) for name in ("columns", "rows", "x_m", "y_m")}
        return {
            name: tuple(None if isinstance(end, str) else end for end in ends)
            for name, ends in limits.items()
            if ends is not None
        }

    @property
    def drawn(self) -> dict[str, Any]:
        """The options of a generated building that are not at their defaults."""
        names = ("style", "halls", "furniture", "slam_noise")
        return {name: value for name in names if (value := getattr(self, name)) is not None}


@dataclass(frozen=True, kw_only=True)
class StepOptions(Options):
    """Options of the observations and edges of drives.

    Parameters
    ----------
    every_m : float or "auto"
        Distance between two updates in metres; ``"auto"`` is chosen for hidden Markov models on
        held-out parts of the training drives, and 0.1 for other methods.
    loop_m : float
        Link passes of the same spot within this distance (m); 0 for a chain. Methods for chains
        ignore the links.
    max_range_m : float
        Range of the completed scans.
    n_runs, seed : int
        Simulated runs in maps, from which the hidden Markov model learns its transitions.
    beams : BeamOptions
        How to complete scans of less than a full circle.
    """

    every_m: AtLeastZero | Literal["auto"] = "auto"
    loop_m: AtLeastZero = 0.0
    max_range_m: Positive = REACH_M
    n_runs: Whole = N_RUNS
    seed: Seed = 0
    beams: BeamOptions = field(default_factory=BeamOptions)


WITHIN_S = 5.0
"""Longest time between a step and its counts of objects, by default."""


@dataclass(frozen=True, kw_only=True)
class GraphConfig:
    """A graph with the true labels of its nodes, for ``nodes = "graph"``.

    Parameters
    ----------
    file : str, optional
        A GraphML file; attributes of nodes and of edges are the columns of two tables.
    nodes, edges : str, optional
        The two tables as CSV or Parquet: a row per node, and a row per edge. Without edges, nodes
        are isolated.
    node : str
        Column with the names of nodes.
    ends : (str, str)
        Columns with the names of an edge's nodes.
    label : str
        Column of true labels, empty where unknown.
    classes : mapping, optional
        From the values of that column to label names; other values have no label.
    known : str, optional
        Column of observed labels, which are input of the methods and not evaluated.
    features : list of str, optional
        Columns of node features; by default all other numeric columns.
    edge_features : list of str, optional
        Columns of edge features; by default all other numeric columns.
    probabilities : list of str, optional
        Columns of the label probabilities by the user's classifier, in the order of the labels;
        they replace the configuration's classifier.
    positions : (str, str), optional
        Columns of x and y, for pictures and for folds of adjacent nodes.
    """

    file: str | None = None
    nodes: str | None = None
    edges: str | None = None
    node: str = "node"
    ends: tuple[str, str] = ("source", "target")
    label: str = "label"
    classes: dict[str, str] | None = None
    known: str | None = None
    features: tuple[str, ...] | None = None
    edge_features: tuple[str, ...] | None = None
    probabilities: tuple[str, ...] | None = None
    positions: tuple[str, str] | None = None

    def __post_init__(self) -> None:
        check_options(self)
        if (self.file is None) == (self.nodes is None):
            raise ConfigError("give either file (GraphML) or nodes (a table)")
        if self.file is not None and self.edges is not None:
            raise ConfigError("edges requires nodes (a table); a GraphML file has its own edges")

    @property
    def other_columns(self) -> tuple[str, ...]:
        """The columns of nodes that are not features."""
        named = (self.node, self.label, *(self.probabilities or ()), *(self.positions or ()))
        return named if self.known is None else (*named, self.known)


@dataclass(frozen=True, kw_only=True)
class SplitConfig:
    """Test and training buildings among those of ``[[train]]``.

    Parameters
    ----------
    test : list of str
        Buildings to test on.
    train : list of str, optional
        Buildings to train on; by default all others.
    name : str, optional
        Its name in tables; by default the test buildings.
    """

    test: Annotated[tuple[str, ...], MinLen(1)]
    train: Annotated[tuple[str, ...], MinLen(1)] | None = None
    name: str | None = None

    def __post_init__(self) -> None:
        check_options(self)
        both = [name for name in self.test if name in (self.train or ())]
        if both:
            raise ConfigError(
                f"splits: {both[0]!r} is in both train and test of a split; train and test on "
                "different buildings"
            )


@dataclass(frozen=True, kw_only=True)
class DriveConfig(MapConfig, RobotMotion):
    """A simulated robot's tour of a labelled map.

    The options of the map are those of :class:`MapConfig`. The robot visits
    every place that it fits into (:class:`pgm_places.simulation.simulated_robot.SimulatedRobot`).

    Parameters
    ----------
    seed : int
        Seed of the robot's starting point.
    length_m : float, optional
        Length of the drive; by default, far enough to pass every place.
    spacing_m : float
        Largest distance of any place from the nearest stop of the drive.
    laser : LaserOptions
        The robot's laser.
    """

    seed: Seed = 0
    length_m: Positive | None = None
    spacing_m: Positive = 3.0
    laser: LaserOptions = field(default_factory=LaserOptions)


@dataclass(frozen=True, kw_only=True)
class SourceConfig(MapConfig):
    """A map, a drive (recorded in a log, or simulated), or a user-defined graph.

    For a log, ``map`` with ``labels`` or ``regions`` is a map in the frame of the log. It has the
    true label of each step, unless ``truth`` or the log has it. Options that do not apply are
    errors.

    Parameters
    ----------
    log : str, optional
        A CARMEN log, a bag, or a table of poses.
    drive : DriveConfig, optional
        A simulated drive.
    graph : str or GraphConfig, optional
        A GraphML file, or the files and columns of a graph.
    truth : str, optional
        A table of true labels with one row per step of the log.
    label_column : str, optional
        Column of labels in ``truth`` or in the log's table; ``classes`` translates them.
    frame : Similarity, optional
        From the log's frame to the map's.
    counts : str, optional
        Object counts of a camera along the log, CSV or JSON: additional feature columns of its
        steps. All drives must have counts, and there must be no training maps.
    counts_within_s : float
        Longest time between a step and its counts.
    range_max_m : float, optional
        Readings of this range or more count as no return.
    laser : LaserOptions, optional
        Replace the log's scans by simulated scans of this laser in the map.
    resample_m : float, optional
        Interpolate positions at this spacing on straight lines between recorded ones; for logs
        without scans.
    from_step, to_step : int, optional
        The half-open range of the log's steps to use.
    map_labels : str, optional
        Folder written by ``pgm-places label`` for the map of this drive; its labels are an
        additional observation, not the truth. For test drives only.
    region : (float, float, float, float), optional
        Evaluate only steps in this rectangle: minimum x and y, then maximum, in metres. The robot
        is also tracked outside.
    """

    log: str | None = None
    drive: DriveConfig | None = None
    graph: str | GraphConfig | None = None
    truth: str | None = None
    label_column: str | None = None
    frame: Similarity | None = None
    counts: str | None = None
    counts_within_s: AtLeastZero = WITHIN_S
    range_max_m: Positive | None = None
    laser: LaserOptions | None = None
    resample_m: Positive | None = None
    from_step: Annotated[int, Ge(0)] | None = None
    to_step: Annotated[int, Ge(0)] | None = None
    region: tuple[float, float, float, float] | None = None
    map_labels: str | None = None

    @property
    def is_drive(self) -> bool:
        """Whether it is a drive, with or without a map, rather than a map alone."""
        return self.log is not None or self.drive is not None

    @property
    def graph_options(self) -> GraphConfig:
        """The graph, for a source that is one."""
        assert self.graph is not None
        return GraphConfig(file=self.graph) if isinstance(self.graph, str) else self.graph

    def __post_init__(self) -> None:
        check_options(self)
        if self.graph is not None:
            of_others = _OF_LOGS | _OF_MAPS | {"log", "drive"}
            self._refuse(
                of_others, "graph", "put it into graph = {...}, if it is an option of graphs"
            )
            return
        if self.log is not None and self.drive is not None:
            raise ConfigError("log (a file) and drive (a simulated one) cannot be combined")
        if self.region is not None:
            low_x, low_y, high_x, high_y = self.region
            if not (low_x < high_x and low_y < high_y):
                raise ConfigError(
                    "region must be the minimum x and y and then the maximum, in metres, got "
                    f"{list(self.region)}"
                )
        if self.drive is not None:
            of_others = _OF_LOGS - {"region", "map_labels"} | _OF_MAPS
            self._refuse(of_others, "drive", "put it into drive = {...}")
        elif self.log is None:
            self._refuse(_OF_LOGS, "map", "it is for logs")
            self._check_map()
        else:
            self._check_log()

    def _check_log(self) -> None:
        self._refuse(_DRAWN, "log", "it is for generated buildings")
        if self.map is None and (self.labels is not None or self.regions is not None):
            raise ConfigError(
                "labels and regions are on the raster or in the frame of a map; add map"
            )
        if self.labels is not None and self.regions is not None:
            raise ConfigError("labels (an image) and regions (GeoJSON) cannot be combined")
        if self.counts is None and self.counts_within_s != WITHIN_S:
            raise ConfigError("counts_within_s requires counts (CSV or JSON)")
        if self.laser is not None and self.map is None:
            raise ConfigError("laser simulates scans in a map and requires map")

    def _refuse(self, names: Set[str], beside: str, what: str) -> None:
        if refused := given_options(self, names):
            raise ConfigError(f"{refused[0]} does not apply to {beside}: {what}")


def given_options(options: Any, names: Set[str]) -> list[str]:
    """The names of options with another value than the default, in the order of the fields."""
    changed = []
    for option in dataclasses.fields(options):
        factory = option.default_factory
        default = option.default if factory is dataclasses.MISSING else factory()
        if option.name in names and getattr(options, option.name) != default:
            changed.append(option.name)
    return changed


_OWN = frozenset(item.name for item in dataclasses.fields(SourceConfig))
_OF_LOGS = _OWN - {item.name for item in dataclasses.fields(MapConfig)} - {"log", "drive", "graph"}
_OF_MAPS = _OWN - _OF_LOGS - {"log", "drive", "graph", "name", "building"}
_DRAWN = frozenset(
    {"generated", "half", "style", "halls", "furniture", "slam_noise", "simulated", "simulation"}
)
