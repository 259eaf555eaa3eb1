"""Furniture at the height of a laser: legs, boxes, cupboards, door leaves."""

from collections.abc import Sequence
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray

from pgm_places.simulation.floor_plan import Door, FloorPlan, Frontage, Rect
from pgm_places.simulation.portable_random import Dice, MetreScale

_SLANTS = ((0, 1), (0, 1), (-1, 2), (-1, 1), (1, 3), (1, 1))
"""Directions of a leaf from its hinge: (across the gap, into the room)."""


def hang_doors(dice: Dice, plan: FloorPlan, solid: NDArray[np.bool_]) -> None:
    """Draw the leaf of each door into ``solid`` (H, W), more or less open, never across the gap."""
    for door in plan.doors:
        if door.has_leaf and dice.chance(3, 4):
            _hang(dice, door, solid)


def _hang(dice: Dice, door: Door, solid: NDArray[np.bool_]) -> None:
    gap, (dx, dy) = door.gap, door.inward
    across, into = dice.choice(_SLANTS)
    columns, rows = gap.size
    width = rows if dx else columns
    hinge_low = dice.chance(1, 2)
    turn = 1 if hinge_low else -1
    if dx:
        x, y = (gap.x1 if dx > 0 else gap.x0 - 1), (gap.y0 if hinge_low else gap.y1 - 1)
        step = (dx * into, turn * across)
    else:
        x, y = (gap.x0 if hinge_low else gap.x1 - 1), (gap.y1 if dy > 0 else gap.y0 - 1)
        step = (turn * across, dy * into)
    reach = width * 2 // 3 if across and into == across else width
    longest = max(abs(step[0]), abs(step[1]))
    thick = max(1, dice.cells(10) // 2)
    for t in range(reach):
        column, row = x + t * step[0] // longest, y + t * step[1] // longest
        stop_x, stop_y = column + (thick if dy else 1), row + (thick if dx else 1)
        solid[max(row, 0) : stop_y, max(column, 0) : stop_x] = True


FULL = 1000
"""The amount of furniture of an office in use, in thousandths."""


def furnish(
    dice: Dice,
    plan: FloorPlan,
    solid: NDArray[np.bool_],
    *,
    in_rooms: Sequence[int] | None = None,
    in_corridors: int = FULL,
) -> None:
    """Put furniture into the rooms, and a little into the corridors, of ``solid`` (H, W).

    The way through each door stays free. ``in_rooms`` and ``in_corridors`` are the amounts in each
    room and in the corridors, in thousandths of what is usual.
    """
    put = Mover.of_plan(dice.scale, plan, solid)
    for index, room in enumerate(plan.rooms):
        _furnish_room(dice, room, put, FULL if in_rooms is None else in_rooms[index])
    for corridor in plan.corridors:
        for _ in range(max(corridor.size) * in_corridors // (FULL * dice.cells(900))):
            _along_wall(dice, corridor, put, (40, 120), (20, 35))
    for hall in plan.halls:
        _furnish_hall(dice, hall, put)


class Mover:
    """Puts pieces into a building, except pieces that would block a door."""

    def __init__(self, solid: NDArray[np.bool_], keep_free: NDArray[np.bool_]) -> None:
        self._solid = solid
        self._keep_free = keep_free

    @classmethod
    def of_plan(cls, scale: MetreScale, plan: FloorPlan, solid: NDArray[np.bool_]) -> Self:
        """A mover that keeps the way through each door of a plan free."""
        keep_free = np.zeros_like(solid)
        clear = scale.cells(90)
        for door in plan.doors:
            for part in (door.region(clear), door.gap.grown(1, 1)):
                keep_free[part.within(solid.shape).slices] = True
        return cls(solid, keep_free)

    def __call__(self, piece: Rect, room: Rect) -> bool:
        """Draw a piece within a room; False if it would block a door."""
        inside = piece.cut(room)
        if min(inside.size) < 1 or self._keep_free[inside.slices].any():
            return False
        self._solid[inside.slices] = True
        return True


def _furnish_room(dice: Dice, room: Rect, put: Mover, amount: int) -> None:
    if amount == 0:
        return
    columns, rows = room.size
    square_metres = columns * rows // dice.cells(100) ** 2

    def each(area_m2: int) -> range:
        return range((1 + square_metres // area_m2) * amount // FULL)

    for _ in each(7):
        _along_wall(dice, room, put, (40, 180), (25, 50))
    for _ in range(dice.integer(0, 2)):
        _pillar(dice, room, put)
    if square_metres > 28 and dice.chance(1, 2):
        _rows_of_tables(dice, room, put)
    else:
        for _ in each(9):
            _desk(dice, room, put)
    for _ in each(5):
        _thing(dice, room, put)


def _furnish_hall(dice: Dice, hall: Rect, put: Mover) -> None:
    """Benches along the walls, pillars, a counter, plants: much of a hall is empty."""
    square_metres = hall.size[0] * hall.size[1] // dice.cells(100) ** 2
    for _ in range(square_metres // 12):
        _along_wall(dice, hall, put, (60, 240), (35, 60))
    for _ in range(dice.integer(0, 1 + square_metres // 30)):
        x, y = _spot(dice, hall)
        side = dice.length(25, 60)
        put(Rect(x, y, x + side, y + side), hall)
    for _ in range(square_metres // 20):
        _thing(dice, hall, put)


def _spot(dice: Dice, room: Rect) -> tuple[int, int]:
    edge = dice.cells(20)
    x = dice.integer(room.x0 + edge, max(room.x0 + edge, room.x1 - edge))
    y = dice.integer(room.y0 + edge, max(room.y0 + edge, room.y1 - edge))
    return x, y


def _along_wall(
    dice: Dice, room: Rect, put: Mover, length_cm: tuple[int, int], depth_cm: tuple[int, int]
) -> None:
    """A cupboard or a shelf with its back to a wall."""
    length, depth = dice.length(*length_cm), dice.length(*depth_cm)
    x, y = _spot(dice, room)
    pieces = (
        Rect(x, room.y0, x + length, room.y0 + depth),
        Rect(x, room.y1 - depth, x + length, room.y1),
        Rect(room.x0, y, room.x0 + depth, y + length),
        Rect(room.x1 - depth, y, room.x1, y + length),
    )
    put(dice.choice(pieces[:2] if room.size[0] > room.size[1] and depth < 8 else pieces), room)


def _pillar(dice: Dice, room: Rect, put: Mover) -> None:
    """A pillar or a duct in a corner."""
    side, other = dice.length(25, 60), dice.length(20, 45)
    x = dice.choice((room.x0, room.x1 - side))
    y = dice.choice((room.y0, room.y1 - other))
    put(Rect(x, y, x + side, y + other), room)


def _legs(dice: Dice, table: Rect, room: Rect, put: Mover) -> None:
    """The four legs of a table, one of them at times hidden."""
    leg = dice.cells(5)
    for x in (table.x0, table.x1 - leg):
        for y in (table.y0, table.y1 - leg):
            if dice.chance(7, 8):
                put(Rect(x, y, x + leg, y + leg), room)


def _chair(dice: Dice, x: int, y: int, room: Rect, put: Mover) -> None:
    """The feet of a swivel chair: specks on a small circle, some of them run together."""
    radius = dice.cells(20)
    feet = ((0, 0), (2, 0), (1, 2), (-2, 1), (-2, -1), (1, -2))
    for fx, fy in feet:
        if dice.chance(4, 5):
            px, py = x + fx * radius // 2, y + fy * radius // 2
            wide, long = dice.length(4, 14), dice.length(4, 12)
            put(Rect(px, py, px + wide, py + long), room)


def _desk(dice: Dice, room: Rect, put: Mover) -> None:
    """A desk: legs and mostly a pedestal of drawers under it, and a chair before it."""
    x, y = _spot(dice, room)
    length, depth = dice.length(120, 180), dice.length(60, 80)
    if dice.chance(1, 2):
        length, depth = depth, length
    x, y = min(x, max(room.x0, room.x1 - length)), min(y, max(room.y0, room.y1 - depth))
    table = Rect(x, y, x + length, y + depth)
    _legs(dice, table, room, put)
    if dice.chance(2, 3):
        wide, long = dice.length(30, 50), dice.length(40, 65)
        put(Rect(x, y, x + wide, y + long), room)
    _chair(dice, (table.x0 + table.x1) // 2, table.y1 + dice.cells(15), room, put)


def _rows_of_tables(dice: Dice, room: Rect, put: Mover) -> None:
    """A seminar room: tables in a grid with chairs between them."""
    pitch_x, pitch_y = dice.length(150, 190), dice.length(140, 170)
    edge, length, depth = dice.cells(110), dice.cells(120), dice.cells(60)
    for x in range(room.x0 + edge, room.x1 - edge - length, pitch_x):
        for y in range(room.y0 + edge, room.y1 - edge - depth, pitch_y):
            _legs(dice, Rect(x, y, x + length, y + depth), room, put)
            for seat in (x + length // 4, x + 3 * length // 4):
                if dice.chance(1, 2):
                    _chair(dice, seat, y + depth + dice.cells(20), room, put)


def _thing(dice: Dice, room: Rect, put: Mover) -> None:
    """A bin, a box, a bag, a heap: lumps that touch."""
    x, y = _spot(dice, room)
    spread = dice.cells(15)
    for _ in range(dice.choice((1, 1, 2, 3, 6))):
        wide, long = dice.length(8, 30), dice.length(8, 25)
        put(Rect(x, y, x + wide, y + long), room)
        x, y = x + dice.integer(-spread, spread), y + dice.integer(-spread, spread)


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
