"""A floor small enough to think through: a corridor, three rooms above it, a doorway to each."""

import numpy as np
from hypothesis import strategies as st

from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, OccupancyGrid
from pgm_places.spaces.doorways import Doorways
from pgm_places.spaces.gates import gate_candidates
from pgm_places.spaces.places import places_between
from pgm_places.spaces.segmentation import Segmentation
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.topological_map import TopologicalMap
from tests.spaces.floors import grid_of, two_rooms
from tests.strategies import varied_arrays

NAMES = ("corridor", "room", "doorway")

rasters = varied_arrays(
    np.int16, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=st.integers(-1, 2)
)
"""Hypothesis: small rasters of labels, -1 for none."""


def floor_labels() -> np.ndarray:
    """Cells of 0.5 m: corridor in rows 1 to 3, rooms in rows 5 to 9, doorways in row 4."""
    labels = np.full((11, 26), -1, np.int16)
    labels[1:4, 1:25] = 0
    for left in (1, 9, 17):
        labels[5:10, left : left + 7] = 1
        labels[4, left + 2 : left + 5] = 2
    return labels


def floor_grid(labels: np.ndarray, **frame: object) -> OccupancyGrid:
    cells = np.where(labels >= 0, FREE, OCCUPIED).astype(np.int8)
    return OccupancyGrid(cells, **{"resolution_m": 0.5, **frame})  # type: ignore[arg-type]


def floor_map(**frame: object) -> TopologicalMap:
    labels = floor_labels()
    return topological_map(floor_grid(labels, **frame), labels, NAMES)


def gates_of(grid: OccupancyGrid, probability: float | list[float] = 0.9) -> Doorways:
    """The doorways of a map whose candidates have these probabilities."""
    gates = gate_candidates(Segmentation.of(grid))
    each = np.broadcast_to(np.asarray(probability), len(gates)).astype(np.float64)
    return Doorways.of(places_between(gates, each), each)


def gated_floor_map(**frame: object) -> TopologicalMap:
    """Two rooms of 4 m and the door between them, which is a gate; nothing is painted there."""
    grid = OccupancyGrid(grid_of(two_rooms()).cells, **{"resolution_m": 0.1, **frame})  # type: ignore[arg-type]
    labels = np.where(grid.free, np.int16(1), np.int16(-1))
    return topological_map(grid, labels, NAMES, doorways=gates_of(grid))
