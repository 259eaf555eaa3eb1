"""Which cells of a raster or lattice become nodes."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import integer_array
from pgm_places.errors import InputError
from pgm_places.graph.layout import CellMap, GridLayout

__all__ = ["grid_layout", "lattice_mask"]


def grid_layout(grid: CellMap | ArrayLike, mask: ArrayLike | None) -> GridLayout:
    """The free cells of a map, or the true ones of a mask (H, W), that lie in another mask."""
    source = grid if isinstance(grid, CellMap) else None
    free = np.asarray(grid) if source is None else source.free
    if source is None and (free.ndim != 2 or free.dtype != np.bool_):
        raise InputError(
            "from_grid takes an OccupancyGrid or a 2-D boolean mask, got an array of shape "
            f"{free.shape} and dtype {free.dtype}"
        )
    if mask is not None:
        chosen = np.asarray(mask, np.bool_)
        if chosen.shape != free.shape:
            raise InputError(f"mask must have the map's shape {free.shape}, got {chosen.shape}")
        free = free & chosen
    return GridLayout.of_mask(free) if source is None else GridLayout.of_map(source, free)


def lattice_mask(nodes: tuple[int, ...] | ArrayLike) -> NDArray[np.bool_]:
    """The cells of a lattice that are nodes, from its sizes or from a mask of any dimension."""
    if isinstance(nodes, tuple):
        sizes = integer_array("the lattice's sizes", nodes, ("D",), low=0, high=2**31)
        return np.ones(sizes, np.bool_)
    mask = np.asarray(nodes)
    if mask.dtype != np.bool_ or mask.ndim == 0:
        raise InputError(
            "from_lattice takes a tuple of sizes or a boolean mask, got an array of shape "
            f"{mask.shape} and dtype {mask.dtype}"
        )
    return mask
