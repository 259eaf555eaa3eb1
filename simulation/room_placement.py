"""Placement of rooms along the sides of corridors and halls."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pgm_places.simulation.floor_plan import Door, FloorPlan, Frontage, Rect, row_of_rooms, sides
from pgm_places.simulation.layout import Layout, partition
from pgm_places.simulation.portable_random import Dice, MetreScale
from pgm_places.simulation.style import OFFICE, Style

_WALL_CM = 15
"""Thickness of the wall between rooms of different corridors."""

_THIN_WALL_CM = 10
"""Thickness of the wall behind an enlarged room."""

_SHALLOWEST_CM = 290
"""Least depth of a row of rooms, walls included."""

_WIDEST_LEAF_CM = 130
"""Wider doors have two leaves, which stand open along the walls."""

_STEP_CM = 120
"""Change of the available depth at which another row of rooms begins."""


def draw_floor(dice: Dice, style: Style, layout: Layout, shape: tuple[int, int]) -> FloorPlan:
    """The plan, in cells, of a floor of ``shape`` (H, W) whose corridors and halls are given.

    Every room has a door to one of them.
    """
    site = Site(dice.scale, shape, style.growth_cm)
    plan = FloorPlan(
        corridors=[_in_cells(dice.scale, part) for part in layout.corridors],
        halls=[_in_cells(dice.scale, part) for part in layout.halls],
    )
    ways = plan.corridors + plan.halls
    for part in (*ways, *(_in_cells(dice.scale, court) for court in layout.courts)):
        site.take(part)
    for part in layout.large_rooms:
        plan.add(_large_room(dice, style, _in_cells(dice.scale, part), plan.corridors[0]))
        site.take(plan.rooms[-1])
    rows = []
    for side in dice.shuffled([side for way in ways for side in sides(way)]):
        for frontage in site.frontages(side, dice.cells(style.rooms_cm.deepest)):
            rows.append((frontage, row_of_rooms(dice, style, frontage)))
            for room in rows[-1][1].rooms:
                site.take(room)
    for frontage, row in rows:
        back = max((frontage.extent(room)[3] for room in row.rooms), default=0)
        row.rooms = [site.enlarged(dice, frontage, room, back) for room in row.rooms]
        if style.openings is not None:
            _open_up(dice, style, frontage, row)
        _add_inner_rooms(dice, style, frontage, row)
        if style.back_rooms is not None:
            _add_back_rooms(dice, style.back_rooms, frontage, row)
        plan.add(row)
    for corridor in plan.corridors:
        if dice.chance(1, 4):
            plan.add(_fire_door(dice, corridor, plan, site))
    if style.pilasters is not None:
        for corridor in plan.corridors:
            if dice.chance(*style.pilasters):
                plan.walls += _pilasters(dice, corridor, plan)
    return plan


def _in_cells(scale: MetreScale, part: Rect) -> Rect:
    """A rectangle in centimetres as cells; rectangles that touch still do."""
    mm = scale.mm_per_cell
    return Rect(*((20 * cm + mm) // (2 * mm) for cm in part))


class Site:
    """The ground of a floor and its occupied cells; rooms grow by at most ``growth_cm``."""

    def __init__(
        self, scale: MetreScale, shape: tuple[int, int], growth_cm: int = OFFICE.growth_cm
    ) -> None:
        self._taken = np.zeros(shape, bool)
        self._wall, self._thin = scale.cells(_WALL_CM), scale.cells(_THIN_WALL_CM)
        self._least, self._step = scale.cells(_SHALLOWEST_CM), scale.cells(_STEP_CM)
        self._growth = scale.cells(growth_cm)

    def take(self, part: Rect) -> None:
        """Mark cells as built on."""
        self._taken[part.slices] = True

    def is_flanked(self, wall: Rect) -> bool:
        """Whether the cells beyond both ends of a wall are closed."""
        columns, rows = wall.size
        longer = wall.grown(1, 0) if columns > rows else wall.grown(0, 1)
        beyond = self._occupied(longer)
        ends = beyond[:, [0, -1]] if columns > rows else beyond[[0, -1]]
        return not ends.any()

    def frontages(self, side: Frontage, deepest: int) -> Iterator[Frontage]:
        """The stretches of a side behind which rooms fit, and how deep they may be."""
        depths = self._depths(side, deepest)
        x, y = side.corner
        start = 0
        while start < side.length:
            end = start + 1
            while end < side.length and abs(depths[end] - depths[start]) < self._step:
                end += 1
            depth = int(depths[start:end].min())
            if depth >= self._least:
                corner = (x + start, y) if side.along == "x" else (x, y + start)
                yield replace(side, corner=corner, length=end - start, depth=depth)
            start = end

    def enlarged(self, dice: Dice, frontage: Frontage, room: Rect, back: int) -> Rect:
        """The room, mostly enlarged by free space behind it and at its sides; its front stays.

        If the space behind it is free, it ends with the others of its row, ``back`` cells from the
        corridor.
        """
        _, _, _, depth = frontage.extent(room)
        (ax, ay), inward = frontage.onward, frontage.inward
        for towards in dice.shuffled([inward, (ax, ay), (-ax, -ay)]):
            if dice.chance(3, 4):
                most = back - depth if towards == inward else dice.integer(0, self._growth)
                room = self._enlarged(room, towards, most)
        self.take(room)
        return room

    def _enlarged(self, room: Rect, towards: tuple[int, int], most: int) -> Rect:
        """The room, extended to the next one, or by ``most`` cells if none is near."""
        (dx, dy), thin, reach = towards, self._thin, self._growth + self._thin
        ahead: Literal[1, -1] = 1 if dx + dy > 0 else -1
        if dx:
            side = Frontage("y", (room.x1 if dx > 0 else room.x0, room.y0), ahead, room.size[1], 0)
        else:
            side = Frontage("x", (room.x0, room.y1 if dy > 0 else room.y0), ahead, room.size[0], 0)
        nearest = int(self._first_taken(side, thin, reach).min())
        more = most if nearest == reach else nearest - thin
        return room if more < 1 else room.joined(side.rect(0, side.length, 0, more))

    def _depths(self, side: Frontage, deepest: int) -> NDArray[np.int64]:
        """(length,) free cells behind each cell of a side, less a wall."""
        wall = self._wall
        nearest = self._first_taken(side, wall, deepest + wall)
        around = np.lib.stride_tricks.sliding_window_view(nearest, 2 * wall + 1).min(axis=1)
        return np.asarray(around - wall, np.int64)

    def _first_taken(self, side: Frontage, margin: int, depth: int) -> NDArray[np.int64]:
        """(length + 2 margin,) distance of the first occupied cell along a side and its margins."""
        strip = self._occupied(side.rect(-margin, side.length + margin, 0, depth))
        strip = strip if side.along == "x" else strip.T
        strip = strip if side.side > 0 else strip[::-1]
        return np.where(strip.any(axis=0), strip.argmax(axis=0), depth)

    def _occupied(self, part: Rect) -> NDArray[np.bool_]:
        """(rows, columns) occupied cells in a rectangle; cells off the site count as occupied."""
        occupied = np.ones(part.size[::-1], bool)
        inside = part.within(self._taken.shape)
        if min(inside.size) > 0:
            occupied[inside.moved(-part.x0, -part.y0).slices] = self._taken[inside.slices]
        return occupied


def _large_room(dice: Dice, style: Style, room: Rect, corridor: Rect) -> FloorPlan:
    """A gym or a lecture theatre at the right end of a corridor, and its door."""
    width = min(dice.length(*style.door_cm), corridor.size[1] - 2)
    low = dice.integer(corridor.y0 + 1, corridor.y1 - 1 - width)
    return FloorPlan(
        rooms=[room], doors=[Door(Rect(corridor.x1, low, room.x0, low + width), (1, 0))]
    )


def _open_up(dice: Dice, style: Style, frontage: Frontage, row: FloorPlan) -> None:
    """Make cased openings without leaves of some doors of a row, at times as wide as the room."""
    assert style.openings is not None
    for index, door in enumerate(row.doors):
        if door.inward != frontage.inward or not dice.chance(*style.openings):
            continue
        u0, u1, v0, v1 = frontage.extent(door.gap)
        beyond = frontage.rect(u0, u1, v1, v1 + 1)
        spans = [frontage.extent(room)[:2] for room in row.rooms if room.overlaps(beyond)]
        jamb = dice.cells(dice.choice((5, 10, 25)))
        low, high = (u0, u1)
        if spans:  # an enlarged room is longer than its side of the corridor
            low, high = max(spans[0][0], 0) + jamb, min(spans[0][1], frontage.length) - jamb
        width = min(max(u1 - u0, dice.length(*style.opening_cm)), high - low)
        start = min(max(low, (u0 + u1 - width) // 2), high - width)
        if width >= u1 - u0:
            gap = frontage.rect(start, start + width, v0, v1)
            row.doors[index] = Door(gap, door.inward, has_leaf=False)


def _pilasters(dice: Dice, corridor: Rect, plan: FloorPlan) -> list[Rect]:
    """Blocks along the sides of a corridor, where it stays wide enough and no door is near."""
    along: Literal["x", "y"] = "x" if corridor.size[0] > corridor.size[1] else "y"
    long, wide = max(corridor.size), min(corridor.size)
    side = Frontage(along, (corridor.x0, corridor.y0), 1, long, wide)
    pitch, length = dice.length(250, 700), dice.length(20, 150)
    deep = min(dice.length(12, 45), (wide - dice.cells(120)) // 2)
    clear = dice.cells(25)
    ways = [part for part in plan.corridors + plan.halls if part != corridor]
    blocks = []
    for start in range(dice.integer(0, pitch), long - length, pitch):
        for low, high in ((0, deep), (wide - deep, wide)):
            block = side.rect(start, start + length, low, max(low, high))
            around = block.grown(clear, clear)
            taken = any(around.overlaps(door.gap) for door in plan.doors)
            if deep > 0 and not taken and not any(around.overlaps(way) for way in ways):
                blocks.append(block)
    return blocks


def _add_inner_rooms(dice: Dice, style: Style, frontage: Frontage, row: FloorPlan) -> None:
    """Give some rooms of a row a washroom or a store in a corner."""
    # Leaves that would close it, or are wider than a door's, are taken off their hinges.
    inner, widest = FloorPlan(), dice.cells(_WIDEST_LEAF_CM)
    bare = [door for door in row.doors if max(door.gap.size) > widest]
    for room in row.rooms:
        if dice.chance(*style.inner_rooms):
            drawn = _inner_room(dice, frontage, room, row.doors)
            if drawn.doors:
                before = room.grown(dice.cells(40), dice.cells(40))
                bare += [door for door in row.doors if door.gap.overlaps(before)]
            inner.add(drawn)
    row.doors = [replace(door, has_leaf=door.has_leaf and door not in bare) for door in row.doors]
    if inner.doors:  # a door to the neighbours might lead into a washroom, or be walled up
        row.doors = [door for door in row.doors if door.inward == frontage.inward]
    row.add(inner)


def _inner_room(dice: Dice, frontage: Frontage, room: Rect, doors: list[Door]) -> FloorPlan:
    """A small room in a front corner of a room, where there is space next to its doors."""
    u0, u1, v0, v1 = frontage.extent(room)
    wide, deep = dice.length(140, 200), dice.length(150, 260)
    wall, clear = dice.cells(10), dice.cells(25)
    gap = dice.length(65, 80)
    at = dice.integer(v0 + wall, max(v0 + wall, v0 + deep - wall - gap))
    if v1 - v0 < deep + dice.cells(200) or u1 - u0 < wide + dice.cells(120):
        return FloorPlan()
    fronts = [frontage.extent(door.gap) for door in doors if door.inward == frontage.inward]
    for at_start in dice.shuffled([True, False]):
        low, high = (u0, u0 + wide + wall) if at_start else (u1 - wide - wall, u1)
        if any(low - clear < end and start < high + clear for start, end, _, _ in fronts):
            continue
        beside = (high - wall, high) if at_start else (low, low + wall)
        dx, dy = frontage.onward
        inward = (-dx, -dy) if at_start else (dx, dy)
        return FloorPlan(
            walls=[
                frontage.rect(*beside, v0, v0 + deep + wall),
                frontage.rect(low, high, v0 + deep, v0 + deep + wall),
            ],
            doors=[Door(frontage.rect(*beside, at, at + gap), inward, has_leaf=False)],
        )
    return FloorPlan()


def _add_back_rooms(dice: Dice, share: tuple[int, int], frontage: Frontage, row: FloorPlan) -> None:
    """Give some large rooms of a row smaller ones along their back wall, with doors to them."""
    for room in row.rooms:
        u0, u1, v0, v1 = frontage.extent(room)
        is_large = u1 - u0 >= dice.cells(800) and v1 - v0 >= dice.cells(700)
        if is_large and dice.chance(*share):
            row.add(_back_rooms(dice, frontage, (u0, u1), v1))


def _back_rooms(dice: Dice, frontage: Frontage, span: tuple[int, int], back: int) -> FloorPlan:
    """A row of small rooms along ``span``, whose back wall is ``back`` cells from the corridor."""
    plan, wall, narrowest = FloorPlan(), dice.cells(10), dice.cells(230)
    front = back - dice.length(240, 380)
    start, end = span
    plan.walls.append(frontage.rect(start, end, front - wall, front))
    while start < end:
        stop = min(end, start + dice.length(250, 480))
        stop = end if end - stop < narrowest else stop
        width = dice.length(75, 100)
        low = dice.integer(start + wall, stop - wall - width)
        door = frontage.rect(low, low + width, front - wall, front)
        plan.doors.append(Door(door, frontage.inward, has_leaf=dice.chance(1, 2)))
        if stop < end:
            plan.walls.append(frontage.rect(stop, stop + wall, front, back))
        start = stop + wall
    return plan


def _fire_door(dice: Dice, corridor: Rect, plan: FloorPlan, site: Site) -> FloorPlan:
    """A glazed wall with a door across a corridor, where there is space for one."""
    clear = dice.cells(80)
    for _ in range(4):
        at = dice.integer(clear, max(clear, max(corridor.size) - 2 * clear))
        drawn = partition(dice, corridor, at)
        around = drawn.walls[0].grown(clear, clear)
        if site.is_flanked(drawn.walls[0]) and not any(
            around.overlaps(door.gap) for door in plan.doors
        ):
            return drawn
    return FloorPlan()
