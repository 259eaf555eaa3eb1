"""Joint graph of the cells of a map and the steps of a drive, and its labellings."""

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from pgm_places._arguments import travels
from pgm_places.errors import InputError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.raster_edges import EdgeKind
from pgm_places.inference.labeling import Labeling
from pgm_places.inference.problem import LabelingProblem
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.spaces.doorways import Doorways
from pgm_places.trajectories.path import PathSegments
from pgm_places.trajectories.trajectory import Trajectory


@travels
@dataclass(frozen=True, eq=False)
class JointLabeling:
    """A labelling of the cells of a map and of the steps of a drive.

    Parameters
    ----------
    whole : Labeling
        All nodes: the cells, then the segments of the drive.
    cells : Labeling or None
        The map's cells, in the order of their graph.
    steps : Labeling or None
        The drive's steps.
    """

    whole: Labeling
    cells: Labeling | None
    steps: Labeling | None


@dataclass(frozen=True, eq=False)
class JointGraph:
    """The cells of a map, the segments of a drive, or both, each segment linked to its cell.

    The cells come first in ``graph``.
    """

    graph: LabelGraph
    cells: LabelGraph | None
    segments: PathSegments | None

    @classmethod
    def of(
        cls,
        cells: LabelGraph | None,
        grid: OccupancyGrid | None,
        drive: Trajectory | None,
        *,
        every_m: float,
        loop_m: float = 0.0,
    ) -> Self:
        """The graph of a map, of a drive in the frame of the map, or of both.

        ``every_m`` and ``loop_m`` are options of a TrajectoryLabeler. InputError if there is
        neither a map nor a drive, or no step is on a cell of the graph.
        """
        if drive is None:
            if cells is None:
                raise InputError("give a map, a drive, or both; got neither")
            return cls(cells, cells, None)
        segments = PathSegments(drive.poses, every_m)
        chain = segments.graph(loop_m=loop_m)
        if cells is None:
            return cls(chain, None, segments)
        assert grid is not None and chain.positions_m is not None
        under = cells.grid_layout.nodes_at(grid.cells_at_m(chain.positions_m))
        linked = np.flatnonzero(under >= 0)
        if not len(linked):
            raise InputError(
                f"{drive.name}: none of its positions is on a labelled cell of the map; transform "
                "the drive to the map's frame first (Trajectory.transformed)"
            )
        links = np.column_stack([under[linked], linked])
        return cls(LabelGraph.joined(cells, chain, links), cells, segments)

    @property
    def n_cells(self) -> int:
        """Number of nodes that are cells of the map."""
        return 0 if self.cells is None else self.cells.n_nodes

    def problem(
        self,
        label_names: tuple[str, ...],
        cell_scores: NDArray[np.float64] | None,
        step_scores: NDArray[np.float64] | None,
        *,
        link_weight: float | None = None,
    ) -> LabelingProblem:
        """The problem with the scores of cells (N, K) and of steps (T, K) as its unary.

        With ``link_weight``, edges have weights: ``link_weight`` for links between steps and cells,
        1 for all others.
        """
        unaries = [] if cell_scores is None else [np.asarray(cell_scores, np.float64)]
        if step_scores is not None and self.segments is not None:
            unaries.append(np.log(self.segments.means(np.exp(step_scores))))
        weights = None
        if link_weight is not None:
            kinds = self.graph.edge_kind
            is_link = np.zeros(self.graph.n_edges) if kinds is None else kinds == EdgeKind.LINK
            weights = np.where(is_link, link_weight, 1.0)[:, None]
        unary = np.concatenate(unaries)
        return LabelingProblem(self.graph, label_names, unary, edge_features=weights)

    def truth(
        self, of_cells: NDArray[np.int64], of_steps: NDArray[np.int64] | None, n_labels: int
    ) -> NDArray[np.int64]:
        """(N,) true label of each node of a map, from the labels of its cells and of the steps."""
        if self.segments is None or of_steps is None:
            return of_cells
        return np.concatenate([of_cells, self.segments.majority(of_steps, n_labels)])

    def split(self, labeling: Labeling) -> JointLabeling:
        """Split a labelling into the map's cells and the drive's steps."""
        n, segments = self.n_cells, self.segments
        cells = None if self.cells is None else labeling.part(np.arange(n))
        steps = None if segments is None else labeling.part(n + segments.of_step)
        return JointLabeling(labeling, cells, steps)


class JointScores(NamedTuple):
    """Scores of each node before inference, the unary (N, K) of the cells and (T, K) of the steps.

    ``doorways`` are the accepted gates of the map, if the model uses space features.
    """

    graph: JointGraph
    cells: NDArray[np.float64] | None
    steps: NDArray[np.float64] | None
    doorways: Doorways | None = None

    def problem(self, names: tuple[str, ...], link_weight: float | None) -> LabelingProblem:
        """The labelling problem, with ``link_weight`` if it is not None."""
        return self.graph.problem(names, self.cells, self.steps, link_weight=link_weight)
