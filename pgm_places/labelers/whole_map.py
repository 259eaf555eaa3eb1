"""What was found on a map's known part, on the whole map again."""

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
    """The window that is to be labelled in place of a map, by a model of some resolution.

    It begins where the blocks begin that the whole map would be coarsened by.
    """
    is_finer = grid.resolution_m < resolution_m
    multiple = coarsening_factor(grid, resolution_m).numerator if is_finer else 1
    return KnownWindow.of(grid, multiple=multiple)


def whole_layout(layout: GridLayout, window: KnownWindow, grid: OccupancyGrid) -> GridLayout:
    """The same nodes, in the same order, on the raster of the whole map or its coarsened form."""
    source, part = layout.source, window.part_shape
    if layout.shape == part:
        return GridLayout.of_mask(freeze(window.paste(layout.mask(), False)), grid)
    assert isinstance(source, OccupancyGrid)  # coarsened from a map
    coarse = window.coarser(source.resolution_m / grid.resolution_m)
    cells = coarse.paste(source.cells, UNKNOWN)
    whole = OccupancyGrid(cells, source.resolution_m, grid.origin_xy_m, grid.yaw_rad)
    return GridLayout.of_mask(freeze(coarse.paste(layout.mask(), False)), whole)


def whole_doorways(
    doorways: Doorways | None, part: OccupancyGrid, window: KnownWindow, grid: OccupancyGrid
) -> Doorways | None:
    """Doorways found on a map's part, with the places between them on the raster of the map."""
    if doorways is None:
        return None
    place = window.paste(doorways.place_on(part), -1)
    return replace(doorways, grid=grid, place=place)


def whole_unentered(unentered: Unentered | None, window: KnownWindow) -> Unentered | None:
    """The same free space on the whole map."""
    if unentered is None:
        return None
    return replace(unentered, cells=np.asarray(window.paste(unentered.cells, False)))
