"""Doorways as deep as one's own labels have them: conventions differ by half a metre."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.graph.layout import GridLayout
from pgm_places.spaces.doorways import Doorways
from pgm_places.spaces.gate import Gate

__all__ = ["with_doorway_depth"]

_NEAR_M, _BESIDE_M = 1.0, 0.3
"""Cells so far before, behind and beside a gate are its doorway or none."""

_LOG_FLOOR = np.log(0.02)
"""What is left of a doorway's log-odds where there is no gate, too."""

_SURE = 0.5


def with_doorway_depth(
    log_z: NDArray[np.float64],
    doorways: Doorways,
    layout: GridLayout,
    doorway: int,
    depth_m: float,
) -> NDArray[np.float64]:
    """The scores of cells, doorways at gates no deeper than ``depth_m`` along the passage.

    Around each gate, the odds of a doorway are multiplied by 0.02 where a cell is farther than half
    the depth from the gate's middle along its heading. Where the cells within are no likely doorway
    (a mean probability of at most a half) but others around the gate are, the gate lies beside its
    doorway, and the middle is that of the likely cells.

    Parameters
    ----------
    log_z : (N, K) float
        Log-probabilities.
    doorways : Doorways
        The gates that count.
    layout : GridLayout
    doorway : int
        The label of doorways.
    depth_m : float
    """
    near, kept = np.zeros(len(log_z), np.bool_), np.zeros(len(log_z), np.bool_)
    for gate in doorways.gates:
        cells = gate.cells(doorways.grid, wider_m=_BESIDE_M, deeper_m=_NEAR_M)
        node = layout.nodes_at(cells)
        cells, node = cells[node >= 0], node[node >= 0]
        if not len(node):
            continue
        along = _along(gate, doorways.grid.cell_centres_m(cells))
        probability = np.exp(log_z[node, doorway])
        inside = np.abs(along) <= depth_m / 2
        likely = probability > _SURE
        if likely.any() and not (inside.any() and probability[inside].mean() > _SURE):
            inside = np.abs(along - along[likely].mean()) <= depth_m / 2
        near[node], kept[node[inside]] = True, True
    changed = np.flatnonzero(near & ~kept)
    found = log_z.copy()
    found[changed, doorway] += _LOG_FLOOR
    found[changed] -= np.logaddexp.reduce(found[changed].T, axis=0)[:, np.newaxis]
    return found


def _along(gate: Gate, points_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) how far points (n, 2) lie behind the middle of a gate, along its heading (m)."""
    heading = [np.cos(gate.heading_rad), np.sin(gate.heading_rad)]
    return np.asarray((points_m - gate.centre_m) @ heading)
