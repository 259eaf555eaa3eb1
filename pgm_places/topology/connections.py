"""Which regions of a map are connected, and through what."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pgm_places.maps.components import Components
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.topology.passages import find_passages
from pgm_places.topology.topological_map import Connection

__all__ = ["connections_of"]


def connections_of(
    pieces: Components,
    grid: OccupancyGrid,
    ids: Sequence[int],
    clearance: NDArray[np.int32],
    min_width_m: float = 0.0,
) -> tuple[Connection, ...]:
    """The connections of pieces, by ids; those narrower than ``min_width_m`` are left out.

    Parameters
    ----------
    pieces : Components
    grid : OccupancyGrid
        The map of the pieces; only its frame is used.
    ids : sequence of int
        One per piece.
    clearance : (H, W) int32
        Squared distance in cells to the nearest cell that is not free.
    min_width_m : float
    """
    passages = find_passages(pieces.piece, pieces.count, clearance)
    middles = grid.cell_centres_m(passages.middle_rc)
    connections = []
    for k, (i, j) in enumerate(passages.pairs.tolist()):
        width_m = float(passages.width[k]) * grid.resolution_m
        if width_m < min_width_m:
            continue
        first, second = sorted((ids[i], ids[j]))
        point_m = (float(middles[k, 0]), float(middles[k, 1]))
        border_m = float(passages.sides[k]) * grid.resolution_m
        connections.append(Connection(first, second, point_m, width_m, border_m))
    return tuple(sorted(connections, key=lambda item: (item.first, item.second)))
