"""Doorways of labels as rectangles, against a reference that asks each cell by itself."""

import numpy as np
import pytest

from pgm_places.labelling.places import doorways_as_rectangles
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.spaces.doorways import Doorways
from pgm_places.spaces.gates import Gate

ROOM, CORRIDOR, DOORWAY = range(3)
SIDE_M = 0.1


def floor() -> tuple[OccupancyGrid, np.ndarray]:
    """Two rooms of 3 m with a wall between, open over 1 m, and a blob of doorway around that."""
    cells = np.zeros((30, 61), np.int8)
    cells[:, 30] = 100
    cells[10:20, 30] = 0
    labels = np.where(np.arange(61) < 30, ROOM, CORRIDOR).astype(np.int16)
    labels = np.where(cells == 0, labels, np.int16(-1))
    r, c = np.indices(cells.shape)
    labels[((r - 14.5) ** 2 + (c - 30) ** 2 < 6.5**2) & (cells == 0)] = DOORWAY
    return OccupancyGrid(cells, SIDE_M), labels


def doorways(grid: OccupancyGrid, heading_rad: float = 0.0) -> Doorways:
    gate = Gate((3.05, 1.5), heading_rad, width_m=1.0, depth_m=0.1)
    place = np.where(np.arange(61) < 30, 0, 1) * np.ones(grid.shape, np.int32)
    return Doorways(grid, (gate,), np.array([0.9]), place.astype(np.int32))


@pytest.mark.parametrize("depth_m", [0.4, 0.84])
@pytest.mark.parametrize("heading_rad", [0.0, 0.3])
def test_the_doorway_is_the_rectangle_and_the_rest_of_the_blob_what_lies_around(
    depth_m: float, heading_rad: float
) -> None:
    grid, labels = floor()
    found = doorways_as_rectangles(
        labels, grid, doorways(grid, heading_rad), DOORWAY, depth_m=depth_m
    )
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    for row, column in np.argwhere(labels >= 0):
        x, y = (column + 0.5) * SIDE_M - 3.05, (row + 0.5) * SIDE_M - 1.5
        along, across = abs(cos * x + sin * y), abs(-sin * x + cos * y)
        is_doorway = along <= depth_m / 2 + 1e-6 and across <= 0.5 + SIDE_M + 1e-6
        assert (found[row, column] == DOORWAY) == is_doorway, (row, column)
        if not is_doorway and column != 30:
            assert found[row, column] == (ROOM if column < 30 else CORRIDOR)
    assert (found[labels < 0] == -1).all()


def test_a_gate_without_labelled_doorways_has_its_rectangle_too() -> None:
    grid, labels = floor()
    rooms = np.where(labels == DOORWAY, np.int16(ROOM), labels)
    found = doorways_as_rectangles(rooms, grid, doorways(grid), DOORWAY)
    assert (found[:, 30][labels[:, 30] >= 0] == DOORWAY).all()


def test_the_rectangle_stays_on_its_side_of_a_wall_close_by() -> None:
    grid, labels = floor()
    cells = grid.cells.copy()
    cells[:, 33] = 100  # 0.3 m behind the opening
    near = OccupancyGrid(cells, SIDE_M)
    found = doorways_as_rectangles(
        np.where(near.free, labels, np.int16(-1)), near, doorways(near), DOORWAY, depth_m=1.2
    )
    assert (found[12:18, 31:33] == DOORWAY).all() and (found[12:18, 24:30] == DOORWAY).all()
    touched = found[:, 34:] != np.where(near.free, labels, np.int16(-1))[:, 34:]
    assert not touched.any()


def test_fixed_cells_keep_their_labels() -> None:
    grid, labels = floor()
    fixed = np.zeros(grid.shape, np.bool_)
    fixed[14, 28] = fixed[9, 27] = True  # inside the rectangle, and of the blob beside it
    labels[14, 28] = ROOM
    found = doorways_as_rectangles(labels, grid, doorways(grid), DOORWAY, depth_m=0.4, fixed=fixed)
    assert found[14, 28] == ROOM and found[9, 27] == labels[9, 27] == DOORWAY
