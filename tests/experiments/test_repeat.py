"""Maps of one floor: registered to each other, their labels compared, open spaces decided once."""

import numpy as np
import pytest

from experiments.repeat import OnReference, Transform, pairs, registered
from experiments.robot_maps.open_spaces import CORRIDOR, ROOM, decided_once, open_spaces
from pgm_places.datasets import generate_building
from pgm_places.maps.occupancy_grid import OccupancyGrid


def test_a_turned_and_shifted_copy_is_laid_on_its_map() -> None:
    made = generate_building(3, size="small", resolution_m=0.1)
    reference, labels = made.grid, made.labels.astype(np.int64)
    other = OccupancyGrid(np.rot90(reference.cells).copy(), 0.1, (7.0, -2.0))
    transform = registered(reference, other)
    assert round(transform.degrees) % 90 == 0
    turned = np.rot90(labels).copy()
    maps = [
        OnReference.of("one", reference, labels, reference, Transform()),
        OnReference.of("other", other, turned, reference, transform),
    ]
    [(one, name, walls, free, alike)] = pairs(maps, 0.1)
    assert (one, name) == ("one", "other")
    assert min(walls, free, alike) > 0.95
    turned[turned == 1] = 0
    maps[1] = OnReference.of("other", other, turned, reference, transform)
    [(*_, less)] = pairs(maps, 0.1)
    assert less == pytest.approx(alike - np.mean(labels[labels >= 0] == 1), abs=0.06)


def test_an_open_space_takes_the_label_of_most_of_its_cells() -> None:
    cells = np.full((60, 120), 100, np.int8)
    cells[5:55, 5:60] = cells[25:40, 60:115] = 0  # a hall of 5 m, a corridor of 1.5 m
    cells[30, 30] = 100  # a pillar
    grid = OccupancyGrid(cells, 0.1)
    space = open_spaces(grid, 3.0)
    assert set(np.unique(space[grid.free])) == {-1, 0}
    assert (space[10:50, 10:55][grid.free[10:50, 10:55]] == 0).all()
    assert (space[:, 70:] == -1).all()
    labels = np.where(grid.free, CORRIDOR, -1)
    labels[:, :40][labels[:, :40] >= 0] = ROOM
    labels[5, 5] = 2  # doorways stay
    decided = decided_once(labels, open_spaces(grid, 1.0))
    assert decided[5, 5] == 2
    decided = decided_once(labels, space)
    assert (decided[10:50, 10:55][grid.free[10:50, 10:55]] == ROOM).all()
    assert (decided[:, 70:] == labels[:, 70:]).all()
