"""The relevant part of a mapped raster: the extent of known cells, and the connected space."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.maps.components import connected_components
from pgm_places.maps.occupancy_grid import UNKNOWN


def mapped_span(cells: NDArray[np.int8], margin: int) -> slice:
    """The extent of rows with known cells, with a margin."""
    known = np.flatnonzero((cells != UNKNOWN).any(axis=1))
    return slice(max(0, known[0] - margin), known[-1] + 1 + margin)


def main_component(free: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(H, W) the largest piece of free space whose cells touch by their sides."""
    return connected_components(free, connectivity=4).largest
