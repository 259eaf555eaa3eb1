"""The picture of a place that looks like three rooms."""

import numpy as np

from experiments.pictures.kept import NAMES, keep
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, OccupancyGrid
from pgm_places.pictures.topology_pictures import topology_drawing
from pgm_places.topology.from_labels import topological_map

CORRIDOR, ROOM, DOORWAY = (NAMES.index(name) for name in ("corridor", "room", "doorway"))
RESOLUTION_M, DOOR_M = 0.05, 0.9
WIDTHS_M, DEPTH_M, CORRIDOR_M, WALL_M = (4.5, 3.5, 5.0, 4.0), 4.0, 2.0, 0.2
MISSED = (0, 1)
"""The walls with a doorway that is labelled as room."""


def hidden() -> None:
    """Four rooms along a corridor, three of them labelled as one."""

    def cells(*metres: float) -> slice:
        return slice(*(round(value / RESOLUTION_M) for value in metres))

    wide = sum(WIDTHS_M) + (len(WIDTHS_M) + 1) * WALL_M
    high = DEPTH_M + CORRIDOR_M + 3 * WALL_M
    labels = np.full((round(high / RESOLUTION_M), round(wide / RESOLUTION_M)), -1, np.int16)
    labels[cells(WALL_M, WALL_M + CORRIDOR_M), cells(WALL_M, wide - WALL_M)] = CORRIDOR
    low, left = CORRIDOR_M + 2 * WALL_M, WALL_M
    for number, width in enumerate(WIDTHS_M):
        labels[cells(low, low + DEPTH_M), cells(left, left + width)] = ROOM
        if number not in (1, 2):  # the others are reached through rooms
            door = left + width / 2 - DOOR_M / 2
            labels[cells(low - WALL_M, low), cells(door, door + DOOR_M)] = DOORWAY
        left += width + WALL_M
        if number in MISSED:
            door = low + 1.0
            labels[cells(door, door + DOOR_M), cells(left - WALL_M, left)] = ROOM
    grid = OccupancyGrid(np.where(labels >= 0, FREE, OCCUPIED).astype(np.int8), RESOLUTION_M)
    drawing = topology_drawing(grid, topological_map(grid, labels, NAMES))
    image = drawing.image
    keep("hidden_rooms", image.crop((0, 0, image.width, image.height // 2 - 27)))
