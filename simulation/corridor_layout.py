"""Corridor layout of a building's wings, and the frontages of rooms along them."""

from dataclasses import dataclass
from typing import Literal

from pgm_places.simulation.floor_plan import Door, FloorPlan, Frontage, Rect, row_of_rooms
from pgm_places.simulation.portable_random import Dice
from pgm_places.simulation.style import Style


@dataclass(frozen=True)
class Wing:
    """The extent of a wing: columns ``x0`` to ``x1`` of a building ``height`` rows high.

    The corridor comes in from the left with its lower edge on row ``corridor_y`` and is
    ``corridor_width`` rows wide; a wall of ``wall`` columns parts the rooms from the wing before.
    """

    x0: int
    x1: int
    height: int
    corridor_y: int
    corridor_width: int
    wall: int

    def flipped(self) -> "Wing":
        """The wing in the map turned upside down."""
        y = self.height - self.corridor_y - self.corridor_width
        return Wing(self.x0, self.x1, self.height, y, self.corridor_width, self.wall)

    @property
    def entrance(self) -> Rect:
        """The corridor through the full wing."""
        return Rect(self.x0, self.corridor_y, self.x1, self.corridor_y + self.corridor_width)

    @property
    def rooms_x0(self) -> int:
        """The first column of rooms."""
        return self.x0 + self.wall

    @property
    def above(self) -> int:
        """Rows between the corridor and the top."""
        return self.height - self.corridor_y - self.corridor_width


def draw_wing(dice: Dice, style: Style, wing: Wing, kind: str) -> tuple[FloorPlan, int]:
    """The wing's plan, and the row of its corridor's lower edge where it leaves at the right.

    The kinds: ``spine`` (one straight corridor), ``tee`` (a second corridor branches off),
    ``bend`` (the corridor turns twice), ``loop`` (two corridors joined at both ends).
    """
    turn = wing.above < wing.corridor_y
    corridors, sides, leaves = _KINDS[kind](dice, style, wing.flipped() if turn else wing)
    plan = FloorPlan(corridors=corridors)
    for side in sides:
        plan.add(row_of_rooms(dice, style, side))
    if not turn:
        return plan, leaves
    return plan.flipped(wing.height), wing.height - leaves - wing.corridor_width


def _across(wing: Wing, span: tuple[int, int], y: int, side: int, depth: int) -> Frontage:
    """The frontage along a horizontal corridor whose lower edge is on row ``y``."""
    x0, x1 = span
    edge = y + wing.corridor_width if side > 0 else y
    room = wing.height - edge if side > 0 else edge
    return Frontage("x", (x0, edge), 1 if side > 0 else -1, x1 - x0, min(depth, room))


_Drawn = tuple[list[Rect], list[Frontage], int]
"""Corridors, the sides along which rooms lie, and the row where the corridor leaves."""


def _spine(dice: Dice, style: Style, wing: Wing) -> _Drawn:
    y, deep = wing.corridor_y, dice.cells(style.rooms_cm.deepest)
    sides = [_across(wing, (wing.rooms_x0, wing.x1), y, side, deep) for side in (1, -1)]
    return [wing.entrance], sides, y


def _tee(dice: Dice, style: Style, wing: Wing) -> _Drawn:
    y, top = wing.corridor_y, wing.corridor_y + wing.corridor_width
    width = dice.length(*style.branch_cm)
    third = (wing.x1 - wing.x0) // 3
    branch = wing.x0 + dice.integer(third, 2 * third)
    end = min(wing.height, top + dice.length(1150, 1500))
    first = min(dice.length(460, 580), (end - top) // 2)
    corridors = [wing.entrance, Rect(branch, top, branch + width, end - dice.cells(20))]
    beyond, deep = end - top - first, dice.cells(style.rooms_cm.deepest - 20)
    sides = [
        _across(wing, (wing.rooms_x0, wing.x1), y, -1, dice.cells(style.rooms_cm.deepest)),
        _across(wing, (wing.rooms_x0, branch - dice.cells(15)), y, 1, first),
        _across(wing, (branch + width + dice.cells(15), wing.x1), y, 1, first),
        Frontage("y", (branch, top + first), -1, beyond, deep),
        Frontage("y", (branch + width, top + first), 1, beyond, deep),
    ]
    return corridors, sides, y


def _bend(dice: Dice, style: Style, wing: Wing) -> _Drawn:
    y, width = wing.corridor_y, wing.corridor_width
    third = (wing.x1 - wing.x0) // 3
    turn = wing.x0 + dice.integer(third, 2 * third)
    leaves = y + dice.length(640, 820)
    past, deep, wall = turn + width, dice.cells(style.rooms_cm.deepest - 40), dice.cells(20)
    corridors = [
        Rect(wing.x0, y, past, y + width),
        Rect(turn, y + width, past, leaves),
        Rect(turn, leaves, wing.x1, leaves + width),
    ]
    sides = [
        _across(wing, (wing.rooms_x0, past), y, -1, deep),
        _across(wing, (wing.rooms_x0, turn - wall), y, 1, deep),
        _across(wing, (turn, wing.x1), leaves, 1, deep),
        _across(wing, (past + wall, wing.x1), leaves, -1, deep),
    ]
    return corridors, sides, leaves


def _loop(dice: Dice, style: Style, wing: Wing) -> _Drawn:
    y, width, wall = wing.corridor_y, wing.corridor_width, dice.cells(20)
    link = dice.length(*style.link_cm)
    inner = dice.length(480, 600)
    upper = y + width + inner
    left, right = wing.x0 + dice.length(80, 300), wing.x1 - dice.cells(400)
    corridors = [
        wing.entrance,
        Rect(left, y + width, left + link, upper),
        Rect(right - link, y + width, right, upper),
        Rect(left, upper, right, upper + width),
    ]
    sides = [
        _across(wing, (wing.rooms_x0, wing.x1), y, -1, dice.cells(style.rooms_cm.deepest - 20)),
        _across(wing, (left + link + wall, right - link), y, 1, inner - wall),
        _across(wing, (left, right), upper, 1, dice.cells(style.rooms_cm.deepest - 120)),
    ]
    return corridors, sides, y


def partition(dice: Dice, corridor: Rect, at: int = 0) -> FloorPlan:
    """A glazed wall across a corridor, ``at`` cells from its left or lower end, with a door."""
    along: Literal["x", "y"] = "x" if corridor.size[0] > corridor.size[1] else "y"
    wide = min(corridor.size)
    side = Frontage(along, (corridor.x0, corridor.y0), 1, max(corridor.size), wide)
    end = at + dice.cells(12)
    width = min(dice.length(95, 110), wide - 2)
    low = dice.integer(1, wide - 1 - width)
    door = Door(side.rect(at, end, low, low + width), side.onward, has_leaf=False)
    return FloorPlan(walls=[side.rect(at, end, 0, wide)], doors=[door])


_KINDS = {"bend": _bend, "loop": _loop, "spine": _spine, "tee": _tee}
