"""Transfer of labelling results from the known window of a map to the complete map."""

from dataclasses import replace

import numpy as np

from pgm_places._checks import freeze
from pgm_places.graph.layout import GridLayout
from pgm_places.maps.coarsening import coarsening_factor
from pgm_places.maps.known_window import KnownWindow
from pgm_places.maps.occupancy_grid import UNKNOWN, OccupancyGrid
from pgm_places.spaces.doorways import Doorways
from pgm_places.spaces.unentered import Unentered


def window_to_label(grid: OccupancyGrid, resolution_m: float) -> KnownWindow | None:
    """The known window of a map to label instead of the map, or None.

    It is aligned with the blocks that the complete map would be coarsened by.
    """
    is_finer = grid.resolution_m < resolution_m
    multiple = coarsening_factor(grid, resolution_m).numerator if is_finer else 1
    return KnownWindow.of(grid, multiple=multiple)


def whole_layout(layout: GridLayout, window: KnownWindow, grid: OccupancyGrid) -> GridLayout:
    """The nodes of a window's layout on the raster of the complete map or its coarsened version."""
    source = layout.source
    if layout.shape == window.part_shape:
        return GridLayout.of_mask(freeze(window.paste(layout.mask(), False)), grid)
    assert isinstance(source, OccupancyGrid)
    coarse = window.coarser(source.resolution_m / grid.resolution_m)
    cells = coarse.paste(source.cells, UNKNOWN)
    whole = OccupancyGrid(cells, source.resolution_m, grid.origin_xy_m, grid.yaw_rad)
    return GridLayout.of_mask(freeze(coarse.paste(layout.mask(), False)), whole)


def whole_doorways(
    doorways: Doorways | None, part: OccupancyGrid, window: KnownWindow, grid: OccupancyGrid
) -> Doorways | None:
    """Doorways of a window, with the places between them on the raster of the complete map."""
    if doorways is None:
        return None
    place = window.paste(doorways.place_on(part), -1)
    return replace(doorways, grid=grid, place=place)


def whole_unentered(unentered: Unentered | None, window: KnownWindow) -> Unentered | None:
    """Unreachable space of a window on the raster of the complete map."""
    if unentered is None:
        return None
    return replace(unentered, cells=np.asarray(window.paste(unentered.cells, False)))
