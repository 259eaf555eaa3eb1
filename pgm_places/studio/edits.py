"""Edits: what a person does in the browser, as cells and a label to paint them with."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.maps.components import connected_components
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.topology.place_edits import doorways_between
from pgm_places.topology.topological_map import TopologicalMap

__all__ = ["fill_cells", "merge_cells"]


def fill_cells(
    grid: OccupancyGrid,
    paint: NDArray[np.int16],
    topology: TopologicalMap | None,
    point: tuple[float, float],
) -> NDArray[np.int64]:
    """Flat indices of the cells that a fill at a point (x, y in cells) covers.

    Those of the region there; where no regions are known, the free cells that are connected to it
    and have the same paint, or as little.

    Raises
    ------
    InputError
        The point is not on a free cell.
    """
    row, column = _cell(grid, point)
    region = 0 if topology is None else int(topology.region[row, column])
    if topology is not None and region:
        return _flat(topology.cells(region), grid)
    alike = grid.free & (paint == paint[row, column])
    pieces = connected_components(alike, connectivity=4).piece
    return np.flatnonzero(pieces == pieces[row, column])


def merge_cells(topology: TopologicalMap, first: int, second: int) -> tuple[NDArray[np.int64], str]:
    """The cells that must change for two places to become one, and the label to give them.

    Both take the label of the larger one, and so do doorways that lead from one to the other and
    to nowhere else.

    Raises
    ------
    InputError
        The places are one, or have no border and no doorway between them.
    """
    one, other = topology.place(first), topology.place(second)
    merging = (one, other, *doorways_between(topology, one, other))
    cells = [_flat(topology.cells(place.id), topology.grid) for place in merging]
    larger = max((one, other), key=lambda place: place.area_m2)
    return np.sort(np.concatenate(cells)), larger.label


def _cell(grid: OccupancyGrid, point: tuple[float, float]) -> tuple[int, int]:
    column, row = (int(np.floor(value)) for value in point)
    inside = 0 <= row < grid.shape[0] and 0 <= column < grid.shape[1]
    if not inside or not grid.free[row, column]:
        raise InputError("choose a free cell of the map")
    return row, column


def _flat(cells_rc: NDArray[Any], grid: OccupancyGrid) -> NDArray[np.int64]:
    return np.asarray(cells_rc[:, 0] * grid.shape[1] + cells_rc[:, 1], np.int64)
