"""What is put into the floors that networks learn from."""

from collections.abc import Callable

import numpy as np
import pytest

pytest.importorskip("cv2")
from pgm_places.training.alterations import (
    Piece,
    coarsen,
    grey_walls,
    hang_passage_doors,
    leave_one_room,
    put_up_desks,
    put_up_shelves,
)

ROOM, DOORWAY, CORRIDOR = 2, 3, 1
Alteration = Callable[[Piece, np.random.Generator], None]


def _floor(label: int, height: int, width: int) -> Piece:
    """Free space of one label within walls, in the middle of what is unknown."""
    free, occupied, labels = (np.zeros((320, 320), np.uint8) for _ in range(3))
    rows, columns = (slice(160 - n // 2, 160 + n // 2) for n in (height, width))
    occupied[rows.start - 1 : rows.stop + 1, columns.start - 1 : columns.stop + 1] = 255
    occupied[rows, columns] = 0
    free[rows, columns], labels[rows, columns] = 255, label
    return Piece(free, occupied, labels)


@pytest.mark.parametrize("seed", range(8))
def test_doors_across_a_corridor_run_from_jamb_to_jamb(seed: int) -> None:
    free, occupied, labels = piece = _floor(CORRIDOR, 20, 260)
    before = occupied.copy()
    hang_passage_doors(piece, np.random.default_rng(seed))
    doors = labels == DOORWAY
    assert doors.any()
    columns = np.flatnonzero(doors.any(axis=0))
    assert (before[:, columns] < 255).any(axis=0).all()  # within the corridor
    assert (free[doors] > 0).all()
    new = (occupied > 0) & (before == 0)
    assert new.any()
    assert (free[new] == 0).all()
    assert (labels[new] == 0).all()
    blocked = (free[150:170, 30:290] == 0).all(axis=0)
    assert not blocked.any()  # one can still pass


def test_no_doors_across_a_hall() -> None:
    piece = _floor(CORRIDOR, 120, 120)
    hang_passage_doors(piece, np.random.default_rng(0))
    assert not (piece.labels == DOORWAY).any()


@pytest.mark.parametrize(("put_up", "least"), [(put_up_shelves, 0.05), (put_up_desks, 0.001)])
@pytest.mark.parametrize("seed", range(4))
def test_space_between_furniture_stays_room(put_up: Alteration, least: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(8):  # a room is left empty at times
        free, _, labels = piece = _floor(ROOM, 120, 200)
        put_up(piece, rng)
        if (free[100:220, 60:260] == 0).any():
            break
    furniture = free[100:220, 60:260] == 0
    assert least < furniture.mean() < 0.8
    assert set(np.unique(labels[free > 0])) == {ROOM}
    assert (labels[free == 0] == 0).all()


def test_desks_are_occupied() -> None:
    free, occupied, _ = piece = _floor(ROOM, 120, 200)
    for seed in range(8):  # a room is left empty at times
        put_up_desks(piece, np.random.default_rng(seed))
    desks = free[100:220, 60:260] == 0
    assert desks.any()
    assert (occupied[100:220, 60:260][desks] == 255).all()


@pytest.mark.parametrize("seed", range(4))
def test_coarse_cells_are_free_or_not_and_keep_walls_closed(seed: int) -> None:
    piece = _floor(ROOM, 60, 60)
    piece.wall(np.array([135.0, 135.0]), np.array([180.0, 171.0]), np.random.default_rng(0))
    before = piece.occupied.copy()
    coarsen(piece, np.random.default_rng(seed))
    free, occupied, _ = piece
    assert set(np.unique(free)) == {0, 255}
    assert (occupied[before > 0] == 255).all()
    assert (free[occupied > 0] == 0).all()


@pytest.mark.parametrize("seed", range(4))
def test_grey_walls_are_neither_free_nor_occupied(seed: int) -> None:
    free, occupied, labels = piece = _floor(ROOM, 60, 60)
    was_wall, was_free = occupied > 0, free > 0
    grey_walls(piece, np.random.default_rng(seed))
    assert (occupied[was_wall] == 0).any()
    assert not occupied[~was_wall].any()
    assert not free[was_wall].any()
    assert (free[was_free] > 0).all()
    assert (labels[was_free] == ROOM).all()


def test_small_rooms_have_no_shelves() -> None:
    piece = _floor(ROOM, 40, 40)
    put_up_shelves(piece, np.random.default_rng(0))
    assert (piece.free > 0).sum() == 40 * 40


def test_one_room_is_left_of_a_building() -> None:
    free, _, labels = piece = _floor(ROOM, 60, 60)
    free[185:190, 130:190], labels[185:190, 130:190] = 255, DOORWAY
    free[190:220, 60:260], labels[190:220, 60:260] = 255, CORRIDOR
    leave_one_room(piece, np.random.default_rng(0))
    assert set(np.unique(labels)) == {0, ROOM, DOORWAY}
    assert not free[195:].any()
