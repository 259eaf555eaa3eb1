"""A floor small enough to think through: a corridor, three rooms above it, a doorway to each."""

import numpy as np

from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, OccupancyGrid
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.topological_map import TopologicalMap

NAMES = ("corridor", "room", "doorway")


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
