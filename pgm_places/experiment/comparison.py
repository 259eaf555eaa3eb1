"""The results of several methods on the same maps."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pgm_places.evaluation.bootstrap import numbered_apart
from pgm_places.evaluation.evaluation import Evaluation, Interval, block_bootstrap, square_blocks
from pgm_places.evaluation.folds import contiguous_parts
from pgm_places.experiment.graph_layout import GraphLayout
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.layout import GridLayout
from pgm_places.inference.labeling import Labeling
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.spaces.door_truth import DoorScores, match_doors, match_painted
from pgm_places.trajectories.path_layout import PathLayout
from pgm_places.trajectories.trajectory import Trajectory
from pgm_places.unary.space_model import MapSpaces

__all__ = [
    "BLOCK_M",
    "NODES_PER_BLOCK",
    "STRETCH_M",
    "Comparison",
    "MethodResult",
    "TestDrive",
    "TestGraph",
    "TestItem",
    "TestMap",
    "door_scores",
    "history_of",
    "learning_of",
    "passage_scores",
    "score_intervals",
    "stretches",
]

BLOCK_M = 2.0
"""Side of the squares resampled for confidence intervals; errors of closer cells correlate."""

PASSAGE_M = 0.3
"""A doorway that is labelled this much before or after it was passed through has been found."""

NODES_PER_BLOCK = 10
"""Nodes of graphs resampled together, where they lie side by side."""

STRETCH_M = 5.0
"""Length of the stretches of drives resampled; errors of closer steps correlate."""


@dataclass(frozen=True, eq=False)
class TestMap:
    """A map that was labelled, with its ground truth.

    Parameters
    ----------
    name : str
        Its name in tables.
    grid : OccupancyGrid
        The map of the scans.
    truth : (H, W) int16
        True label index per cell, -1 where unknown.
    layout : GridLayout
        The cells that were labelled: the free cells inside the window.
    window : (H, W) bool
        The part of the map that was tested.
    """

    name: str
    grid: OccupancyGrid
    truth: NDArray[np.int16]
    layout: GridLayout
    window: NDArray[np.bool_]

    __test__ = False  # not a test class, whatever pytest thinks of its name
    unit: ClassVar[str] = "cell"
    """What a node is."""

    @cached_property
    def node_truth(self) -> NDArray[np.int64]:
        """(N,) true label of each node, -1 where it is unknown."""
        return self.layout.from_raster(self.truth).astype(np.int64)

    def blocks(self) -> NDArray[np.int64]:
        """(N,) number of the square of ``BLOCK_M`` that holds each cell."""
        side = max(round(BLOCK_M / self.grid.resolution_m), 1)
        return square_blocks(self.layout.cells_rc, side)


class _Painted:
    """What is not labelled cell by cell, as its layout paints it on a raster."""

    @cached_property
    def truth(self: Any) -> NDArray[np.int16]:
        """(H, W) true label where a node is painted, -1 elsewhere and where it is unknown."""
        return self.layout.to_raster(self.node_truth.astype(np.int16), fill=-1)

    @property
    def window(self: Any) -> NDArray[np.bool_]:
        """(H, W) the cells that a node is painted on."""
        return self.layout.node_of_cell >= 0


@dataclass(frozen=True, eq=False)
class TestDrive(_Painted):
    """A drive whose steps were labelled, with their true places.

    Parameters
    ----------
    name : str
        Its name in tables.
    trajectory : Trajectory
        With its true places.
    grid : OccupancyGrid
        The map it drives through, or one built from its scans.
    """

    name: str
    trajectory: Trajectory
    grid: OccupancyGrid

    __test__ = False  # not a test class, whatever pytest thinks of its name
    unit: ClassVar[str] = "step"
    """What a node is."""

    @cached_property
    def layout(self) -> PathLayout:
        """How values of steps are painted on the map."""
        return PathLayout(self.grid, self.trajectory.poses[:, :2])

    @property
    def node_truth(self) -> NDArray[np.int64]:
        """(T,) true label of each step, -1 where it is unknown."""
        assert self.trajectory.labels is not None
        return self.trajectory.labels

    def blocks(self) -> NDArray[np.int64]:
        """(T,) number of the stretch of ``STRETCH_M`` that holds each step."""
        return stretches(self.trajectory)


@dataclass(frozen=True, eq=False)
class TestGraph(_Painted):
    """A graph of one's own whose nodes were labelled, with their true labels.

    Parameters
    ----------
    name : str
        Its name in tables.
    graph : LabelGraph
    node_truth : (N,) int
        True label of each node, -1 where it is unknown or was told.
    """

    name: str
    graph: LabelGraph
    node_truth: NDArray[np.int64]

    __test__ = False  # not a test class, whatever pytest thinks of its name
    unit: ClassVar[str] = "node"
    """What a node is."""

    @cached_property
    def layout(self) -> GraphLayout:
        """The graph as a picture."""
        return GraphLayout(self.graph)

    @property
    def grid(self) -> OccupancyGrid:
        """The picture without its nodes' values."""
        return self.layout.grid

    def blocks(self) -> NDArray[np.int64]:
        """(N,) number of the part, some ``NODES_PER_BLOCK`` nodes, that holds each one."""
        n_parts = max(round(self.graph.n_nodes / NODES_PER_BLOCK), 1)
        if self.graph.points_m is None and not self.graph.is_chain:
            return np.arange(self.graph.n_nodes)  # nothing says which nodes lie together
        return contiguous_parts(self.graph, n_parts)


TestItem = TestMap | TestDrive | TestGraph


def stretches(drive: Trajectory) -> NDArray[np.int64]:
    """(T,) number of the stretch of ``STRETCH_M`` along the path that holds each step."""
    way = np.concatenate([[0.0], np.cumsum(drive.step_lengths_m)])[: len(drive)]
    return (way // STRETCH_M).astype(np.int64)


@dataclass(frozen=True, eq=False)
class MethodResult:
    """The results of one method: a labelling and an evaluation per map, and the pooled evaluation.

    ``intervals`` holds 95 % confidence intervals of ``accuracy`` and ``balanced_accuracy``;
    ``histories`` the figures of each iteration, per map, and ``learning`` those of the learner:
    values by the name of the quantity. ``doors`` counts doors per map: () without a label for
    doorways. ``learned_with`` is the id of another method that learned for this one, too: the two
    differ in how they label, and the seconds of learning are that method's.
    """

    id: str
    name: str
    options: Mapping[str, Any]
    labelings: tuple[Labeling, ...]
    evaluations: tuple[Evaluation, ...]
    evaluation: Evaluation
    seconds: Mapping[str, float]
    learned: Mapping[str, Any] = field(default_factory=dict)
    intervals: Mapping[str, Interval] = field(default_factory=dict)
    histories: tuple[Mapping[str, Sequence[float]], ...] = ()
    learning: Mapping[str, Sequence[float]] = field(default_factory=dict)
    doors: tuple[DoorScores, ...] = ()
    learned_with: str | None = None


@dataclass(frozen=True, eq=False)
class Comparison:
    """All results of a comparison, for the table, the pictures and the report.

    ``maps`` are the labelled items: maps, drives, or, for nodes of both kinds, each map with the
    drive through it. ``selection`` records the options tried on held-out training cells, and those
    chosen.
    """

    title: str
    label_names: tuple[str, ...]
    maps: tuple[TestItem, ...]
    methods: tuple[MethodResult, ...]
    stage_seconds: Mapping[str, float]
    config: Mapping[str, Any]
    versions: Mapping[str, str]
    inputs: Mapping[str, str]
    warnings: tuple[str, ...] = ()
    selection: Mapping[str, Any] | None = None

    @property
    def unit(self) -> str:
        """What was labelled: ``cell``, ``step``, or ``node`` for both, or for graphs."""
        units = {item.unit for item in self.maps}
        return units.pop() if len(units) == 1 else "node"

    @property
    def is_mixed(self) -> bool:
        """Whether nodes of several kinds were labelled."""
        return len({item.unit for item in self.maps}) > 1

    def by_unit(self, method: MethodResult) -> dict[str, Evaluation]:
        """A method's pooled evaluation of each kind of node: ``cell``, ``step``."""
        found: dict[str, list[Evaluation]] = {}
        for item, evaluation in zip(self.maps, method.evaluations, strict=True):
            found.setdefault(item.unit, []).append(evaluation)
        return {unit: Evaluation.merged(parts) for unit, parts in found.items()}


def score_intervals(
    maps: Sequence[TestItem], labelings: Sequence[Labeling], n_labels: int
) -> dict[str, Interval]:
    """95 % confidence intervals of ``accuracy`` and ``balanced_accuracy`` over all maps together.

    A block bootstrap over squares of ``BLOCK_M`` of maps, stretches of ``STRETCH_M`` of drives, and
    single nodes of graphs, or ``NODES_PER_BLOCK`` side by side
    (:func:`pgm_places.evaluation.evaluation.block_bootstrap`).
    """
    return block_bootstrap(
        np.concatenate([item.node_truth for item in maps]),
        np.concatenate([labeling.labels for labeling in labelings]),
        numbered_apart([item.blocks() for item in maps]),
        n_labels=n_labels,
    )


def door_scores(
    item: TestMap, labeling: Labeling, doorway: int, spaces: MapSpaces | None
) -> DoorScores:
    """The number of doors of a map that a method found, missed and invented.

    Parameters
    ----------
    item : TestMap
    labeling : Labeling
        Of the map's layout.
    doorway : int
        The label of doorways.
    spaces : MapSpaces or None
        For a method that sees spaces: its doorways are the accepted gates. Those of other methods
        are the pieces of cells that it labelled as doorways.
    """
    truth = np.where(item.window, item.truth, np.int16(-1))
    if spaces is not None:
        match, accepted = match_doors(spaces.gates, truth, doorway), spaces.places.accepted
    else:
        painted = item.layout.to_raster(labeling.labels.astype(np.int16), fill=-1)
        match = match_painted(painted, item.grid, truth, doorway)
        accepted = np.ones(len(match.door), np.bool_)
    return match.scores(accepted)


def passage_scores(item: TestDrive, labeling: Labeling, doorway: int) -> DoorScores:
    """How many doorways that a drive passes through a method found, missed and invented.

    A passage is a run of steps in a doorway that is entered and left, and counts once, however many
    steps it takes. It is found if some step within ``PASSAGE_M`` of it along the path is labelled
    doorway. A run of steps labelled doorway that has no doorway so near counts as invented, unless
    the truth is unknown there.
    """
    truth, found = item.node_truth, labeling.labels
    way = np.concatenate([[0.0], np.cumsum(item.trajectory.step_lengths_m)])[: len(truth)]
    around = np.concatenate([[-1], truth, [-1]])
    passages: list[slice] = []
    partial: list[slice] = []
    for run in _runs(truth == doorway):
        whole = around[run.start] >= 0 and around[run.stop + 1] >= 0  # known before and after
        (passages if whole else partial).append(run)

    def meets(one: slice, others: Sequence[slice]) -> bool:
        low, high = way[one.start] - PASSAGE_M, way[one.stop - 1] + PASSAGE_M
        return any(way[other.stop - 1] >= low and way[other.start] <= high for other in others)

    claims = _runs(found == doorway)
    known = [claim for claim in claims if (truth[claim] >= 0).any()]
    known = [claim for claim in known if meets(claim, passages) or not meets(claim, partial)]
    return DoorScores(
        doors=len(passages),
        found=sum(meets(passage, claims) for passage in passages),
        accepted=len(known),
        right=sum(meets(claim, passages) for claim in known),
    )


def _runs(inside: NDArray[np.bool_]) -> list[slice]:
    """The runs of consecutive steps where the mask is true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(np.int8), [0]])))
    return [slice(int(first), int(end)) for first, end in edges.reshape(-1, 2)]


_FIGURE = {"graph-cut": "score", "trw-s": "bound", "icm": "changed nodes"}
"""What decoders report per iteration; others report the largest change of a belief or message."""


def history_of(labeling: Labeling) -> dict[str, Sequence[float]]:
    """The figures of a labelling after each of its iterations, by quantity."""
    told = labeling.info.get("history")
    if told is None:
        return {}
    if not isinstance(told, Mapping):
        decoder = str(labeling.info.get("decoder", ""))
        told = {_FIGURE.get(decoder, "change"): told}
        if "score_history" in labeling.info:
            told["score"] = labeling.info["score_history"]
    numbers = {str(quantity): _numbers(values) for quantity, values in told.items()}
    return {quantity: values for quantity, values in numbers.items() if values}


def learning_of(backend: Any) -> dict[str, Sequence[float]]:
    """Objective and lower bound after each step of learning, if a method records them."""
    history = getattr(backend, "learning_history", None)
    if history is None or len(history) < 2:
        return {}
    return {"objective": history[:, 1].tolist(), "lower bound": history[:, 2].tolist()}


def _numbers(values: Any) -> list[float]:
    """The values as floats, or nothing if they are not a sequence of numbers."""
    try:
        array = np.asarray(values, np.float64)
    except (TypeError, ValueError):
        return []
    return array.tolist() if array.ndim == 1 else []
