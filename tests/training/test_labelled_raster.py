"""Labelled maps as the network learns from them."""

import numpy as np

from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.training.labelled_raster import CIRCULATION, labelled_raster


def known(labels: list[list[int]], resolution_m: float = 0.05) -> LabelledMap:
    grid = OccupancyGrid(np.zeros(np.shape(labels), np.int8), resolution_m)
    return LabelledMap(grid, np.array(labels, np.int16))


def test_the_most_frequent_label_of_a_cell_counts() -> None:
    item = known([[1, 1, 0, 0], [1, 2, 0, -1], [2, 2, -1, -1], [-1, -1, -1, -1]])
    found = labelled_raster(item, ("corridor", "room", "doorway", "hall"))
    assert found["lab"].tolist() == [[2, 1], [3, 0]]
    assert (found["free"] == 255).all()
    assert not found["occ"].any()


def test_corridors_may_be_halls_where_halls_have_no_label() -> None:
    found = labelled_raster(known([[0, 0], [0, 0]], 0.1), ("corridor", "room", "doorway"))
    assert (found["lab"] == CIRCULATION).all()


def test_labels_that_the_network_does_not_know_are_none() -> None:
    found = labelled_raster(known([[0, 1], [2, 2]], 0.1), ("kitchen", "room", "hall"))
    assert found["lab"].tolist() == [[0, 2], [4, 4]]


def test_sides_become_even() -> None:
    found = labelled_raster(known([[0, 0, 0]] * 5, 0.1), ("room", "corridor"))
    assert all(array.shape == (6, 4) for array in found.values())
    assert found["lab"][5].tolist() == found["free"][5].tolist() == [0, 0, 0, 0]
