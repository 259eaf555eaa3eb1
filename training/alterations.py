"""Alterations of training floors: passage doors, furniture in rows, coarse cells, grey walls."""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]
Point = NDArray[np.float64]

ROOM, DOORWAY, CIRCULATION = 2, 3, (1, 4, 5)
"""Values of ``labels``, as in :class:`pgm_places.training.crops.LabelledFloor`."""

_DOORWAY_DEPTH = 8
"""Cells of 0.1 m, as on all other floors."""

_NARROWEST, _WIDEST, _LEAST_AHEAD = 11, 34, 20
"""Widths of passages that get doors across them, and least length beyond, in cells."""

_TURNS = np.linspace(0, np.pi, 24, endpoint=False)


class Piece(NamedTuple):
    """A piece of a floor, in cells of 0.1 m, that is altered in place."""

    free: Bytes
    """(h, w) share that is free."""
    occupied: Bytes
    """(h, w) 255 where any part is occupied."""
    labels: Bytes
    """(h, w)."""

    def block(self, cells: NDArray[np.bool_], *, seen: bool = True) -> None:
        """Close cells, as walls or as unknown space."""
        if seen:
            self.occupied[cells] = 255
        self.free[cells] = 0
        self.labels[cells] = 0

    def wall(self, start: Point, end: Point, rng: np.random.Generator) -> None:
        """A wall of one or two cells from one (row, column) to another."""
        drawn = np.zeros_like(self.labels)
        _draw(drawn, start, end, int(rng.integers(1, 3)))
        self.block(drawn > 0)


def hang_passage_doors(piece: Piece, rng: np.random.Generator) -> None:
    """Open double doors across corridors, as in hospitals and schools, of which mostly jambs show.

    At a few points of a corridor, jambs of 0.1 to 0.3 m project from both walls, at times with
    leaves along the walls, or with one leaf closed; the cells between them become a doorway. At
    other points, a single piece projects from one wall, and labels do not change.
    """
    circulation = np.isin(piece.labels, CIRCULATION)
    inside = np.argwhere(circulation[::2, ::2]) * 2
    for _ in range(rng.integers(2, 16) if len(inside) else 0):
        point = inside[rng.integers(len(inside))].astype(np.float64)
        ends = _across(piece.free > 127, point)
        if ends is None:
            continue
        if rng.random() < 0.25:
            across = ends[1] - ends[0]
            width = float(np.hypot(*across))
            tip = ends[0] + across / width * min(float(rng.integers(1, 5)), width / 3)
            piece.wall(ends[0], tip, rng)
        elif not _near(piece.labels, ends.mean(axis=0), DOORWAY):
            _hang(piece, ends, circulation, rng)


def _across(free: NDArray[np.bool_], point: Point) -> Point | None:
    """(2, 2) the ends of the shortest line across a passage at a point; None off passages."""
    ways = np.stack([np.sin(_TURNS), np.cos(_TURNS)], axis=1)
    reach = np.array([[_reach(free, point, sign * way) for sign in (1, -1)] for way in ways])
    width = reach.sum(axis=1)
    k = int(width.argmin())
    along = reach[(k + len(_TURNS) // 2) % len(_TURNS)]
    if not (_NARROWEST <= width[k] <= _WIDEST and along.min() >= _LEAST_AHEAD):
        return None
    return np.stack([point + reach[k, 0] * ways[k], point - reach[k, 1] * ways[k]])


def _reach(free: NDArray[np.bool_], point: Point, way: Point) -> int:
    """The number of consecutive free cells from a point on."""
    steps = np.arange(_WIDEST + 1)[:, np.newaxis]
    cells = np.rint(point + steps * way).astype(np.int64)
    inside = ((cells >= 0) & (cells < free.shape)).all(axis=1)
    cells = np.clip(cells, 0, np.array(free.shape) - 1)
    is_free = inside & free[cells[:, 0], cells[:, 1]]
    return int(np.logical_and.accumulate(is_free).sum())


def _near(labels: Bytes, point: Point, label: int) -> bool:
    y, x = np.rint(point).astype(np.int64)
    return bool((labels[max(y - 8, 0) : y + 8, max(x - 8, 0) : x + 8] == label).any())


def _hang(
    piece: Piece, ends: Point, circulation: NDArray[np.bool_], rng: np.random.Generator
) -> None:
    width = float(np.hypot(*(ends[1] - ends[0])))
    across = (ends[1] - ends[0]) / width
    ahead = np.array([-across[1], across[0]]) * rng.choice([-1, 1])
    jambs = np.clip(rng.integers(1, 4, size=2) + (width > 22) * rng.integers(0, 4), 1, width / 4)
    corners = [ends[0] + jambs[0] * across, ends[1] - jambs[1] * across]
    strip = np.zeros_like(piece.labels)
    _draw(strip, corners[0] + across, corners[1] - across, _DOORWAY_DEPTH)
    piece.labels[(strip > 0) & circulation & (piece.free > 0)] = DOORWAY
    kind = rng.random()
    for end, corner in zip(ends, corners, strict=True):
        piece.wall(end, corner, rng)
        if kind < 0.45:
            leaf = min(width / 2, rng.uniform(6, 12))
            piece.wall(corner, corner + leaf * ahead, rng)
    if kind > 0.85:
        piece.wall(corners[0], (corners[0] + corners[1]) / 2, rng)


def _draw(image: Bytes, start: Point, end: Point, thickness: int) -> None:
    """Draw a line with square ends from one (row, column) to another."""
    way = end - start
    angle = float(np.degrees(np.arctan2(way[0], way[1])))
    _rectangle(image, (start + end)[::-1] / 2, (float(np.hypot(*way)) + 1, thickness), angle)


def _rectangle(image: Bytes, centre_xy: Point, size: tuple[float, float], degrees: float) -> None:
    x, y = centre_xy.tolist()
    box = cv2.boxPoints(((x, y), (float(size[0]), float(size[1])), degrees))
    cv2.fillPoly(image, [np.rint(box).astype(np.int32)], 255)


def put_up_shelves(piece: Piece, rng: np.random.Generator) -> None:
    """Rows of shelves and counters in large rooms, as in shops, libraries and warehouses.

    The aisles between them are as wide as doorways and corridors, but keep the label room.
    """
    for room in _rooms(piece, 2500):
        if rng.random() < 0.7:
            _fill(piece, room, rng)


def _rooms(piece: Piece, least_cells: int) -> list[NDArray[np.bool_]]:
    """The rooms with more than a number of cells."""
    n, part, stats, _ = cv2.connectedComponentsWithStats((piece.labels == ROOM).astype(np.uint8))
    return [part == k for k in range(1, n) if stats[k, cv2.CC_STAT_AREA] > least_cells]


class _Lattice(NamedTuple):
    """The narrowest rectangle around a room, almost along its walls, in (x, y)."""

    middle: Point
    wide: float
    high: float
    axes: NDArray[np.float64]
    degrees: float

    @classmethod
    def of(cls, room: NDArray[np.bool_], rng: np.random.Generator) -> "_Lattice":
        points = np.argwhere(room)[:, ::-1].astype(np.float32)
        (x, y), (wide, high), angle = cv2.minAreaRect(points)
        if rng.random() < 0.5:
            wide, high, angle = high, wide, angle + 90
        turn = np.radians(angle + rng.normal() * 1.5)
        axes = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        return cls(np.array([x, y]), wide, high, axes, float(np.degrees(turn)))


def _fill(piece: Piece, room: NDArray[np.bool_], rng: np.random.Generator) -> None:
    """Shelves on a lattice, along the longer side of the room's narrowest rectangle or across."""
    origin, wide, high, axes, degrees = _Lattice.of(room, rng)
    thick, aisle = rng.uniform(4, 14), rng.uniform(7, 25)
    long, gap = rng.uniform(15, 80), rng.uniform(6, 20)
    shelves = np.zeros_like(piece.labels)
    for b in np.arange(-high / 2 + aisle, high / 2 - aisle, thick + aisle):
        for a in np.arange(-wide / 2 + gap, wide / 2 - gap, long + gap):
            if rng.random() < 0.15:
                continue
            length = min(long, wide / 2 - gap / 2 - a)
            middle = origin + (a + length / 2) * axes[0] + (b + thick / 2) * axes[1]
            _rectangle(shelves, middle, (max(length, 1), thick), degrees)
    there = _placed(piece, shelves, room, 8)
    rim = there & (cv2.erode(there.astype(np.uint8), np.ones((3, 3), np.uint8)) == 0)
    piece.occupied[there if rng.random() < 0.4 else rim] = 255
    piece.block(there, seen=False)


def put_up_desks(piece: Piece, rng: np.random.Generator) -> None:
    """Groups of desks and partitions in large rooms, as in open-plan offices.

    A robot's laser sees desks as legs, as boxes, or as the screens between them.
    """
    for room in _rooms(piece, 4000):
        if rng.random() < 0.7:
            _fill_with_desks(piece, room, rng)


def _fill_with_desks(piece: Piece, room: NDArray[np.bool_], rng: np.random.Generator) -> None:
    """Desks in pairs on a lattice along the room's narrowest rectangle, all drawn in one way."""
    origin, wide, high, axes, degrees = _Lattice.of(room, rng)
    long, deep = rng.uniform(12, 20), rng.uniform(14, 18)
    aisle, gap = rng.uniform(10, 25), rng.uniform(0, 12)
    drawn_as = rng.choice(["legs", "boxes", "screens"])
    desks = np.zeros_like(piece.labels)
    for b in np.arange(-high / 2 + aisle, high / 2 - aisle, deep + aisle):
        for a in np.arange(-wide / 2 + aisle, wide / 2 - aisle, long + gap):
            if rng.random() < 0.2:
                continue
            middle = origin + a * axes[0] + b * axes[1]
            if drawn_as == "legs":
                for side in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
                    leg = middle + (np.array(side) * (long, deep) / 2) @ axes
                    _rectangle(desks, leg, (1, 1), degrees)
            else:
                thick = deep if drawn_as == "boxes" else 1
                _rectangle(desks, middle, (long, thick), degrees)
    piece.block(_placed(piece, desks, room, 6))


def _placed(
    piece: Piece, furniture: Bytes, room: NDArray[np.bool_], from_doors: int
) -> NDArray[np.bool_]:
    """The cells of furniture in a room, more than ``from_doors`` cells away from doorways."""
    doors = (piece.labels == DOORWAY).astype(np.uint8)
    near = cv2.dilate(doors, np.ones((2 * from_doors + 1,) * 2, np.uint8)) > 0
    return np.asarray((furniture > 0) & room & ~near, np.bool_)


def coarsen(piece: Piece, rng: np.random.Generator) -> None:
    """Cells of 0.1 or 0.2 m instead of smaller ones: free or not, with walls one cell thick."""
    piece.free[:] = np.where((piece.free > 127) & (piece.occupied == 0), 255, 0)
    if rng.random() < 0.5:
        piece.occupied[::2, ::2] = np.maximum.reduce(
            [piece.occupied[i::2, j::2] for i in (0, 1) for j in (0, 1)]
        )
        for values in piece:
            values[:] = np.repeat(np.repeat(values[::2, ::2], 2, axis=0), 2, axis=1)
        piece.free[piece.occupied > 0] = 0


def grey_walls(piece: Piece, rng: np.random.Generator) -> None:
    """Walls, all or in one part, too uncertain to count as occupied: unknown cells."""
    unsure = np.ones(piece.occupied.shape, np.bool_)
    if rng.random() < 0.5:
        y, x = rng.integers(0, len(unsure), size=2)
        unsure[:y, :x] = False
    seen_again = rng.random(unsure.shape) < rng.choice([0.0, 0.2, 0.5])
    piece.block((piece.occupied > 0) & unsure & ~seen_again, seen=False)
    piece.occupied[unsure & ~seen_again] = 0


def leave_one_room(piece: Piece, rng: np.random.Generator) -> None:
    """Keep one room with its walls; the rest of the building becomes unknown."""
    rooms = _rooms(piece, 2000)
    if not rooms:
        return
    room = rooms[rng.integers(len(rooms))].astype(np.uint8)
    beyond = cv2.dilate(room, np.ones((9, 9), np.uint8)) == 0
    piece.free[beyond | ((piece.labels > 0) & ~np.isin(piece.labels, (ROOM, DOORWAY)))] = 0
    piece.occupied[beyond] = 0
    piece.labels[beyond | ~np.isin(piece.labels, (ROOM, DOORWAY))] = 0
