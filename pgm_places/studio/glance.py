"""A first glance: labels from one look at a map, to be seen until it has been labelled."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pgm_places.graph.bands import bands_of_rows
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.maps.occupancy_grid import OccupancyGrid


def glance(
    labeler: PlaceLabeler | None, grid: OccupancyGrid, n_threads: int | None = None
) -> NDArray[np.int16] | None:
    """(H, W) what one network sees from one side, -1 for none; None without networks.

    It takes a sixteenth of what all views of four networks take, and no scans at all.
    """
    floor = None if labeler is None else labeler.unary_model_.floor
    if floor is None or labeler is None:
        return None
    one = replace(floor, networks=floor.networks[:1], views_per_network=1)
    seen = one.scores(grid, n_threads)
    labels = np.full(grid.shape, -1, np.int16)
    for rows in bands_of_rows(grid.shape):
        cells = np.argwhere(grid.free[rows]) + np.array([rows.start, 0])
        if len(cells):
            labels[tuple(cells.T)] = one.evidence(seen, cells).argmax(axis=1)
    return labels
