"""Doorways across free space, and the parts that they divide regions into.

A doorway is tried by letting water spread from all cells around its gap at the same speed. Waters
that meet are one part; a water that has nowhere to go has filled a part. What is left, once a
single water of a part still spreads, need not be visited: its cells are counted by subtraction. So
a trial visits about as many cells as the smaller part has, or as lie on the way around the gap.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import fused, inlined, njit
from pgm_places.topology._refinement_kernels import write_chords

__all__ = ["Candidates", "Doorways", "Drawing", "Floor", "Room", "part_regions"]

GAP, NEAR = -1, -2


class Floor(NamedTuple):
    """What is parted; doorways are drawn into it. Cells are numbered row by row."""

    labels: Any
    """(H, W) int16, -1 for none."""
    piece: Any
    """(H W,) int32, the region of each cell, -1 for doorways and cells without a label."""
    part: Any
    """(H W,) int32, the connected part of what is left of the regions, -1 for none."""
    size: Any
    """Cells of each part, int64."""
    n_parts: Any
    """(1,) int64."""


class Room(NamedTuple):
    """Arrays to work in: cells, then one entry for each water, then one for each part touched."""

    mark: Any
    """(H W,) int32: 0, the water that a cell is under, or what it is to the gap."""
    queue: Any
    """(H W,) int64."""
    gap: Any
    """Cells of the gap, int64."""
    parent: Any
    """The water that a water has joined, int32."""
    cells: Any
    """Cells under a water, int64."""
    spreading: Any
    """Cells that it may spread from, int64."""
    place: Any
    """Where its part is in the arrays below, int32."""
    fresh: Any
    """The number that a filled part gets, int32."""
    touched: Any
    """Numbers of the parts around the gap, int32."""
    region: Any
    """The piece that such a part is of, int32."""
    lost: Any
    """Cells of such a part in the gap, int64."""
    waters: Any
    """Waters that spread in it, int64."""
    left: Any
    """Its cells outside the gap that are not in filled parts, int64."""


class Candidates(NamedTuple):
    """Cells that chords are drawn through: ``start[k]`` to ``start[k + 1]`` are those of k."""

    start: Any
    """(M + 1,) int64."""
    rows: Any
    """(n,) int64."""
    columns: Any
    """(n,) int64."""
    directions: Any
    """(D, 2) float64, a row and a column step of length 1."""
    longest: float
    """Of the chords, in cells."""


class Drawing(NamedTuple):
    """How a doorway is drawn, and when."""

    label: int
    reach: float
    """Cells up to this far from the chord are the doorway's."""
    cell_m2: float
    least_m2: float
    """Area of the smaller part from which on it is drawn."""


class Doorways(NamedTuple):
    """What has been drawn: an entry for each doorway, and their cells one after the other."""

    ends: Any
    """(M, 4) float64, row and column of the chord's ends."""
    piece: Any
    """(M,) int32, the region that it parts."""
    sizes: Any
    """(M, 2) int64, cells of the larger and the smaller part."""
    stop: Any
    """(M,) int64, where its cells end in ``cells``."""
    cells: Any
    """(H W,) int64."""


@inlined
def _first_water(room: Room, water: int) -> int:
    """The water that this one has become part of, with path halving."""
    while room.parent[water] != water:
        room.parent[water] = room.parent[room.parent[water]]
        water = room.parent[water]
    return water


@inlined
def _is_close(y: float, x: float, y0: float, x0: float, dy: float, dx: float, reach: float) -> bool:
    """Whether a cell is at most ``reach`` away from the line that leads from one end to another."""
    share = ((y - y0) * dy + (x - x0) * dx) / max(dy * dy + dx * dx, 1e-12)
    share = min(max(share, 0.0), 1.0)
    away_y, away_x = (y - y0) - share * dy, (x - x0) - share * dx
    return away_y * away_y + away_x * away_x <= reach * reach


@fused
def _spread_near(floor: Floor, room: Room, home: int) -> None:
    """Mark the cells near a line that are connected to ``home`` as its gap."""
    height, width = floor.labels.shape
    room.queue[0], tail, head = home, 1, 0
    room.mark[home] = GAP
    while head < tail:
        r, c = room.queue[head] // width, room.queue[head] % width
        head += 1
        for y in range(max(r - 1, 0), min(r + 2, height)):
            for x in range(max(c - 1, 0), min(c + 2, width)):
                if room.mark[y * width + x] == NEAR:
                    room.mark[y * width + x] = GAP
                    room.queue[tail] = y * width + x
                    tail += 1


@fused
def _find_gap(
    floor: Floor, room: Room, y0: float, x0: float, y1: float, x1: float, reach: float, doorway: int
) -> int:
    """Number of cells in the gap of a chord: the labelled ones connected to its middle."""
    height, width = floor.labels.shape
    top = min(max(int(np.floor(min(y0, y1) - reach)), 0), height)
    left = min(max(int(np.floor(min(x0, x1) - reach)), 0), width)
    bottom = min(max(int(np.ceil(max(y0, y1) + reach)) + 1, top), height)
    right = min(max(int(np.ceil(max(x0, x1) + reach)) + 1, left), width)
    home, nearest = -1, np.inf
    for y in range(top, bottom):
        for x in range(left, right):
            if floor.labels[y, x] < 0 or not _is_close(y, x, y0, x0, y1 - y0, x1 - x0, reach):
                continue
            room.mark[y * width + x] = NEAR
            away = (y - (y0 + y1) / 2) ** 2 + (x - (x0 + x1) / 2) ** 2
            if away < nearest:
                home, nearest = y * width + x, away
    if home < 0:
        return 0
    _spread_near(floor, room, home)
    count = 0
    for y in range(top, bottom):
        for x in range(left, right):
            cell = y * width + x
            if room.mark[cell] == GAP and floor.labels[y, x] != doorway:
                room.gap[count] = cell
                count += 1
            else:
                room.mark[cell] = 0
    return count


@inlined
def _position(values: NDArray[np.int32], count: int, wanted: int) -> int:
    """Where a value is among the first few, ``count`` if it is not there."""
    at = 0
    while at < count and values[at] != wanted:
        at += 1
    return at


@fused
def _main_piece(floor: Floor, room: Room, n_gap: int) -> int:
    """The piece with the most cells in the gap, the first of several."""
    count = 0
    for cell in room.gap[:n_gap]:
        at = _position(room.touched, count, floor.piece[cell])
        if at == count:
            room.touched[at], room.lost[at] = floor.piece[cell], 0
            count += 1
        room.lost[at] += 1
    best = 0
    for at in range(1, count):
        more = room.lost[at] - room.lost[best]
        if more > 0 or (more == 0 and room.touched[at] < room.touched[best]):
            best = at
    return room.touched[best]


@inlined
def _touch(floor: Floor, room: Room, count: int, cell: int) -> int:
    """Where a cell's part is among those around the gap; a new one is added at ``count``."""
    part = floor.part[cell]
    at = _position(room.touched, count, part)
    if at == count:
        room.touched[at], room.region[at] = part, floor.piece[cell]
        room.lost[at], room.waters[at], room.left[at] = 0, 0, floor.size[part]
    return at


@fused
def _pour(floor: Floor, room: Room, n_gap: int) -> tuple[int, int]:
    """Number of waters and of parts around a gap."""
    height, width = floor.labels.shape
    n_waters, n_touched = 0, 0
    for cell in room.gap[:n_gap]:
        at = _touch(floor, room, n_touched, cell)
        n_touched = max(n_touched, at + 1)
        room.lost[at] += 1
        room.left[at] -= 1
    for cell in room.gap[:n_gap]:
        r, c = cell // width, cell % width
        for y in range(max(r - 1, 0), min(r + 2, height)):
            for x in range(max(c - 1, 0), min(c + 2, width)):
                near = y * width + x
                if room.mark[near] != 0 or floor.part[near] < 0:
                    continue
                at = _touch(floor, room, n_touched, near)
                n_touched = max(n_touched, at + 1)
                if room.lost[at] == 0 and room.waters[at] > 0:
                    continue  # a part that loses nothing stays whole
                room.waters[at] += 1
                room.queue[n_waters] = near
                n_waters += 1  # counted from 1, because 0 marks dry cells
                room.mark[near] = room.parent[n_waters] = n_waters
                room.cells[n_waters] = room.spreading[n_waters] = 1
                room.place[n_waters], room.fresh[n_waters] = at, -1
    return n_waters, n_touched


@inlined
def _join(room: Room, water: int, other: int) -> None:
    """Let a water take up another one."""
    room.parent[other] = water
    room.cells[water] += room.cells[other]
    room.spreading[water] += room.spreading[other]
    room.waters[room.place[water]] -= 1


@inlined
def _has_filled(room: Room, water: int) -> bool:
    """Whether a water has filled a part."""
    return room.parent[water] == water and room.spreading[water] == 0


@fused
def _flow(floor: Floor, room: Room, n_waters: int, n_touched: int) -> int:
    """Number of cells visited until no part has two waters that spread."""
    width, n_cells = floor.labels.shape[1], floor.labels.size
    head, tail = 0, n_waters
    undecided = 0
    for at in range(n_touched):
        undecided += room.waters[at] > 1
    while undecided > 0:
        cell = room.queue[head]
        head += 1
        water = _first_water(room, room.mark[cell])
        at = room.place[water]
        if room.waters[at] < 2:
            continue
        own, c = floor.part[cell], cell % width
        first, last = -1 if c > 0 else 0, 1 if c + 1 < width else 0
        for row in range(cell - width, cell + width + 1, width):
            if row < 0 or row >= n_cells:
                continue
            for near in range(row + first, row + last + 1):
                state = room.mark[near]
                if floor.part[near] != own or state == GAP:
                    continue
                if state == 0:
                    room.mark[near] = water
                    room.queue[tail] = near
                    tail += 1
                    room.cells[water] += 1
                    room.spreading[water] += 1
                    continue
                other = _first_water(room, state)
                if other != water:
                    _join(room, water, other)
        room.spreading[water] -= 1
        if room.spreading[water] == 0:
            room.waters[at] -= 1
            room.left[at] -= room.cells[water]
        undecided -= room.waters[at] < 2
    return tail


@fused
def _two_largest(room: Room, n_waters: int, n_touched: int, piece: int) -> tuple[int, int]:
    """Cells of the two largest parts of a piece around the gap, 0 if there are fewer."""
    first, second = 0, 0
    for k in range(n_waters + n_touched):
        at = k if k < n_touched else room.place[k - n_touched + 1]
        water = 0 if k < n_touched else k - n_touched + 1
        size = 0
        if room.region[at] == piece and water == 0 and room.waters[at] > 0:
            size = room.left[at]
        elif room.region[at] == piece and water > 0 and _has_filled(room, water):
            size = room.cells[water]
        first, second = max(first, size), max(second, min(first, size))
    return first, second


@fused
def _draw(floor: Floor, room: Room, n_gap: int, n_touched: int, n_wet: int, doorway: int) -> None:
    """Make the gap a doorway, and number the parts that have been filled anew."""
    for at in range(n_touched):
        floor.size[room.touched[at]] = room.left[at]
    for cell in room.queue[:n_wet]:
        water = _first_water(room, room.mark[cell])
        if not _has_filled(room, water):
            continue
        if room.fresh[water] < 0:
            room.fresh[water] = floor.n_parts[0]
            floor.size[floor.n_parts[0]] = room.cells[water]
            floor.n_parts[0] += 1
        floor.part[cell] = room.fresh[water]
    width = floor.labels.shape[1]
    for cell in room.gap[:n_gap]:
        floor.labels[cell // width, cell % width] = doorway
        floor.part[cell] = -1


@inlined
def _dry(room: Room, n_gap: int, n_wet: int) -> None:
    """Unmark all cells."""
    for cell in room.queue[:n_wet]:
        room.mark[cell] = 0
    for cell in room.gap[:n_gap]:
        room.mark[cell] = 0


@njit
def part_regions(
    floor: Floor,
    room: Room,
    blocked: NDArray[np.bool_],
    candidates: Candidates,
    drawing: Drawing,
    doorways: Doorways,
) -> int:
    """Draw the doorways that part a region in two, and return their number.

    Of each candidate's chords the shortest that leaves two large enough parts is drawn, at most
    one; ``doorways`` receives it.
    """
    start, directions = candidates.start, candidates.directions
    length, chord = np.empty(len(directions)), np.empty((len(directions), 4))
    found, filled = 0, 0
    for k in range(len(start) - 1):
        own = slice(start[k], start[k + 1])
        rows, columns = candidates.rows[own], candidates.columns[own]
        write_chords(blocked, rows, columns, directions, candidates.longest, length, chord)
        while True:
            d = np.argmin(length)
            if not length[d] < np.inf:
                break
            length[d] = np.inf
            y0, x0, y1, x1 = chord[d]
            n_gap = _find_gap(floor, room, y0, x0, y1, x1, drawing.reach, drawing.label)
            if n_gap == 0:
                continue
            piece = _main_piece(floor, room, n_gap)
            n_waters, n_touched = _pour(floor, room, n_gap)
            n_wet = _flow(floor, room, n_waters, n_touched)
            first, second = _two_largest(room, n_waters, n_touched, piece)
            splits = second > 0 and not second * drawing.cell_m2 < drawing.least_m2
            if splits:
                _draw(floor, room, n_gap, n_touched, n_wet, drawing.label)
            _dry(room, n_gap, n_wet)
            if splits:
                doorways.ends[found], doorways.piece[found] = chord[d], piece
                doorways.sizes[found, 0], doorways.sizes[found, 1] = first, second
                doorways.cells[filled : filled + n_gap] = room.gap[:n_gap]
                filled += n_gap
                doorways.stop[found] = filled
                found += 1
                break
    return found
