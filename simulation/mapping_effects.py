"""What a robot's map lacks or adds: closed doors, glimpsed rooms, and glass that rays pass."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from pgm_places.maps.components import connected_components
from pgm_places.maps.occupancy_grid import FREE
from pgm_places.simulation.floor_plan import Door, Frontage, Rect, sides
from pgm_places.simulation.portable_random import Dice, MetreScale
from pgm_places.simulation.simulated_mapping import wider

_WIDEST_CM = 260
"""Wider openings have no doors."""


def close_doors(
    dice: Dice,
    doors: list[Door],
    solid: NDArray[np.bool_],
    labels: NDArray[np.int16],
    is_doorway: NDArray[np.bool_],
    share: int,
) -> list[Door]:
    """Close ``share`` of a thousand doors, in ``solid`` and ``labels`` (H, W); the open doors.

    A closed door looks like a wall: the cells of its doorway belong to the places on both sides.
    ``doors`` are those of the connected parts of ``is_doorway``, in their order.
    """
    left = []
    windows = connected_components(is_doorway, connectivity=4).windows()
    for door, (rows, columns) in zip(doors, windows, strict=True):
        narrow = max(door.gap.size) <= dice.cells(_WIDEST_CM)
        if not (dice.chance(share, 1000) and narrow):
            left.append(door)
            continue
        box = Rect(columns.start, rows.start, columns.stop, rows.stop)
        leaf = _leaf(dice, door)
        for side in sides(box):
            if side.inward in (door.inward, (-door.inward[0], -door.inward[1])):
                deep = box.size["xy".index(side.along) - 1]
                half = side.rect(0, side.length, -((deep + max(side.side, 0)) // 2), 0)
                labels[half.slices][is_doorway[half.slices]] = _beside(labels, side)
        solid[leaf.slices] = True
        labels[leaf.slices] = -1
    return left


def _leaf(dice: Dice, door: Door) -> Rect:
    """The leaf across a gap, flush with one side of the wall or within it."""
    gap, across = door.gap, door.inward[0] != 0
    deep = gap.size[0] if across else gap.size[1]
    thick = min(deep, max(2, dice.cells(8)))
    at = dice.choice((0, (deep - thick) // 2, deep - thick))
    if across:
        return Rect(gap.x0 + at, gap.y0, gap.x0 + at + thick, gap.y1)
    return Rect(gap.x0, gap.y0 + at, gap.x1, gap.y0 + at + thick)


def _beside(labels: NDArray[np.int16], side: Frontage) -> int:
    """The most frequent label right beyond a side; -1 for none."""
    nearby = labels[side.rect(0, side.length, 0, 1).within(labels.shape).slices]
    nearby = nearby[nearby >= 0]
    return int(np.bincount(nearby).argmax()) if len(nearby) else -1


def forget_glimpses(
    labels: NDArray[np.int16],
    found: NDArray[np.int8],
    is_room: NDArray[np.bool_],
    is_doorway: NDArray[np.bool_],
    least: float,
) -> None:
    """Remove the labels of rooms of which less than ``least`` is mapped, from ``labels`` (H, W).

    Labels of doorways between two such rooms are removed, too. ``found`` (H, W) are the mapped
    cells, ``is_room`` and ``is_doorway`` the masks of the plan's rooms and doorways.
    """
    parts = connected_components(is_room, connectivity=4)
    mapped = np.bincount(parts.piece[is_room & (found == FREE)], minlength=len(parts.size))
    glimpsed = mapped < least * parts.size
    labels[parts.on_cells(glimpsed, False)] = -1
    doorways = connected_components(is_doorway, connectivity=4)
    beside = wider((labels >= 0) & ~is_doorway, 1) & is_doorway
    reached = np.bincount(doorways.piece[beside], minlength=doorways.count) > 0
    labels[doorways.on_cells(~reached, False) & is_doorway] = -1


BEYOND_CM = 900
"""Width of the ground around a building that is visible through its windows."""

_WALL_CM = 30
"""Least distance of open ground from a building's spaces, for the outer walls."""

_COURT_M2 = 25
"""Least area of a courtyard."""

_OBSTACLE_M2 = 30
"""Ground area per obstacle: a parapet, a tree, a car, another house."""

_SHORTEST_CM = 80
"""Length of the shortest wall with windows."""


def open_ground(dice: Dice, solid: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(H, W) the ground outside a building and in its courtyards, without obstacles on it.

    ``solid`` (H, W) is False inside the building.
    """
    beyond = solid & ~wider(~solid, dice.cells(_WALL_CM))
    parts = connected_components(beyond, connectivity=4)
    large = parts.size >= _COURT_M2 * dice.cells(100) ** 2
    for edge in (parts.piece[0], parts.piece[-1], parts.piece[:, 0], parts.piece[:, -1]):
        large[edge[edge >= 0]] = True
    ground = beyond & parts.on_cells(large, False)
    rows, columns = np.nonzero(ground)
    if len(rows):
        for _ in range(len(rows) // (_OBSTACLE_M2 * dice.cells(100) ** 2)):
            at = dice.integer(0, len(rows) - 1)
            wide, long = (dice.length(15, dice.choice((60, 300))) for _ in range(2))
            x, y = int(columns[at]), int(rows[at])
            ground[Rect(x, y, x + wide, y + long).within(ground.shape).slices] = False
    return ground


def windows_out(
    dice: Dice, places: Sequence[Sequence[Rect]], ground: NDArray[np.bool_], share: int
) -> NDArray[np.bool_]:
    """(H, W) gaps for rays in the outer walls of ``share`` places of a thousand."""
    gaps = np.zeros_like(ground)
    depth = dice.cells(_WALL_CM) + 3
    for place in places:
        if not dice.chance(share, 1000):
            continue
        for side in _walls(dice.scale, place):
            if dice.chance(1, 3):
                continue
            panes = _front(dice, side) if dice.chance(1, 8) else _row(dice, side)
            for start, end in panes:
                _open_to(gaps, ground, side.rect(start, end, 0, depth), side)
    return gaps


def fronts(
    dice: Dice, rooms: Sequence[Sequence[Rect]], passage: NDArray[np.bool_], share: int
) -> NDArray[np.bool_]:
    """(H, W) gaps for rays in the walls between ``share`` rooms of a thousand and passages."""
    gaps = np.zeros_like(passage)
    depth = dice.cells(_WALL_CM) + 3
    for room in rooms:
        if dice.chance(share, 1000):
            for side in _walls(dice.scale, room):
                for start, end in _front(dice, side):
                    _open_to(gaps, passage, side.rect(start, end, 0, depth), side)
    return gaps


def _walls(scale: MetreScale, place: Sequence[Rect]) -> Iterator[Frontage]:
    """The four sides of a place's largest rectangle, where they are long enough."""
    for rect in place[:1]:
        yield from (side for side in sides(rect) if side.length >= scale.cells(_SHORTEST_CM))


def _row(dice: Dice, side: Frontage) -> Iterator[tuple[int, int]]:
    """Positions along a wall at which rays pass its windows: complete panes, or slits of them."""
    wide = dice.length(60, 200)
    apart = dice.length(40, 350)
    at = dice.integer(dice.cells(10), wide)
    slits = dice.chance(3, 4)
    while at + wide < side.length:
        if slits:
            for _ in range(dice.integer(1, 4)):
                slit = at + dice.integer(0, wide - 1)
                yield slit, slit + dice.integer(1, max(1, dice.cells(10)))
        elif dice.chance(2, 3):
            yield at, at + wide
        at += wide + apart


def _front(dice: Dice, side: Frontage) -> Iterator[tuple[int, int]]:
    """Positions along a glass front at which rays pass: all but posts and reflecting parts."""
    at = dice.integer(0, dice.cells(60))
    while at < side.length:
        end = min(side.length, at + dice.length(10, 150))
        yield at, end
        at = end + dice.integer(1, dice.cells(dice.choice((10, 10, 80))))


def _open_to(
    gaps: NDArray[np.bool_], there: NDArray[np.bool_], through: Rect, side: Frontage
) -> None:
    """Open the cells in front of ``there`` in a piece of wall, line by line."""
    inside = through.within(gaps.shape)
    if min(inside.size) < 1 or inside != through:
        return
    strip, hole = there[inside.slices], gaps[inside.slices]
    if side.along == "y":
        strip, hole = strip.T, hole.T
    if side.side < 0:
        strip, hole = strip[::-1], hole[::-1]
    nearest = np.where(strip.any(axis=0), strip.argmax(axis=0), 0)
    hole |= np.arange(len(strip))[:, None] < nearest
