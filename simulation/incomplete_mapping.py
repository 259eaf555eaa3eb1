"""Incomplete mapping: closed doors, and rooms of which the robot mapped too little."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.maps.components import connected_components
from pgm_places.maps.occupancy_grid import FREE
from pgm_places.simulation.floor_plan import Door, Frontage, Rect, sides
from pgm_places.simulation.portable_random import Dice
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
    found = labels[side.rect(0, side.length, 0, 1).within(labels.shape).slices]
    found = found[found >= 0]
    return int(np.bincount(found).argmax()) if len(found) else -1


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
    seen = np.bincount(parts.piece[is_room & (found == FREE)], minlength=len(parts.size))
    glimpsed = seen < least * parts.size
    labels[parts.on_cells(glimpsed, False)] = -1
    doorways = connected_components(is_doorway, connectivity=4)
    beside = wider((labels >= 0) & ~is_doorway, 1) & is_doorway
    reached = np.bincount(doorways.piece[beside], minlength=doorways.count) > 0
    labels[doorways.on_cells(~reached, False) & is_doorway] = -1
