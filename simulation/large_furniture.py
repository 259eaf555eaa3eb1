"""Furniture that looks like walls: wardrobes, beds, counters, benches, screens, cabinets."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pgm_places.simulation.floor_plan import FloorPlan, Frontage, Rect
from pgm_places.simulation.furniture import FULL, Mover
from pgm_places.simulation.portable_random import Dice

_LARGE_M2 = 30
"""Larger rooms are furnished as laboratories and offices are, smaller ones as rooms of homes."""

_AISLE_CM = 90
"""Width of the aisle between a bench and the wall."""


def furnish_largely(
    dice: Dice, plan: FloorPlan, solid: NDArray[np.bool_], amounts: Sequence[int]
) -> None:
    """Put large pieces into the rooms of ``solid`` (H, W), without blocking a door.

    ``amounts`` are the amounts in each room, in thousandths of a typical one.
    """
    put = Mover.of_plan(dice.scale, plan, solid)
    for room, amount in zip(plan.rooms, amounts, strict=True):
        columns, rows = room.size
        square_metres = columns * rows // dice.cells(100) ** 2
        if square_metres < _LARGE_M2:
            _furnish_small(dice, room, put, (2 + square_metres // 7) * amount // FULL)
        else:
            _furnish_large(dice, room, put, square_metres * amount // FULL)


def _furnish_small(dice: Dice, room: Rect, put: Mover, n_pieces: int) -> None:
    """Wardrobes, beds, sofas and counters along the walls."""
    for _ in range(n_pieces):
        length, depth = dice.choice(_ALONG_WALLS)
        _at_wall(dice, room, put, dice.length(*length), dice.length(*depth))


_ALONG_WALLS = (
    ((80, 250), (40, 65)),  # a wardrobe, a shelf
    ((120, 320), (58, 65)),  # a kitchen counter
    ((90, 180), (190, 210)),  # a bed, its head at the wall
    ((190, 210), (90, 140)),  # a bed along the wall
    ((150, 240), (80, 100)),  # a sofa
)
"""Lengths along the wall, and depths, in centimetres."""


def _furnish_large(dice: Dice, room: Rect, put: Mover, square_metres: int) -> None:
    """Rows of benches, islands of desks, cabinets along the walls, screens that stand out."""
    kind = dice.integer(0, 3)
    if kind == 0:
        _rows_of_benches(dice, room, put)
    elif kind == 1:
        for _ in range(square_metres // 14):
            _island(dice, room, put)
    for _ in range(square_metres // 12):
        length, depth = dice.length(80, 320), dice.length(40, 90)
        _at_wall(dice, room, put, length, depth)
    for _ in range(dice.integer(0, square_metres // 25)):
        length, depth = dice.cells(8), dice.length(100, 350)
        _at_wall(dice, room, put, length, depth, beyond=dice.cells(120))


def _at_wall(
    dice: Dice, room: Rect, put: Mover, length: int, depth: int, *, beyond: int = 0
) -> None:
    """A piece with its back to a wall, in a corner as often as not; ``beyond`` stays free."""
    columns, rows = room.size
    along: Literal["x", "y"] = dice.choice(("x", "y"))
    long, deep = (columns, rows) if along == "x" else (rows, columns)
    at = dice.integer(0, max(0, long - length))
    at = dice.choice((0, max(0, long - length), at, at))
    if dice.chance(1, 2):
        side = Frontage(along, (room.x0, room.y0), 1, long, deep)
    else:
        corner = (room.x0, room.y1) if along == "x" else (room.x1, room.y0)
        side = Frontage(along, corner, -1, long, deep)
    if depth + beyond < deep:
        put(side.rect(at, at + length, 0, depth), room)


def _rows_of_benches(dice: Dice, room: Rect, put: Mover) -> None:
    """Benches side by side across the room, closed down to the floor or with gaps for legs."""
    columns, rows = room.size
    along: Literal["x", "y"] = "x" if columns > rows else "y"
    side = Frontage(along, (room.x0, room.y0), 1, max(room.size), min(room.size))
    aisle = dice.cells(_AISLE_CM)
    thick, pitch = dice.length(60, 160), dice.length(230, 420)
    piece, gap = dice.length(60, 500), dice.cells(dice.choice((5, 10, 40)))
    high = side.depth - dice.length(_AISLE_CM, 250)
    for start in range(aisle + pitch // 3, side.length - aisle - thick, pitch):
        for low in range(aisle, high, piece + gap):
            put(side.rect(start, start + thick, low, min(high, low + piece)), room)


def _island(dice: Dice, room: Rect, put: Mover) -> None:
    """Desks or machines that stand together, away from the walls."""
    aisle = dice.cells(_AISLE_CM)
    width, length = dice.length(80, 320), dice.length(70, 320)
    inner = room.grown(-aisle, -aisle)
    if inner.size[0] > width and inner.size[1] > length:
        x = dice.integer(inner.x0, inner.x1 - width)
        y = dice.integer(inner.y0, inner.y1 - length)
        put(Rect(x, y, x + width, y + length), room)
