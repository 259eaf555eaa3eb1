"""A map with the cells of a model: coarsened or refined, within limits, and what is to be said."""

import numpy as np

from pgm_places.errors import MapError
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.maps.coarsening import coarsen, refine, refined_shape
from pgm_places.maps.occupancy_grid import OccupancyGrid

__all__ = ["SAME_RESOLUTION", "at_model_resolution"]

SAME_RESOLUTION = 0.02
"""Resolutions that differ by less than this share are taken as equal."""

MAX_REFINED_CELLS = 100_000_000
"""As many as of the largest map whose labelling is measured: 500 x 500 m with cells of 5 cm. A map
that has as many itself is no slip of its maker; one of half a metre that is refined may be."""


def at_model_resolution(
    labeler: PlaceLabeler, grid: OccupancyGrid, *, max_cells: int | None = None
) -> tuple[OccupancyGrid, list[str]]:
    """The map with the model's cells, and what there is to say about it.

    Parameters
    ----------
    labeler : PlaceLabeler
    grid : OccupancyGrid
    max_cells : int, optional
        No map is refined to more cells than this; ``MAX_REFINED_CELLS`` by default.

    Raises
    ------
    MapError
        The map has no free cell, or none that is left at the model's resolution, or would have to
        be refined to too many cells.
    """
    if not grid.free.any():
        raise MapError(
            "the map has no free cell to label; look at its thresholds ('pgm-places doctor MAP')"
        )
    wanted = labeler.resolution_m_
    if abs(grid.resolution_m / wanted - 1) < SAME_RESOLUTION:
        return grid, []
    note = f"the map has cells of {grid.resolution_m:g} m, the model was trained at {wanted:g} m: "
    if wanted > grid.resolution_m:
        used = coarsen(grid, wanted)
        how = f"coarsened by {used.resolution_m / grid.resolution_m:g}"
        back = "labels are painted back"
    else:
        _check_size(grid, wanted, max_cells or MAX_REFINED_CELLS, note)
        used = refine(grid, wanted)
        how = f"split by {grid.resolution_m / used.resolution_m:g}"
        back = "each cell takes the most frequent label of its parts"
    n_free = int(np.count_nonzero(used.free))
    if n_free == 0:
        raise MapError(
            f"no free cell is left where the map's cells of {grid.resolution_m:g} m are joined to "
            f"the model's of {used.resolution_m:g} m; look at its thresholds ('pgm-places doctor "
            "MAP'), or use a model of a finer resolution"
        )
    note += (
        f"{how}, from {grid.cells.size:,} cells to {used.cells.size:,}, {n_free:,} of them free "
        f"to be labelled; {back}"
    )
    return used, [note]


def _check_size(grid: OccupancyGrid, wanted_m: float, max_cells: int, note: str) -> None:
    height, width = refined_shape(grid, wanted_m)
    if height * width > max_cells:
        raise MapError(
            f"{note}its {grid.cells.size:,} cells would be split into {height * width:,}, more "
            f"than {max_cells:,}; crop the map, use a model of a coarser resolution, or raise "
            "max_cells (label --max-cells) and expect it to take long"
        )
