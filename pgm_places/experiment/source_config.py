"""What an experiment trains or is tested on: maps, drives, graphs, and splits of them."""

import dataclasses
from collections.abc import Set
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from pgm_places._option_marks import Ge, MinLen
from pgm_places.errors import ConfigError
from pgm_places.experiment.map_config import MapConfig
from pgm_places.labelers.trajectory_labeler import REACH_M
from pgm_places.options import AtLeastZero, Options, Positive, Seed, Whole, check_options
from pgm_places.sensing.simulated_moves import N_RUNS
from pgm_places.simulation.robot_options import LaserOptions, RobotMotion
from pgm_places.trajectories.similarity import Similarity
from pgm_places.unary.scan_model import BeamOptions


@dataclass(frozen=True, kw_only=True)
class StepOptions(Options):
    """How the steps of drives are observed and joined.

    Parameters
    ----------
    every_m : float or "auto"
        Distance between two updates in metres; ``"auto"`` is chosen for hidden Markov models on
        held-out parts of the training drives, and 0.1 for other methods.
    loop_m : float
        Link visits to the same spot within this many metres; 0 for a chain. Methods for chains see
        only the chain.
    max_range_m : float
        Reach of the completed scans.
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
        A GraphML file, whose attributes of nodes and of edges are the columns of two tables.
    nodes, edges : str, optional
        The two tables instead, CSV or Parquet: a row per node, and a row per edge. Without edges
        each node is by itself.
    node : str
        The column that names the nodes.
    ends : (str, str)
        The columns that name the two nodes of an edge.
    label : str
        The column of true labels; it is empty where they are not known.
    classes : mapping, optional
        From the texts of that column to label names; what it leaves out has no label.
    known : str, optional
        The column of observed labels: evidence for the methods, not scored.
    features : list of str, optional
        The node features; by default all columns of numbers that have no other meaning.
    edge_features : list of str, optional
        The same for edges.
    probabilities : list of str, optional
        For each label, in their order, the column of its probability by the user's own classifier,
        which takes the place of the configuration's.
    positions : (str, str), optional
        The columns of x and y: for pictures, and to hold out nodes that lie together.
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
            raise ConfigError("edges is a table beside nodes; a GraphML file has its own edges")

    @property
    def other_columns(self) -> tuple[str, ...]:
        """The columns of nodes that are no features."""
        named = [self.node, self.label, *(self.probabilities or ()), *(self.positions or ())]
        return (*named, self.known) if self.known is not None else tuple(named)


@dataclass(frozen=True, kw_only=True)
class SplitConfig:
    """Buildings of ``[[train]]`` to test on, and those to learn from.

    Parameters
    ----------
    test : list of str
        Buildings that are tested on.
    train : list of str, optional
        Buildings that are learned from; by default all others.
    name : str, optional
        Its name in tables; by default the buildings that are tested on.
    """

    test: Annotated[tuple[str, ...], MinLen(1)]
    train: Annotated[tuple[str, ...], MinLen(1)] | None = None
    name: str | None = None

    def __post_init__(self) -> None:
        check_options(self)
        both = [name for name in self.test if name in (self.train or ())]
        if both:
            raise ConfigError(
                f"splits: {both[0]!r} is in both train and test of a split; learn from other "
                "buildings than those that are tested on"
            )


@dataclass(frozen=True, kw_only=True)
class DriveConfig(MapConfig, RobotMotion):
    """A simulated robot's tour of a labelled map.

    The map is described as any other: ``map`` and ``labels``, ``generated``, ... The robot visits
    every place that it fits into (:class:`pgm_places.simulation.simulated_robot.SimulatedRobot`).

    Parameters
    ----------
    seed : int
        Seed of the robot's starting point.
    length_m : float, optional
        The tour ends after this distance.
    spacing_m : float
        Largest distance of any place from the nearest stop of the tour.
    laser : LaserOptions
        Its laser.
    """

    seed: Seed = 0
    length_m: Positive | None = None
    spacing_m: Positive = 3.0
    laser: LaserOptions = field(default_factory=LaserOptions)


@dataclass(frozen=True, kw_only=True)
class SourceConfig(MapConfig):
    """A map, a drive (recorded in a log, or simulated), or a user-defined graph.

    For a log, ``map`` with ``labels`` or ``regions`` is a map in the frame of the log, which tells
    the true place of each step unless ``truth`` or the log itself does. Options that do not
    apply to what is given are refused.

    Parameters
    ----------
    log : str, optional
        A CARMEN log, a bag, or a table of poses.
    drive : DriveConfig, optional
        A drive that is simulated.
    graph : str or GraphConfig, optional
        A GraphML file, or what the files of a graph are and what their columns mean.
    truth : str, optional
        A table of true places with one row per step of the log.
    label_column : str, optional
        The column of places in ``truth`` or in the log's own table. ``classes`` translates them.
    frame : Similarity, optional
        From the log's frame to the map's.
    counts : str, optional
        Counts of objects that a camera saw along the log, CSV or JSON: further columns of its
        steps. With counts for one drive there are counts for all, and no maps to train on.
    counts_within_s : float
        Longest time between a step and its counts.
    range_max_m : float, optional
        Readings of this range or more count as no return.
    laser : LaserOptions, optional
        Simulate the scans of this laser in the map along the log's path, instead of the log's own.
    resample_m : float, optional
        Take positions this far apart, on straight lines between those recorded; for logs without
        scans.
    from_step, to_step : int, optional
        The half-open range of the log's steps to use.
    map_labels : str, optional
        Folder that ``pgm-places label`` wrote for the map of this drive: methods see these labels
        as an observation, not as the truth. For test drives only.
    region : (float, float, float, float), optional
        Use only the true places of steps in this rectangle: minimum x and y, then maximum, in
        metres. The robot is still tracked outside it.
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
        assert self.graph is not None  # asked for graphs alone
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
            raise ConfigError("give log (a file) or drive (a simulated one), not both")
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
            raise ConfigError("give labels (an image) or regions (a GeoJSON file), not both")
        if self.counts is None and self.counts_within_s != WITHIN_S:
            raise ConfigError("counts_within_s is for counts; add counts (CSV or JSON)")
        if self.laser is not None and self.map is None:
            raise ConfigError("laser simulates scans in a map; add map")

    def _refuse(self, names: Set[str], beside: str, what: str) -> None:
        if given := given_options(self, names):
            raise ConfigError(f"{given[0]} does not apply to {beside}: {what}")


def given_options(options: Any, names: Set[str]) -> list[str]:
    """Those of these options that are not what they are by default, in the order of the fields."""
    given = []
    for item in dataclasses.fields(options):
        made = item.default_factory
        default = item.default if made is dataclasses.MISSING else made()
        if item.name in names and getattr(options, item.name) != default:
            given.append(item.name)
    return given


_OWN = frozenset(item.name for item in dataclasses.fields(SourceConfig))
_OF_LOGS = _OWN - {item.name for item in dataclasses.fields(MapConfig)} - {"log", "drive", "graph"}
_OF_MAPS = _OWN - _OF_LOGS - {"log", "drive", "graph", "name", "building"}
_DRAWN = frozenset(
    {"generated", "half", "style", "halls", "furniture", "slam_noise", "simulated", "simulation"}
)
