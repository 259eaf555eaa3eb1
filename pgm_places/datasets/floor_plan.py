"""The floor plan: corridors, rooms and doors as rectangles of cells, before any furniture."""

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from itertools import pairwise
from typing import Literal, Self

from pgm_places.datasets.dice import Dice
from pgm_places.datasets.style import Style


@dataclass(frozen=True)
class Scale:
    """The size of a cell, and lengths in cells."""

    mm_per_cell: int

    def cells(self, cm: int) -> int:
        """The length in whole cells, at least one."""
        return max(1, (20 * cm + self.mm_per_cell) // (2 * self.mm_per_cell))


@dataclass(frozen=True)
class Rect:
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
        """What belongs to both; of no size, or less, where that is nothing."""
        return Rect(
            max(self.x0, other.x0),
            max(self.y0, other.y0),
            min(self.x1, other.x1),
            min(self.y1, other.y1),
        )

    def within(self, shape: tuple[int, ...]) -> "Rect":
        """The part inside a raster of that shape (H, W)."""
        return self.cut(Rect(0, 0, shape[1], shape[0]))

    def joined(self, other: "Rect") -> "Rect":
        """The smallest rectangle around both."""
        return Rect(
            min(self.x0, other.x0),
            min(self.y0, other.y0),
            max(self.x1, other.x1),
            max(self.y1, other.y1),
        )

    def grown(self, columns: int, rows: int) -> "Rect":
        """The rectangle with so many more columns and rows on either side."""
        return Rect(self.x0 - columns, self.y0 - rows, self.x1 + columns, self.y1 + rows)

    def flipped(self, height: int) -> "Rect":
        """The rectangle in the map turned upside down."""
        return Rect(self.x0, height - self.y1, self.x1, height - self.y0)

    def moved(self, columns: int, rows: int) -> "Rect":
        """The rectangle so many columns to the right and rows up."""
        return Rect(self.x0 + columns, self.y0 + rows, self.x1 + columns, self.y1 + rows)


@dataclass(frozen=True)
class Door:
    """A gap in a wall.

    Parameters
    ----------
    gap : Rect
        The cells of the wall that the door opens.
    inward : (int, int)
        The step (columns, rows) from the gap into the room that the door belongs to.
    has_leaf : bool
        Whether a leaf hangs in it; gaps without one are passages.
    """

    gap: Rect
    inward: tuple[int, int]
    has_leaf: bool = True

    def region(self, margin: int) -> Rect:
        """The gap and ``margin`` cells before and behind it: what people call the doorway."""
        return self.gap.grown(margin * abs(self.inward[0]), margin * abs(self.inward[1]))

    def flipped(self, height: int) -> "Door":
        """The door in the map turned upside down."""
        return Door(self.gap.flipped(height), (self.inward[0], -self.inward[1]), self.has_leaf)

    def moved(self, columns: int, rows: int) -> "Door":
        """The door so many columns to the right and rows up."""
        return Door(self.gap.moved(columns, rows), self.inward, self.has_leaf)


@dataclass
class FloorPlan:
    """Everything that is open between the walls; what no rectangle covers is solid.

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
        """Take over the parts of another plan."""
        for part in fields(self):
            getattr(self, part.name).extend(getattr(other, part.name))

    def flipped(self, height: int) -> "FloorPlan":
        """The plan in the map turned upside down."""
        return FloorPlan(
            *([item.flipped(height) for item in getattr(self, part.name)] for part in fields(self))
        )

    def moved(self, columns: int, rows: int) -> "FloorPlan":
        """The plan so many columns to the right and rows up."""
        return FloorPlan(
            *(
                [item.moved(columns, rows) for item in getattr(self, part.name)]
                for part in fields(self)
            )
        )


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
        across = y if self.along == "x" else x
        low, high = sorted((across + self.side * v0, across + self.side * v1))
        if self.along == "x":
            return Rect(x + u0, low, x + u1, high)
        return Rect(low, y + u0, high, y + u1)

    def extent(self, rect: Rect) -> tuple[int, int, int, int]:
        """``u0, u1, v0, v1`` of a rectangle: what :meth:`rect` makes it of."""
        x, y = self.corner
        along, across = (rect.x0 - x, rect.x1 - x), (rect.y0 - y, rect.y1 - y)
        if self.along == "y":
            along, across = (rect.y0 - y, rect.y1 - y), (rect.x0 - x, rect.x1 - x)
        low, high = sorted((self.side * across[0], self.side * across[1]))
        return along[0], along[1], low, high

    @property
    def inward(self) -> tuple[int, int]:
        """The step from the corridor into the rooms."""
        return (0, self.side) if self.along == "x" else (self.side, 0)

    @property
    def onward(self) -> tuple[int, int]:
        """The step along the corridor."""
        return (1, 0) if self.along == "x" else (0, 1)


def row_of_rooms(dice: Dice, scale: Scale, style: Style, frontage: Frontage) -> FloorPlan:
    """Rooms of varying size side by side along a corridor, each with a door to it."""
    plan = FloorPlan()
    front = scale.cells(dice.choice((10, 15, 15, 20, 20, 35)))
    if frontage.depth < front + scale.cells(250):
        return plan
    previous: Rect | None = None
    for start, end in _slots(dice, scale, style, frontage.length):
        if dice.chance(*style.vacant) and previous is not None:
            previous = None  # a shaft, a staircase, a room that stayed locked
            continue
        wall = scale.cells(dice.choice((10, 15, 15, 20)))
        depth = min(frontage.depth - front - wall, _depth(dice, scale, style, end - start))
        room = frontage.rect(start, end - wall, front, front + depth)
        plan.rooms.append(room)
        plan.doors.extend(_front_doors(dice, scale, style, frontage, front, (start, end - wall)))
        plan.windows.extend(windows(dice, scale, frontage, (start, end - wall), front + depth))
        if previous is not None and dice.chance(*style.side_doors):
            shallower = min(previous.size[1 - "xy".index(frontage.along)], depth)
            plan.doors.append(
                _side_door(dice, scale, style, frontage, front, start, shallower, previous)
            )
        previous = room
    return plan


def _slots(dice: Dice, scale: Scale, style: Style, length: int) -> Iterator[tuple[int, int]]:
    """Start and end of each room along the corridor, its dividing wall included."""
    start, narrowest = 0, scale.cells(style.narrowest_cm)
    while length - start >= narrowest:
        low, high = dice.choice(style.fronts_cm)
        end = min(length, start + scale.cells(dice.integer(low, high)))
        if length - end < narrowest:
            end = length if length - start < scale.cells(900) else start + (length - start) // 2
        yield start, end
        start = end


def _depth(dice: Dice, scale: Scale, style: Style, width: int) -> int:
    """How far a room of this width reaches away from its corridor."""
    wide = width > scale.cells(500)
    return scale.cells(dice.integer(*(style.large_depth_cm if wide else style.small_depth_cm)))


def _front_doors(
    dice: Dice,
    scale: Scale,
    style: Style,
    frontage: Frontage,
    front: int,
    slot: tuple[int, int],
) -> list[Door]:
    """One door from the corridor, or more where the room is large."""
    width, post = scale.cells(dice.integer(*style.door_cm)), scale.cells(25)
    start, end = slot
    spans = [slot]
    if end - start > scale.cells(620) and dice.chance(2, 3):
        third = (end - start) // 3
        spans = [(start, start + third), (end - third, end)]
    if style.doors_apart_cm is not None:
        n_doors = max(1, (end - start) // scale.cells(style.doors_apart_cm))
        ends = [start + (end - start) * number // n_doors for number in range(n_doors + 1)]
        spans = list(pairwise(ends))
    doors = []
    for low, high in spans:
        at = dice.integer(low + post, max(low + post, high - post - width))
        doors.append(Door(frontage.rect(at, at + width, 0, front), frontage.inward))
    return doors


def _side_door(
    dice: Dice,
    scale: Scale,
    style: Style,
    frontage: Frontage,
    front: int,
    start: int,
    depth: int,
    previous: Rect,
) -> Door:
    """A door in the wall between a room that begins at ``start`` and the one before it."""
    width = scale.cells(dice.integer(*style.side_door_cm))
    low, high = front + scale.cells(60), front + depth - scale.cells(30) - width
    at = dice.integer(low, max(low, high))
    x, y = frontage.corner
    end = previous.x1 - x if frontage.along == "x" else previous.y1 - y
    return Door(frontage.rect(end, start, at, at + width), frontage.onward)


def windows(
    dice: Dice, scale: Scale, frontage: Frontage, span: tuple[int, int], back: int
) -> list[Rect]:
    """Panes in the wall ``back`` cells from the front, along ``span``; one in three is clear."""
    panes, at, pane = [], span[0] + scale.cells(40), scale.cells(110)
    while at + pane < span[1]:
        if dice.chance(1, 3):
            panes.append(frontage.rect(at, at + pane, back, back + scale.cells(20)))
        at += pane + scale.cells(dice.integer(30, 120))
    return panes
