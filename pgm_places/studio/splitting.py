"""Splitting: the doorways by which a place that looks like several becomes several."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.studio.door_line import Limits
from pgm_places.studio.strokes import Stroke, stroke_cells
from pgm_places.topology.cuts import Line

HALF_DEPTH_M = 0.12


def doorways_along(lines: Sequence[Line], grid: OccupancyGrid, limits: Limits) -> NDArray[np.int64]:
    """(n, 3) runs of the cells of doorways along lines."""
    radius = max(1.0, HALF_DEPTH_M / grid.resolution_m)
    found = [np.empty((0, 3), np.int64)]
    for line in lines:
        points = tuple(map(tuple, grid.points_at_m(line).tolist()))
        stroke = Stroke(tool="doorway", points=points, radius=radius)
        found.append(stroke_cells(stroke, grid, limits))
    return np.concatenate(found)
