"""What plans do not show and buildings have: doors across passages, shelves, rooms mapped alone."""

import cv2
import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]

ROOM, DOORWAY, CIRCULATION = 2, 3, (1, 4, 5)
"""Values of ``labels``, all as :class:`pgm_places.floor.crops.LabelledFloor` has them."""

_DOORWAY_DEPTH = 8
"""Cells of 0.1 m, as on all other floors."""

_NARROWEST, _WIDEST, _LEAST_AHEAD = 11, 34, 20
"""Passages that have doors across them, and how far they go on, in cells."""

_TURNS = np.linspace(0, np.pi, 24, endpoint=False)


def hang_passage_doors(
    free: Bytes, occupied: Bytes, labels: Bytes, rng: np.random.Generator
) -> None:
    """Double doors across corridors that stand open, as in hospitals and schools: little but jambs.

    At a few places of a corridor, jambs of 0.1 to 0.3 m stand out from both walls, at times with
    leaves along the walls, or with one leaf closed; what is between them becomes a doorway. At
    others, a single piece stands out from one wall, and nothing changes.
    """
    circulation = np.isin(labels, CIRCULATION)
    inside = np.argwhere(circulation[::2, ::2]) * 2
    for _ in range(rng.integers(2, 16) if len(inside) else 0):
        point = inside[rng.integers(len(inside))].astype(np.float64)
        ends = _across(free > 127, point)
        if ends is None:
            continue
        if rng.random() < 0.25:
            across = ends[1] - ends[0]
            width = float(np.hypot(*across))
            tip = ends[0] + across / width * min(float(rng.integers(1, 5)), width / 3)
            _wall(free, occupied, labels, ends[0], tip, rng)
        elif not _near(labels, ends.mean(axis=0), DOORWAY):
            _hang(free, occupied, labels, ends, circulation, rng)


def _across(free: NDArray[np.bool_], point: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """(2, 2) the ends of the shortest line across a passage at a point; None where there is none.

    A passage goes on for two metres, or until it is not seen, on both sides of the line.
    """
    ways = np.stack([np.sin(_TURNS), np.cos(_TURNS)], axis=1)
    reach = np.array([[_reach(free, point, sign * way) for sign in (1, -1)] for way in ways])
    width = reach.sum(axis=1)
    k = int(width.argmin())
    along = reach[(k + len(_TURNS) // 2) % len(_TURNS)]
    if not (_NARROWEST <= width[k] <= _WIDEST and along.min() >= _LEAST_AHEAD):
        return None
    return np.stack([point + reach[k, 0] * ways[k], point - reach[k, 1] * ways[k]])


def _reach(free: NDArray[np.bool_], point: NDArray[np.float64], way: NDArray[np.float64]) -> int:
    """How many cells are free in a row from a point on."""
    steps = np.arange(_WIDEST + 1)[:, np.newaxis]
    cells = np.rint(point + steps * way).astype(np.int64)
    inside = ((cells >= 0) & (cells < free.shape)).all(axis=1)
    cells = np.clip(cells, 0, np.array(free.shape) - 1)
    is_free = inside & free[cells[:, 0], cells[:, 1]]
    return int(np.logical_and.accumulate(is_free).sum())


def _near(labels: Bytes, point: NDArray[np.float64], label: int) -> bool:
    y, x = np.rint(point).astype(np.int64)
    return bool((labels[max(y - 8, 0) : y + 8, max(x - 8, 0) : x + 8] == label).any())


def _hang(
    free: Bytes,
    occupied: Bytes,
    labels: Bytes,
    ends: NDArray[np.float64],
    circulation: NDArray[np.bool_],
    rng: np.random.Generator,
) -> None:
    width = float(np.hypot(*(ends[1] - ends[0])))
    across = (ends[1] - ends[0]) / width
    ahead = np.array([-across[1], across[0]]) * rng.choice([-1, 1])
    jambs = np.clip(rng.integers(1, 4, size=2) + (width > 22) * rng.integers(0, 4), 1, width / 4)
    corners = [ends[0] + jambs[0] * across, ends[1] - jambs[1] * across]
    strip = np.zeros_like(labels)
    _draw(strip, corners[0] + across, corners[1] - across, _DOORWAY_DEPTH)
    inside = (strip > 0) & circulation & (free > 0)
    labels[inside] = DOORWAY
    kind = rng.random()
    for end, corner in zip(ends, corners, strict=True):
        _wall(free, occupied, labels, end, corner, rng)
        if kind < 0.45:
            leaf = min(width / 2, rng.uniform(6, 12))
            _wall(free, occupied, labels, corner, corner + leaf * ahead, rng)
    if kind > 0.85:
        _wall(free, occupied, labels, corners[0], (corners[0] + corners[1]) / 2, rng)


def _wall(
    free: Bytes,
    occupied: Bytes,
    labels: Bytes,
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    rng: np.random.Generator,
) -> None:
    piece = np.zeros_like(labels)
    _draw(piece, start, end, int(rng.integers(1, 3)))
    occupied[piece > 0] = 255
    free[piece > 0] = 0
    labels[piece > 0] = 0


def _draw(
    image: Bytes, start: NDArray[np.float64], end: NDArray[np.float64], thickness: int
) -> None:
    """A line of square ends from one (row, column) to another."""
    way = end - start
    length = float(np.hypot(*way))
    centre = (start + end) / 2
    angle = float(np.degrees(np.arctan2(way[0], way[1])))
    box = cv2.boxPoints(
        ((float(centre[1]), float(centre[0])), (length + 1, float(thickness)), angle)
    )
    cv2.fillPoly(image, [np.rint(box).astype(np.int32)], 255)


def put_up_shelves(free: Bytes, occupied: Bytes, labels: Bytes, rng: np.random.Generator) -> None:
    """Rows of shelves and counters in large rooms, as in shops, libraries and warehouses.

    The aisles between them are as wide as doorways and corridors, and remain room.
    """
    n, part, stats, _ = cv2.connectedComponentsWithStats((labels == ROOM).astype(np.uint8))
    large = [k for k in range(1, n) if stats[k, cv2.CC_STAT_AREA] > 2500]
    for k in large:
        if rng.random() < 0.7:
            _fill(free, occupied, labels, part == k, rng)


def _fill(
    free: Bytes,
    occupied: Bytes,
    labels: Bytes,
    room: NDArray[np.bool_],
    rng: np.random.Generator,
) -> None:
    """Shelves on a lattice, along the longer side of the room's narrowest rectangle or across."""
    points = np.argwhere(room)[:, ::-1].astype(np.float32)
    (x, y), (wide, high), angle = cv2.minAreaRect(points)
    if rng.random() < 0.5:
        wide, high, angle = high, wide, angle + 90
    thick, aisle = rng.uniform(4, 14), rng.uniform(7, 25)
    piece, gap = rng.uniform(15, 80), rng.uniform(6, 20)
    turn = np.radians(angle + rng.normal() * 1.5)
    axes = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    shelves = np.zeros_like(labels)
    for b in np.arange(-high / 2 + aisle, high / 2 - aisle, thick + aisle):
        for a in np.arange(-wide / 2 + gap, wide / 2 - gap, piece + gap):
            if rng.random() < 0.15:
                continue
            length = min(piece, wide / 2 - gap / 2 - a)
            middle = np.array([x, y]) + (a + length / 2) * axes[0] + (b + thick / 2) * axes[1]
            size = (float(max(length, 1)), float(thick))
            box = cv2.boxPoints(((float(middle[0]), float(middle[1])), size, np.degrees(turn)))
            cv2.fillPoly(shelves, [np.rint(box).astype(np.int32)], 255)
    near_doors = cv2.dilate((labels == DOORWAY).astype(np.uint8), np.ones((17, 17), np.uint8))
    there = (shelves > 0) & room & (near_doors == 0)
    rim = there & (cv2.erode(there.astype(np.uint8), np.ones((3, 3), np.uint8)) == 0)
    occupied[there if rng.random() < 0.4 else rim] = 255
    free[there] = 0
    labels[there] = 0


def leave_one_room(free: Bytes, occupied: Bytes, labels: Bytes, rng: np.random.Generator) -> None:
    """A single room with its walls; the rest of the building was never seen."""
    n, part, stats, _ = cv2.connectedComponentsWithStats((labels == ROOM).astype(np.uint8))
    large = [k for k in range(1, n) if stats[k, cv2.CC_STAT_AREA] > 2000]
    if not large:
        return
    room = (part == large[rng.integers(len(large))]).astype(np.uint8)
    kept = cv2.dilate(room, np.ones((9, 9), np.uint8)) > 0
    free[~kept | ((labels > 0) & (labels != ROOM) & (labels != DOORWAY))] = 0
    occupied[~kept] = 0
    labels[~kept | ((labels != ROOM) & (labels != DOORWAY))] = 0
