"""Edits: what a person does in the browser, as cells and a label to paint them with."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.maps.components import connected_components
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.studio.runs import runs_of_mask
from pgm_places.topology.place_edits import doorways_between
from pgm_places.topology.topological_map import TopologicalMap


def fill_cells(
    grid: OccupancyGrid,
    paint: NDArray[np.int16],
    topology: TopologicalMap | None,
    point: tuple[float, float],
    doorway: NDArray[np.bool_] | None = None,
) -> NDArray[np.int64]:
    """(n, 3) runs of the cells that a fill at a point (x, y in cells) covers.

    Those of the region there; where no regions are known, the free cells that are connected to it
    and have the same paint, or as little. A region reaches up to its gates, and so do half of
    their doorways: cells (H, W) that are labelled ``doorway`` stay so, unless the region is one.

    Raises
    ------
    InputError
        The point is not on a free cell.
    """
    row, column = _cell(grid, point)
    region = 0 if topology is None else int(topology.region[row, column])
    if topology is not None and region:
        inside = topology.region == region
        is_doorway = topology.place(region).label == topology.doorway_label
        if doorway is not None and not is_doorway and not doorway[inside].all():
            inside &= ~doorway
        return runs_of_mask(inside)
    alike = grid.free & (paint == paint[row, column])
    pieces = connected_components(alike, connectivity=4).piece
    return runs_of_mask(pieces == pieces[row, column])


def merge_cells(topology: TopologicalMap, first: int, second: int) -> tuple[NDArray[np.int64], str]:
    """Runs of the cells that must change for two places to become one, and the label to give them.

    Both take the label of the larger one, and so do doorways that lead from one to the other and
    to nowhere else.

    Raises
    ------
    InputError
        The places are one, or have no border and no doorway between them.
    """
    one, other = topology.place(first), topology.place(second)
    merging = (one, other, *doorways_between(topology, one, other))
    larger = max((one, other), key=lambda place: place.area_m2)
    mask = np.isin(topology.region, [place.id for place in merging])
    return runs_of_mask(mask), larger.label


def _cell(grid: OccupancyGrid, point: tuple[float, float]) -> tuple[int, int]:
    column, row = (int(np.floor(value)) for value in point)
    inside = 0 <= row < grid.shape[0] and 0 <= column < grid.shape[1]
    if not inside or not grid.free[row, column]:
        raise InputError("choose a free cell of the map")
    return row, column
