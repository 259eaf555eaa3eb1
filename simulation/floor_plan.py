"""The floor plan: corridors, rooms and doors as rectangles of cells, before any furniture."""

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from itertools import pairwise
from typing import Any, Literal, NamedTuple, Self

from pgm_places.simulation.portable_random import Dice
from pgm_places.simulation.style import Style


class Rect(NamedTuple):
    """Columns ``x0`` to ``x1`` and rows ``y0`` to ``y1`` of the grid, the ends excluded."""

    x0: int
    y0: int
    x1: int
    y1: int

    @property
    def slices(self) -> tuple[slice, slice]:
        """The index of the rectangle in a raster [row, column]."""
        return slice(self.y0, self.y1), slice(self.x0, self.x1)

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows."""
        return self.x1 - self.x0, self.y1 - self.y0

    def overlaps(self, other: "Rect") -> bool:
        """Whether a cell belongs to both."""
        return min(self.cut(other).size) > 0

    def cut(self, other: "Rect") -> "Rect":
        """The intersection; its size is zero or negative if it is empty."""
        return Rect(*map(max, self[:2], other[:2]), *map(min, self[2:], other[2:]))

    def within(self, shape: tuple[int, ...]) -> "Rect":
        """The part inside a raster of that shape (H, W)."""
        return self.cut(Rect(0, 0, shape[1], shape[0]))

    def joined(self, other: "Rect") -> "Rect":
        """The smallest rectangle around both."""
        return Rect(*map(min, self[:2], other[:2]), *map(max, self[2:], other[2:]))

    def grown(self, columns: int, rows: int) -> "Rect":
        """The rectangle with a number of further columns and rows on each side."""
        return Rect(self.x0 - columns, self.y0 - rows, self.x1 + columns, self.y1 + rows)

    def flipped(self, height: int) -> "Rect":
        """The rectangle in the map turned upside down."""
        return Rect(self.x0, height - self.y1, self.x1, height - self.y0)

    def moved(self, columns: int, rows: int) -> "Rect":
        """The rectangle, a number of columns to the right and rows up."""
        return Rect(self.x0 + columns, self.y0 + rows, self.x1 + columns, self.y1 + rows)


@dataclass(frozen=True)
class Door:
    """A gap in a wall: a door with a leaf, or a passage.

    ``inward`` is the step (columns, rows) from the gap into the room that the door belongs to.
    """

    gap: Rect
    inward: tuple[int, int]
    has_leaf: bool = True

    def region(self, margin: int) -> Rect:
        """The doorway: the gap and ``margin`` cells before and behind it."""
        return self.gap.grown(margin * abs(self.inward[0]), margin * abs(self.inward[1]))

    def flipped(self, height: int) -> "Door":
        """The door in the map turned upside down."""
        return Door(self.gap.flipped(height), (self.inward[0], -self.inward[1]), self.has_leaf)

    def moved(self, columns: int, rows: int) -> "Door":
        """The door, a number of columns to the right and rows up."""
        return Door(self.gap.moved(columns, rows), self.inward, self.has_leaf)


@dataclass
class FloorPlan:
    """The open rectangles of a floor; cells outside all rectangles are solid.

    ``halls`` are lobbies and waiting areas, which one passes through to reach several rooms;
    ``walls`` stand across what is open; ``windows`` are stretches of outer wall that a laser may
    see through.
    """

    corridors: list[Rect] = field(default_factory=list)
    rooms: list[Rect] = field(default_factory=list)
    walls: list[Rect] = field(default_factory=list)
    doors: list[Door] = field(default_factory=list)
    windows: list[Rect] = field(default_factory=list)
    halls: list[Rect] = field(default_factory=list)

    def add(self, other: Self) -> None:
        """Add the parts of another plan."""
        for mine, theirs in zip(self._parts, other._parts, strict=True):
            mine.extend(theirs)

    @property
    def _parts(self) -> list[list[Any]]:
        return [getattr(self, part.name) for part in fields(self)]

    def flipped(self, height: int) -> "FloorPlan":
        """The plan in the map turned upside down."""
        return FloorPlan(*([item.flipped(height) for item in items] for items in self._parts))

    def moved(self, columns: int, rows: int) -> "FloorPlan":
        """The plan, a number of columns to the right and rows up."""
        return FloorPlan(*([item.moved(columns, rows) for item in items] for items in self._parts))


@dataclass(frozen=True)
class Frontage:
    """One side of a corridor, along which rooms lie.

    ``along`` is the corridor's axis; ``corner`` the corridor's cell edge where the row of rooms
    begins; ``side`` +1 where the rooms lie towards larger coordinates, else -1; ``length`` and
    ``depth`` the room there is, in cells, walls included.
    """

    along: Literal["x", "y"]
    corner: tuple[int, int]
    side: Literal[1, -1]
    length: int
    depth: int

    def rect(self, u0: int, u1: int, v0: int, v1: int) -> Rect:
        """The cells from ``u0`` to ``u1`` along the corridor and ``v0`` to ``v1`` away from it."""
        x, y = self.corner
        low, high = sorted((self.side * v0, self.side * v1))
        if self.along == "x":
            return Rect(x + u0, y + low, x + u1, y + high)
        return Rect(x + low, y + u0, x + high, y + u1)

    def extent(self, rect: Rect) -> tuple[int, int, int, int]:
        """``u0, u1, v0, v1`` of a rectangle, the inverse of :meth:`rect`."""
        x, y = self.corner
        moved = rect.moved(-x, -y)
        along, across = (moved.x0, moved.x1), (moved.y0, moved.y1)
        if self.along == "y":
            along, across = across, along
        low, high = sorted((self.side * across[0], self.side * across[1]))
        return *along, low, high

    @property
    def inward(self) -> tuple[int, int]:
        """The step from the corridor into the rooms."""
        return (0, self.side) if self.along == "x" else (self.side, 0)

    @property
    def onward(self) -> tuple[int, int]:
        """The step along the corridor."""
        return (1, 0) if self.along == "x" else (0, 1)


def sides(part: Rect) -> tuple[Frontage, ...]:
    """The four sides of a rectangle, seen from inside, with depth 0."""
    columns, rows = part.size
    return (
        Frontage("x", (part.x0, part.y1), 1, columns, 0),
        Frontage("x", (part.x0, part.y0), -1, columns, 0),
        Frontage("y", (part.x1, part.y0), 1, rows, 0),
        Frontage("y", (part.x0, part.y0), -1, rows, 0),
    )


def row_of_rooms(dice: Dice, style: Style, frontage: Frontage) -> FloorPlan:
    """Rooms of varying size side by side along a corridor, each with a door to it."""
    plan = FloorPlan()
    front = dice.cells(dice.choice((10, 15, 15, 20, 20, 35)))
    if frontage.depth < front + dice.cells(250):
        return plan
    previous: Rect | None = None
    for start, end in _slots(dice, style, frontage.length):
        if dice.chance(*style.vacant) and previous is not None:
            previous = None  # a shaft, a staircase, a room that stayed locked
            continue
        wall = dice.cells(dice.choice((10, 15, 15, 20)))
        depth = min(frontage.depth - front - wall, _depth(dice, style, end - start))
        room = frontage.rect(start, end - wall, front, front + depth)
        plan.rooms.append(room)
        plan.doors.extend(_front_doors(dice, style, frontage, front, (start, end - wall)))
        plan.windows.extend(windows(dice, frontage, (start, end - wall), front + depth))
        if previous is not None and dice.chance(*style.side_doors):
            shallower = min(previous.size[1 - "xy".index(frontage.along)], depth)
            plan.doors.append(_side_door(dice, style, frontage, front, start, shallower, previous))
        previous = room
    return plan


def _slots(dice: Dice, style: Style, length: int) -> Iterator[tuple[int, int]]:
    """Start and end of each room along the corridor, its dividing wall included."""
    start, narrowest = 0, dice.cells(style.rooms_cm.narrowest)
    while length - start >= narrowest:
        low, high = dice.choice(style.rooms_cm.fronts)
        end = min(length, start + dice.length(low, high))
        if length - end < narrowest:
            end = length if length - start < dice.cells(900) else start + (length - start) // 2
        yield start, end
        start = end


def _depth(dice: Dice, style: Style, width: int) -> int:
    """How far a room of this width reaches away from its corridor."""
    wide = width > dice.cells(500)
    return dice.length(*(style.rooms_cm.large_depth if wide else style.rooms_cm.small_depth))


def _front_doors(
    dice: Dice, style: Style, frontage: Frontage, front: int, slot: tuple[int, int]
) -> list[Door]:
    """One door from the corridor, or more where the room is large."""
    width, post = dice.length(*style.door_cm), dice.cells(25)
    start, end = slot
    spans = [slot]
    if end - start > dice.cells(620) and dice.chance(2, 3):
        third = (end - start) // 3
        spans = [(start, start + third), (end - third, end)]
    if style.doors_apart_cm is not None:
        n_doors = max(1, (end - start) // dice.cells(style.doors_apart_cm))
        ends = [start + (end - start) * number // n_doors for number in range(n_doors + 1)]
        spans = list(pairwise(ends))
    doors = []
    for low, high in spans:
        at = dice.integer(low + post, max(low + post, high - post - width))
        doors.append(Door(frontage.rect(at, at + width, 0, front), frontage.inward))
    return doors


def _side_door(
    dice: Dice, style: Style, frontage: Frontage, front: int, start: int, depth: int, previous: Rect
) -> Door:
    """A door in the wall between a room that begins at ``start`` and the one before it."""
    width = dice.length(*style.side_door_cm)
    low, high = front + dice.cells(60), front + depth - dice.cells(30) - width
    at = dice.integer(low, max(low, high))
    x, y = frontage.corner
    end = previous.x1 - x if frontage.along == "x" else previous.y1 - y
    return Door(frontage.rect(end, start, at, at + width), frontage.onward)


def windows(dice: Dice, frontage: Frontage, span: tuple[int, int], back: int) -> list[Rect]:
    """Panes in the wall ``back`` cells from the front, along ``span``; one in three is clear."""
    panes, at, pane = [], span[0] + dice.cells(40), dice.cells(110)
    while at + pane < span[1]:
        if dice.chance(1, 3):
            panes.append(frontage.rect(at, at + pane, back, back + dice.cells(20)))
        at += pane + dice.length(30, 120)
    return panes
