"""Evaluated maps, drives and graphs of a comparison, with their true labels."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.evaluation.bootstrap import numbered_apart, square_blocks
from pgm_places.evaluation.folds import contiguous_parts
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.layout import GridLayout
from pgm_places.inference.labeling import Labeling
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.pictures.canvas import GraphLayout
from pgm_places.spaces.doorways import DoorScores, match_doors, match_painted
from pgm_places.trajectories.path import PathLayout
from pgm_places.trajectories.trajectory import Trajectory
from pgm_places.unary.space_model import MapSpaces

BLOCK_M = 2.0
"""Side of the resampled squares of maps for confidence intervals; closer errors correlate."""

NODES_PER_BLOCK = 10
"""Number of adjacent nodes of graphs that are resampled together."""

STRETCH_M = 5.0
"""Length of the resampled stretches of drives; closer errors correlate."""


@dataclass(frozen=True, eq=False)
class EvalMap:
    """An evaluated map with its true labels (H, W), -1 where unknown.

    ``layout`` has the free cells inside ``window`` (H, W), the tested part of the map.
    """

    name: str
    grid: OccupancyGrid
    truth: NDArray[np.int16]
    layout: GridLayout
    window: NDArray[np.bool_]
    building: str | None = None

    __test__ = False  # not a test class of pytest, despite its name
    unit: ClassVar[str] = "cell"
    """What a node is."""

    @cached_property
    def node_truth(self) -> NDArray[np.int64]:
        """(N,) true label of each node, -1 where it is unknown."""
        return self.layout.from_raster(self.truth).astype(np.int64)

    def blocks(self) -> NDArray[np.int64]:
        """(N,) index of the square of ``BLOCK_M`` of each cell."""
        side = max(round(BLOCK_M / self.grid.resolution_m), 1)
        return square_blocks(self.layout.cells_rc, side)


class _Painted:
    """Mixin for drives and graphs: rasters for pictures, painted by the layout."""

    @cached_property
    def truth(self: Any) -> NDArray[np.int16]:
        """(H, W) true label of painted nodes, -1 elsewhere and where unknown."""
        return self.layout.to_raster(self.node_truth.astype(np.int16), fill=-1)

    @property
    def window(self: Any) -> NDArray[np.bool_]:
        """(H, W) the cells with a painted node."""
        return self.layout.node_of_cell >= 0


@dataclass(frozen=True, eq=False)
class EvalDrive(_Painted):
    """An evaluated drive with its true labels, and its map, or one built from its scans."""

    name: str
    trajectory: Trajectory
    grid: OccupancyGrid

    __test__ = False  # not a test class of pytest, despite its name
    unit: ClassVar[str] = "step"
    """What a node is."""

    @property
    def building(self) -> str | None:
        """Name of the building."""
        return self.trajectory.building

    @cached_property
    def layout(self) -> PathLayout:
        """The layout that paints values of steps on the map."""
        return PathLayout(self.grid, self.trajectory.poses[:, :2])

    @property
    def node_truth(self) -> NDArray[np.int64]:
        """(T,) true label of each step, -1 where unknown."""
        assert self.trajectory.labels is not None
        return self.trajectory.labels

    def blocks(self) -> NDArray[np.int64]:
        """(T,) index of the stretch of ``STRETCH_M`` of each step."""
        return stretches(self.trajectory)


@dataclass(frozen=True, eq=False)
class EvalGraph(_Painted):
    """An evaluated user-defined graph; true labels (N,) are -1 where unknown or observed."""

    name: str
    graph: LabelGraph
    node_truth: NDArray[np.int64]
    building: str | None = None

    __test__ = False  # not a test class of pytest, despite its name
    unit: ClassVar[str] = "node"
    """What a node is."""

    @cached_property
    def layout(self) -> GraphLayout:
        """The layout that draws the graph as a picture."""
        return GraphLayout(self.graph)

    @property
    def grid(self) -> OccupancyGrid:
        """The background of the picture."""
        return self.layout.grid

    def blocks(self) -> NDArray[np.int64]:
        """(N,) index of the block, about ``NODES_PER_BLOCK`` nodes, of each node."""
        n_parts = max(round(self.graph.n_nodes / NODES_PER_BLOCK), 1)
        if self.graph.points_m is None and not self.graph.is_chain:
            return np.arange(self.graph.n_nodes)  # without positions, nodes have no order
        return contiguous_parts(self.graph, n_parts)


TestItem = EvalMap | EvalDrive | EvalGraph


class ScoredTest(NamedTuple):
    """A test source with the scores of its nodes, computed once for all methods.

    ``label`` returns the labelling of each item by the method of an id. ``doors`` returns the door
    counts of each item from its labelling and the label of doorways, ``gates`` the counts of doors
    matched by gates; () if there are none.
    """

    items: Sequence[TestItem]
    label: Callable[[str], Sequence[Labeling]]
    doors: Callable[[Sequence[Labeling], int], tuple[DoorScores, ...]] = lambda *_: ()
    gates: Callable[[int], tuple[DoorScores, ...]] = lambda _: ()


Tested = Literal["maps", "drives", "graphs"]


def blocks_of(items: Sequence[TestItem]) -> NDArray[np.int64]:
    """(N,) the block of each node of all items; blocks of different items are different.

    An item in the test data of several splits has the same blocks in each, so that they are
    resampled together: its results in several splits are not independent.
    """
    blocks: dict[tuple[str, str | None, bytes], NDArray[np.int64]] = {}
    keys = [(item.name, item.building, item.node_truth.tobytes()) for item in items]
    for key, item in zip(keys, items, strict=True):
        if key not in blocks:
            blocks[key] = item.blocks()
    sizes = [len(block) for block in blocks.values()]
    apart = np.split(numbered_apart(list(blocks.values())), np.cumsum(sizes)[:-1])
    of_key = dict(zip(blocks, apart, strict=True))
    return np.concatenate([of_key[key] for key in keys])


def stretches(drive: Trajectory) -> NDArray[np.int64]:
    """(T,) index of the stretch of ``STRETCH_M`` along the path of each step."""
    way = np.concatenate([[0.0], np.cumsum(drive.step_lengths_m)])[: len(drive)]
    return (way // STRETCH_M).astype(np.int64)


PASSAGE_M = 0.3
"""Tolerance along the path between a passage through a doorway and a step labelled doorway."""


def door_scores(item: EvalMap, labeling: Labeling, doorway: int) -> DoorScores:
    """Count the detected, missed and false doors of a method on a map.

    The method's doors are connected components of cells labelled as doorways.
    """
    painted = item.layout.to_raster(labeling.labels.astype(np.int16), fill=-1)
    match = match_painted(painted, item.grid, _known(item), doorway)
    return match.scores(np.ones(len(match.door), np.bool_))


def gate_scores(item: EvalMap, spaces: MapSpaces, doorway: int) -> DoorScores:
    """Count the doors of a map that match accepted gates, for any labels."""
    match = match_doors(spaces.gates, _known(item), doorway)
    return match.scores(spaces.places.accepted)


def _known(item: EvalMap) -> NDArray[np.int16]:
    """(H, W) the true labels inside the window, -1 elsewhere."""
    return np.where(item.window, item.truth, np.int16(-1))


def passage_scores(item: EvalDrive, labeling: Labeling, doorway: int) -> DoorScores:
    """Count the detected, missed and false passages of a drive through doorways.

    A passage is a run of steps in a doorway, with known labels before and after. It is detected if
    a step within ``PASSAGE_M`` of it along the path is labelled doorway. A run of steps labelled
    doorway without a doorway within this distance is false, unless the truth is unknown there.
    """
    truth, labels = item.node_truth, labeling.labels
    way = np.concatenate([[0.0], np.cumsum(item.trajectory.step_lengths_m)])[: len(truth)]
    around = np.concatenate([[-1], truth, [-1]])
    passages: list[slice] = []
    partial: list[slice] = []
    for run in _runs(truth == doorway):
        is_complete = around[run.start] >= 0 and around[run.stop + 1] >= 0
        (passages if is_complete else partial).append(run)

    def meets(one: slice, others: Sequence[slice]) -> bool:
        low, high = way[one.start] - PASSAGE_M, way[one.stop - 1] + PASSAGE_M
        return any(way[other.stop - 1] >= low and way[other.start] <= high for other in others)

    claims = _runs(labels == doorway)
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
