"""The confidence in a region's label: its mean probability over the region's cells."""

import numpy as np
from numpy.typing import ArrayLike

from pgm_places._checks import finite_array
from pgm_places.errors import InputError
from pgm_places.graph.bands import bands_of_rows
from pgm_places.graph.layout import GridLayout
from pgm_places.maps.coarsening import Coarsening
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.topology.components import Components

__all__ = ["mean_confidences"]


def mean_confidences(
    pieces: Components,
    beliefs: ArrayLike,
    layout: GridLayout | None,
    n_labels: int,
    grid: OccupancyGrid,
) -> list[float | None]:
    """The mean probability of each piece's label, None for a piece without a known cell.

    Parameters
    ----------
    pieces : Components
    beliefs : (N, K) float
        Probabilities of the labels at the nodes of ``layout``.
    layout : GridLayout
        The cells behind ``beliefs``: of the map, or of the map coarsened.
    n_labels : int
        K.
    grid : OccupancyGrid
        The map that the pieces lie on.

    Raises
    ------
    InputError
        Beliefs without a layout.
    MapError
        The layout is of another map.
    """
    if layout is None:
        raise InputError("beliefs need the layout of their nodes; pass layout as well")
    array = finite_array("beliefs", beliefs, (len(layout.cells_rc), n_labels), dtype=np.float32)
    coarsening = Coarsening.behind(layout, grid)
    counts, sums = np.zeros(pieces.count, np.int64), np.zeros(pieces.count)
    for rows in bands_of_rows(grid.shape):
        piece = pieces.piece[rows]
        node = coarsening.paint(layout.node_of_cell, -1, rows=rows)
        known = (piece >= 0) & (node >= 0)
        numbers = piece[known]
        counts += np.bincount(numbers, minlength=pieces.count)
        probability = array[node[known], pieces.label[numbers]]
        sums += np.bincount(numbers, probability, pieces.count)
    return [
        float(total / count) if count else None for total, count in zip(sums, counts, strict=True)
    ]
