"""Adjacency of places: through a gate, or across a wall."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.graph.label_graph import LabelGraph
from pgm_places.spaces.places import Places

WIDEST_WALL_M = 0.6
LEAST_SHARED_M = 1.0


def neighbour_graph(places: Places) -> LabelGraph:
    """The places as nodes, joined if a gate or at least 1 m of a wall separates them.

    Rooms of one kind are often adjacent along a corridor, without a door between them; the graph
    of ``places`` joins each of them only with the corridor. Places across walls thicker than
    0.6 m, or across shafts between two walls, are not neighbours.

    Examples
    --------
    >>> from pgm_places.maps.occupancy_grid import OccupancyGrid
    >>> from pgm_places.spaces.gates import gate_candidates
    >>> from pgm_places.spaces.places import places_between
    >>> from pgm_places.spaces.segmentation import Segmentation
    >>> cells = np.zeros((20, 42), np.int8)
    >>> cells[:, 20:22] = 100  # two rooms and a wall of 0.4 m
    >>> gates = gate_candidates(Segmentation.of(OccupancyGrid(cells, resolution_m=0.2)))
    >>> neighbour_graph(places_between(gates, np.zeros(len(gates), bool))).edges.tolist()
    [[0, 1]]
    """
    resolution_m = places.gates.segmentation.watershed.grid.resolution_m
    pairs, shared_m = shared_walls(places.segments.raster(), resolution_m)
    by_gate = np.sort(places.gate_places[places.parting], axis=1)
    both = np.concatenate([pairs[shared_m >= LEAST_SHARED_M], by_gate])
    return LabelGraph.from_edges(places.count, np.unique(both, axis=0))


def shared_walls(
    place: NDArray[np.int32], resolution_m: float, *, widest_wall_m: float = WIDEST_WALL_M
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """(P, 2) pairs of places with a wall between them, and (P,) the length in metres they share.

    Along every row and column of the map, two consecutive places at most ``widest_wall_m`` apart
    share one side of a cell. Walls along the axes of the map have their true length, oblique ones
    up to 1.41 times their length.

    Parameters
    ----------
    place : (H, W) int32
        The place of each cell, -1 for none.
    resolution_m : float
    widest_wall_m : float
    """
    reach = int(widest_wall_m / resolution_m + 1e-6) + 1
    runs = [np.empty((0, 2), np.int32)]
    for raster in (place, place.T):
        width = raster.shape[1]
        at = np.flatnonzero(raster >= 0)
        here = np.ascontiguousarray(raster).reshape(-1)[at]
        step = np.diff(at)
        same_line = at[1:] // width == at[:-1] // width
        crossed = (here[1:] != here[:-1]) & same_line & (step <= reach)
        runs.append(np.sort(np.column_stack([here[:-1], here[1:]])[crossed], axis=1))
    pairs, number = np.unique(np.concatenate(runs), axis=0, return_counts=True)
    return pairs, number.astype(np.float64) * resolution_m
