"""The mean probability of each label over the cells of a region."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array
from pgm_places.errors import InputError
from pgm_places.graph.bands import bands_of_rows
from pgm_places.graph.layout import GridLayout
from pgm_places.kernels.pages import leave_in_file
from pgm_places.maps.coarsening import Coarsening
from pgm_places.maps.components import Components
from pgm_places.maps.occupancy_grid import OccupancyGrid

__all__ = ["mean_probabilities"]


def mean_probabilities(
    pieces: Components,
    beliefs: ArrayLike,
    layout: GridLayout | None,
    n_labels: int,
    grid: OccupancyGrid,
) -> NDArray[np.float64]:
    """(P, K) mean probability of each label in each piece, NaN for a piece without a known cell.

    Parameters
    ----------
    pieces : Components
    beliefs : (N, K) float
        Probabilities of the labels at the nodes of ``layout``.
    layout : GridLayout
        The cells of ``beliefs``: those of the map or of a coarser version of it.
    n_labels : int
        K.
    grid : OccupancyGrid
        The map of the pieces.

    Raises
    ------
    InputError
        Beliefs without a layout.
    MapError
        The layout is of another map.
    """
    if layout is None:
        raise InputError("beliefs need the layout of their nodes; pass layout as well")
    array = finite_array("beliefs", beliefs, (layout.n_nodes, n_labels), dtype=np.float32)
    coarsening = Coarsening.behind(layout, grid)
    counts, sums = np.zeros(pieces.count, np.int64), np.zeros((pieces.count, n_labels))
    for rows in bands_of_rows(grid.shape):
        piece = pieces.piece[rows]
        if coarsening.factor == 1:
            node = layout.nodes_in(rows)
        else:
            node = coarsening.paint(layout.node_of_cell, -1, rows=rows)
        known = (piece >= 0) & (node >= 0)
        numbers, nodes = piece[known], node[known]
        counts += np.bincount(numbers, minlength=pieces.count)
        for k in range(n_labels):
            sums[:, k] += np.bincount(numbers, array[nodes, k], pieces.count)
        leave_in_file(array)
    return np.where(counts[:, None] > 0, sums / np.maximum(counts, 1)[:, None], np.nan)
