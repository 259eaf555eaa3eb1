"""Evaluated maps, drives and graphs of a comparison, with their true labels."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pgm_places.evaluation.bootstrap import numbered_apart, square_blocks
from pgm_places.evaluation.folds import contiguous_parts
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.layout import GridLayout
from pgm_places.inference.labeling import Labeling
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.pictures.graph_layout import GraphLayout
from pgm_places.spaces.door_truth import DoorScores, match_doors, match_painted
from pgm_places.trajectories.path_layout import PathLayout
from pgm_places.trajectories.trajectory import Trajectory
from pgm_places.unary.space_model import MapSpaces

BLOCK_M = 2.0
"""Side of the squares resampled for confidence intervals; errors of closer cells correlate."""

NODES_PER_BLOCK = 10
"""Nodes of graphs resampled together, where they lie side by side."""

STRETCH_M = 5.0
"""Length of the stretches of drives resampled; errors of closer steps correlate."""


@dataclass(frozen=True, eq=False)
class EvalMap:
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
    building : str, optional
        What it shares with other maps of the same building.
    """

    name: str
    grid: OccupancyGrid
    truth: NDArray[np.int16]
    layout: GridLayout
    window: NDArray[np.bool_]
    building: str | None = None

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
class EvalDrive(_Painted):
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

    @property
    def building(self) -> str | None:
        """What it shares with other drives through the same building."""
        return self.trajectory.building

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
class EvalGraph(_Painted):
    """A labelled user-defined graph with its true labels.

    Parameters
    ----------
    name : str
        Its name in tables.
    graph : LabelGraph
    node_truth : (N,) int
        True label of each node, -1 where it is unknown or observed.
    building : str, optional
        What it shares with other graphs of the same group.
    """

    name: str
    graph: LabelGraph
    node_truth: NDArray[np.int64]
    building: str | None = None

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


TestItem = EvalMap | EvalDrive | EvalGraph


def blocks_of(items: Sequence[TestItem]) -> NDArray[np.int64]:
    """(N,) the block of each node of the items together, which no two items share.

    An item that several splits test on has the same blocks in each: they are drawn together, for
    testing on them twice tells little that is new.
    """
    blocks: dict[tuple[str, str | None, bytes], NDArray[np.int64]] = {}
    keys = [(item.name, item.building, item.node_truth.tobytes()) for item in items]
    for key, item in zip(keys, items, strict=True):
        if key not in blocks:
            blocks[key] = item.blocks()
    sizes = [len(part) for part in blocks.values()]
    apart = np.split(numbered_apart(list(blocks.values())), np.cumsum(sizes)[:-1])
    of_key = dict(zip(blocks, apart, strict=True))
    return np.concatenate([of_key[key] for key in keys])


def stretches(drive: Trajectory) -> NDArray[np.int64]:
    """(T,) number of the stretch of ``STRETCH_M`` along the path that holds each step."""
    way = np.concatenate([[0.0], np.cumsum(drive.step_lengths_m)])[: len(drive)]
    return (way // STRETCH_M).astype(np.int64)


PASSAGE_M = 0.3
"""A doorway that is labelled this much before or after it was passed through has been found."""


def door_scores(item: EvalMap, labeling: Labeling, doorway: int) -> DoorScores:
    """How many doors of a map a method found, missed and invented.

    Its doors are the connected pieces of cells that it labelled as doorways.

    Parameters
    ----------
    item : EvalMap
    labeling : Labeling
        Of the map's layout.
    doorway : int
        The label of doorways.
    """
    painted = item.layout.to_raster(labeling.labels.astype(np.int16), fill=-1)
    match = match_painted(painted, item.grid, _known(item), doorway)
    return match.scores(np.ones(len(match.door), np.bool_))


def gate_scores(item: EvalMap, spaces: MapSpaces, doorway: int) -> DoorScores:
    """How many doors of a map the accepted gates match, independent of a method's labels."""
    match = match_doors(spaces.gates, _known(item), doorway)
    return match.scores(spaces.places.accepted)


def _known(item: EvalMap) -> NDArray[np.int16]:
    """(H, W) the true labels inside the window, -1 elsewhere."""
    return np.where(item.window, item.truth, np.int16(-1))


def passage_scores(item: EvalDrive, labeling: Labeling, doorway: int) -> DoorScores:
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
