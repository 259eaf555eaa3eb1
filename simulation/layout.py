"""The layout of a floor or a wing: corridors and halls, and the frontages of rooms along them."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

from pgm_places.simulation.floor_plan import Door, FloorPlan, Frontage, Rect, row_of_rooms
from pgm_places.simulation.portable_random import Dice
from pgm_places.simulation.style import Span, Style

_HALL_LENGTHS: tuple[Span, ...] = ((310, 520), (520, 800), (800, 1100), (1100, 1700))
_HALL_DEPTHS: tuple[Span, ...] = ((150, 300), (300, 500), (500, 750))
"""Lengths of halls along their corridor and depths at right angles to it. Halls of the real floors
have 11 to 200 m2 and are 2.5 to 17 m wide, 10 to 90 % (Nov 2026)."""

_WALL_CM = 20


@dataclass(frozen=True)
class Layout:
    """The skeleton of a floor, in centimetres; corridors and halls together are connected.

    ``courts`` are not built on. ``large_rooms`` (gyms and lecture theatres) lie a wall away from
    the end of a corridor.
    """

    corridors: tuple[Rect, ...]
    halls: tuple[Rect, ...] = ()
    courts: tuple[Rect, ...] = ()
    large_rooms: tuple[Rect, ...] = ()

    @property
    def _parts(self) -> tuple[Rect, ...]:
        return self.corridors + self.halls + self.courts + self.large_rooms

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of a layout in the first quadrant."""
        return max(part.x1 for part in self._parts), max(part.y1 for part in self._parts)

    def moved(self, columns: int, rows: int) -> "Layout":
        """The layout, moved to the right and up."""
        return Layout(
            *(
                tuple(part.moved(columns, rows) for part in parts)
                for parts in (self.corridors, self.halls, self.courts, self.large_rooms)
            )
        )

    def with_margin(self, margin: int) -> "Layout":
        """The layout moved so that it begins ``margin`` from the left and from below."""
        left, low = min(part.x0 for part in self._parts), min(part.y0 for part in self._parts)
        return self.moved(margin - left, margin - low)


def draw_layout(dice: Dice, style: Style, length_cm: int) -> Layout:
    """The corridors and halls of a floor about ``length_cm`` long, in one of the style's layouts.

    There is room for one row of rooms on every side.
    """
    layout = LAYOUTS[dice.choice(style.layouts)](dice, style, length_cm)
    for _ in range(dice.integer(*style.halls)):
        layout = _with_hall(dice, layout)
    if style.large_room_cm is not None and layout.corridors and dice.chance(1, 2):
        layout = _with_large_room(dice, style.large_room_cm, layout)
    return layout.with_margin(style.rooms_cm.deepest)


def _bar(dice: Dice, style: Style, length: int) -> Layout:
    """One straight corridor."""
    return Layout((Rect(0, 0, length, dice.integer(*style.corridor_cm)),))


def _comb(dice: Dice, style: Style, length: int) -> Layout:
    """A corridor from which others branch off: an L, a T, a U, an H or more teeth."""
    width, branch = dice.integer(*style.corridor_cm), dice.integer(*style.branch_cm)
    n_teeth = dice.integer(1, max(2, length // 2200))
    pitch = (length - branch) // n_teeth
    first = dice.choice((0, pitch // 2, pitch)) if n_teeth == 1 else dice.integer(0, pitch)
    above, below = dice.integer(1200, 2400), dice.integer(1200, 2400)
    columns = range(first, length - branch + 1, pitch)
    teeth = [Rect(x, width, x + branch, width + above) for x in columns]
    teeth += [Rect(x, -below, x + branch, 0) for x in columns if dice.chance(1, 3)]
    return Layout((Rect(0, 0, length, width), *teeth))


def _ladder(dice: Dice, style: Style, length: int) -> Layout:
    """Two or three parallel corridors that are joined, with rooms or stairs between them."""
    n_aisles = 3 if dice.chance(1, 4) else 2
    gap = dice.integer(500, 2 * style.rooms_cm.deepest)
    return _aisles(dice, style, (length, gap), n_aisles, court=False)


def _court(dice: Dice, style: Style, length: int) -> Layout:
    """A corridor around a courtyard."""
    return _aisles(dice, style, (length * 2 // 3, dice.integer(900, 2000)), 2, court=True)


def _aisles(
    dice: Dice, style: Style, length_and_gap: tuple[int, int], n_aisles: int, *, court: bool
) -> Layout:
    (length, gap), width = length_and_gap, dice.integer(*style.corridor_cm)
    link = dice.integer(*style.link_cm)
    rows = [aisle * (width + gap) for aisle in range(n_aisles)]
    columns = [0, length - link]
    if dice.chance(1, 3):
        columns.insert(1, (length - link) // 2)
    between = [(y + width, y + width + gap) for y in rows[:-1]]
    aisles = [Rect(0, y, length, y + width) for y in rows]
    links = [Rect(x, low, x + link, high) for x in columns for low, high in between]
    inner = [Rect(a + link, low, b, high) for a, b in pairwise(columns) for low, high in between]
    return Layout((*aisles, *links), courts=tuple(inner) if court else ())


def _foyer(dice: Dice, style: Style, length: int) -> Layout:
    """A large hall in the middle, from which corridors lead to two to four sides."""
    columns, rows = dice.integer(900, 1900), dice.integer(800, 1500)
    width, arm, other = dice.integer(*style.corridor_cm), length // 2, dice.integer(900, 1800)
    low, left = dice.integer(0, rows - width), dice.integer(0, columns - width)
    arms = [Rect(-arm, low, 0, low + width), Rect(columns, low, columns + arm, low + width)]
    spans = ((rows, rows + other), (-other, 0))
    arms += [Rect(left, low, left + width, high) for low, high in spans if dice.chance(1, 2)]
    return Layout(tuple(arms), halls=(Rect(0, 0, columns, rows),))


def _flat(dice: Dice, style: Style, length: int) -> Layout:
    """The circulation of a home: a hallway, one with a corner, or an entrance hall, or both."""
    width, other = dice.integer(*style.corridor_cm), dice.integer(*style.branch_cm)
    hallway = Rect(0, 0, length, width)
    kind = dice.integer(0, 4)
    if kind <= 1:
        return Layout((hallway,))
    if kind == 2:
        x = dice.choice((0, dice.integer(0, length - other), length - other))
        return Layout((hallway, Rect(x, width, x + other, width + dice.integer(180, 450))))
    columns, rows = dice.integer(220, 480), dice.integer(170, 320)
    if kind == 3:
        return Layout((), halls=(Rect(0, 0, columns, rows),))
    y = dice.integer(0, rows - width)
    return Layout(
        (Rect(columns, y, columns + length, y + width),), halls=(Rect(0, 0, columns, rows),)
    )


def _atrium(dice: Dice, style: Style, length: int) -> Layout:
    """A large hall of one or two parts, from which corridors lead away, or none."""
    columns, rows = dice.integer(800, 2600), dice.integer(700, 1800)
    halls = [Rect(0, 0, columns, rows)]
    if dice.chance(1, 2):  # an L, a T or a Z
        more, deep = dice.integer(500, columns), dice.integer(400, 1200)
        x = dice.integer(-more // 2, columns - more // 2)
        halls.append(Rect(x, rows, x + more, rows + deep))
    width, arm = dice.integer(*style.corridor_cm), dice.integer(600, max(600, length // 3))
    low, left = dice.integer(0, rows - width), dice.integer(0, columns - width)
    arms = (
        Rect(-arm, low, 0, low + width),
        Rect(columns, low, columns + arm, low + width),
        Rect(left, -arm, left + width, 0),
    )
    return Layout(tuple(part for part in arms if dice.chance(1, 2)), halls=tuple(halls))


def _passage(dice: Dice, style: Style, length: int) -> Layout:
    """A way that may turn or branch, with niches and bays at its sides, and few rooms."""
    width, branch = dice.integer(*style.corridor_cm), dice.integer(*style.branch_cm)
    ways = [Rect(0, 0, length, width)]
    x = dice.choice((0, dice.integer(0, length - branch), length - branch))
    if dice.chance(2, 3):
        ways.append(Rect(x, width, x + branch, width + dice.integer(500, 2500)))
    if dice.chance(1, 3):
        x = dice.choice((0, dice.integer(0, length - branch), length - branch))
        ways.append(Rect(x, -dice.integer(500, 2500), x + branch, 0))
    for _ in range(dice.integer(0, 1 + length // 1000)):
        long, deep = dice.integer(120, 600), dice.integer(50, 250)
        x = dice.integer(0, max(0, length - long))
        y = dice.choice((width, -deep))
        ways.append(Rect(x, y, min(x + long, length), y + deep))
    return Layout(tuple(ways))


LAYOUTS: dict[str, Callable[[Dice, Style, int], Layout]] = {
    "atrium": _atrium,
    "bar": _bar,
    "comb": _comb,
    "court": _court,
    "flat": _flat,
    "foyer": _foyer,
    "ladder": _ladder,
    "passage": _passage,
}
"""The ways in which corridors run, by name."""


def _with_hall(dice: Dice, layout: Layout) -> Layout:
    """The layout with a corridor widened to a hall on one side or on both."""
    corridor = dice.choice(layout.corridors)
    along_x = corridor.size[0] > corridor.size[1]
    longest = max(corridor.size)
    length = min(dice.integer(*dice.choice(_HALL_LENGTHS)), longest)
    at = dice.integer(0, longest - length)
    before, behind = (dice.integer(*dice.choice(_HALL_DEPTHS)) for _ in range(2))
    sides = dice.integer(0, 4)  # half the halls lie below or left, and one in five on both sides
    before, behind = before * (sides in (0, 1, 4)), behind * (sides in (2, 3, 4))
    x, y = corridor.x0, corridor.y0
    if along_x:
        hall = Rect(x + at, y - before, x + at + length, corridor.y1 + behind)
    else:
        hall = Rect(x - before, y + at, corridor.x1 + behind, y + at + length)
    return replace(layout, halls=(*layout.halls, hall))


def _with_large_room(dice: Dice, sizes: tuple[Span, Span], layout: Layout) -> Layout:
    """The layout with a room across the end of its first corridor, which runs to the right."""
    columns, rows = (dice.integer(*span) for span in sizes)
    x, y = layout.corridors[0].x1 + _WALL_CM, layout.corridors[0].y0
    low = y - dice.integer(0, rows - (layout.corridors[0].y1 - y))
    room = Rect(x, low, x + columns, low + rows)
    with_walls = room.grown(_WALL_CM, _WALL_CM)
    if any(with_walls.overlaps(part) for part in layout.corridors + layout.halls):
        return layout
    return replace(layout, large_rooms=(room,))


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
