"""A trajectory and the cells that it crosses, labelled apart and together."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.paper.categories import PLACES, Building79
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.layout import GridLayout
from pgm_places.inference.problem import LabelingProblem
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.maps.coarsening import coarsen, coarsen_labels
from pgm_places.models.mrf import PottsField
from pgm_places.sensing.ray_casting import cast_poses
from pgm_places.trajectories.segments import Segments

CELL_M = 0.2
WEIGHTS = (0.25, 0.5, 1.0, 2.0, 4.0)
DOORWAY = PLACES.index("doorway")


@dataclass(frozen=True, eq=False)
class Nodes:
    """Cells that are crossed, or the steps that cross them: truth, side, and nodes of a graph."""

    truth: NDArray[np.int64]
    left: NDArray[np.bool_]
    node: NDArray[np.int64]

    def rates(self, labels: NDArray[np.int64]) -> str:
        """Right labels in percent: on the left, on the right, and of the doorways there."""
        here = labels[self.node]
        known = self.truth >= 0
        parts = (known & self.left, known & ~self.left, ~self.left & (self.truth == DOORWAY))
        return " / ".join(f"{100 * (here[part] == self.truth[part]).mean():.1f}" for part in parts)


def joined_table(data: Building79, labeler: TrajectoryLabeler) -> str:
    """Rates of steps and of crossed cells, apart and together, per weight of the Potts field."""
    coarse = coarsen(data.map.grid, CELL_M)
    cells = LabelGraph.from_grid(coarse)
    layout = cells.layout
    assert isinstance(layout, GridLayout)
    segments = Segments(data.path.poses, CELL_M)
    chain = segments.graph()
    assert chain.positions_m is not None
    crossed = layout.nodes_at(coarse.cells_at_m(chain.positions_m))
    steps = np.flatnonzero(crossed >= 0)
    left = segments.means(data.left[:, None].astype(float))[:, 0] > 0.5

    of_cells = _scores_of_cells(data, labeler, cells)
    of_steps = np.log(segments.means(np.exp(labeler.scores(data.path))))
    together = LabelGraph.joined(cells, chain, np.column_stack([crossed[steps], steps]))
    truth_of_steps = segments.majority(data.place, len(PLACES))
    truth_of_cells = layout.from_raster(coarsen_labels(data.map.labels, data.map.grid, coarse))
    all_steps = Nodes(truth_of_steps, left, np.arange(len(chain.positions_m)))
    some_cells = Nodes(truth_of_cells[crossed[steps]].astype(np.int64), left[steps], crossed[steps])
    problems: Mapping[str, LabelingProblem] = {
        "cells": LabelingProblem(cells, PLACES, unary=of_cells),
        "steps": LabelingProblem(chain, PLACES, unary=of_steps),
        "both": LabelingProblem(together, PLACES, unary=np.concatenate([of_cells, of_steps])),
    }
    lines = [
        "| weight | steps apart | steps together | crossed cells apart | crossed cells together |",
        "|---|---|---|---|---|",
    ]
    n = cells.n_nodes
    for weight in (0.0, *WEIGHTS):
        found = {name: PottsField(weight).infer(item).labels for name, item in problems.items()}
        rates = (
            all_steps.rates(found["steps"]),
            all_steps.rates(found["both"][n:]),
            some_cells.rates(found["cells"]),
            some_cells.rates(found["both"][:n]),
        )
        lines.append(f"| {weight:g} | {' | '.join(rates)} |")
        print(lines[-1], flush=True)
    return "\n".join(lines)


def _scores_of_cells(
    data: Building79, labeler: TrajectoryLabeler, cells: LabelGraph
) -> NDArray[np.float64]:
    """What the list says of each coarse cell's centre, all around in the fine map."""
    model = labeler.scan_model_
    assert cells.positions_m is not None
    poses = np.column_stack([cells.positions_m, np.zeros(cells.n_nodes)])
    sensor = model.sensor
    circles = cast_poses(data.map.grid, poses, sensor.angles_rad, max_range_m=sensor.max_range_m)
    return model.log_proba(circles)
