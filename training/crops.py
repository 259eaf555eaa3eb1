"""Augmented training crops of labelled floors."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from pgm_places.floor.raster import network_inputs, open_cells
from pgm_places.training.alterations import (
    CIRCULATION,
    DOORWAY,
    ROOM,
    Bytes,
    Piece,
    coarsen,
    grey_walls,
    hang_passage_doors,
    leave_one_room,
    put_up_desks,
    put_up_shelves,
)

SIDE = 320
"""Rows and columns of a crop, in cells of 0.1 m."""

N_TARGETS = 5
"""Corridor, room, doorway, hall, and circulation that may be corridor or hall."""

_KNOT = 64
"""Cells between the random points of a drift."""


@dataclass(frozen=True, eq=False)
class LabelledFloor:
    """A floor with its labels, in cells of 0.1 m.

    Parameters
    ----------
    free, occupied : (h, w) uint8
        Share that is free, and 255 where any part is occupied.
    labels : (h, w) uint8
        0 not judged, then the targets by number.
    drawn : bool
        Whether nothing stands in it yet.
    centres : (n, 2) int
        Some labelled cells, around which pieces are cut.
    """

    free: Bytes
    occupied: Bytes
    labels: Bytes
    drawn: bool
    centres: NDArray[np.int64]

    @classmethod
    def of(cls, free: Bytes, occupied: Bytes, labels: Bytes, *, drawn: bool) -> "LabelledFloor":
        """The floor, with five thousand centres spread over its labelled cells."""
        cells = np.argwhere(labels > 0)
        some = np.random.default_rng(0).permutation(len(cells))[:5000]
        return cls(free, occupied, labels, drawn, cells[some])


def crop(
    floor: LabelledFloor, rng: np.random.Generator
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Inputs (160, 160, 10) and shares of the targets (160, 160, 5) of an altered piece."""
    piece = _moved(floor, rng)
    for chance, only_of_drawn, alter in _ALTERATIONS:
        if (floor.drawn or not only_of_drawn) and rng.random() < chance:
            alter(piece, rng)
    free, occupied, labels = piece
    labels[free == 0] = 0
    shares = np.stack([_shares(labels == k) for k in range(1, N_TARGETS + 1)], axis=-1)
    walls = occupied > 0
    outside, inside = (_depth(mask) for mask in open_cells(free, walls))
    return network_inputs(free, walls, (outside, inside)), shares


def _shares(mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """(h / 2, w / 2) the share of each block of two by two cells that is in the mask."""
    ones = mask.view(np.uint8)
    count = ones[::2, ::2] + ones[1::2, ::2] + ones[::2, 1::2] + ones[1::2, 1::2]
    return np.asarray(count.astype(np.float32) / 4, np.float32)


def _depth(mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """(h, w) distance of the cells in the mask to the nearest cell outside, in cells."""
    depth = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.asarray(depth, np.float32)


def _moved(floor: LabelledFloor, rng: np.random.Generator) -> Piece:
    """A crop around a random labelled cell, rotated, mirrored, scaled, stretched, and bent."""
    centre = floor.centres[rng.integers(len(floor.centres))][::-1] + rng.uniform(-60, 60, 2)
    angle = rng.uniform(0, 2 * np.pi)
    if rng.random() < 0.4:
        angle = np.pi / 2 * rng.integers(4) + rng.normal() * 0.03
    scale, stretch = np.exp(rng.uniform(np.log(0.8), np.log(1.25))), np.exp(rng.normal() * 0.05)
    mirror = -1.0 if rng.random() < 0.5 else 1.0
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    matrix = turn @ np.diag([mirror * stretch / scale, 1 / (stretch * scale)])
    y, x = np.mgrid[:SIDE, :SIDE].astype(np.float32)
    offset = centre - matrix @ np.array([SIDE / 2, SIDE / 2])
    at_x = (matrix[0, 0] * x + matrix[0, 1] * y + offset[0]).astype(np.float32)
    at_y = (matrix[1, 0] * x + matrix[1, 1] * y + offset[1]).astype(np.float32)
    if rng.random() < 0.3:
        at_x += _drift(rng)
        at_y += _drift(rng)

    def moved(values: Bytes, how: int) -> Bytes:
        return np.asarray(cv2.remap(values, at_x, at_y, how), np.uint8)

    how = cv2.INTER_NEAREST if rng.random() < 0.5 else cv2.INTER_LINEAR
    occupied = np.where(moved(floor.occupied, how) > 90, 255, 0).astype(np.uint8)
    return Piece(moved(floor.free, how), occupied, moved(floor.labels, cv2.INTER_NEAREST))


def _drift(rng: np.random.Generator) -> NDArray[np.float32]:
    """(SIDE, SIDE) a smooth field of some decimetres."""
    knots = rng.normal(size=(SIDE // _KNOT + 1,) * 2) * rng.uniform(0.5, 3.0)
    return np.asarray(
        cv2.resize(knots.astype(np.float32), (SIDE, SIDE), interpolation=cv2.INTER_CUBIC)
    )


def _thicken(piece: Piece, _: np.random.Generator) -> None:
    """Make walls a cell thicker."""
    piece.occupied[:] = cv2.dilate(piece.occupied, np.ones((2, 2), np.uint8))


def _double(piece: Piece, rng: np.random.Generator) -> None:
    """Repeat walls of one half of the crop, as after a pose error."""
    dy, dx = rng.integers(-4, 5, size=2)
    again = np.roll(piece.occupied, (dy, dx), (0, 1))
    y, x = np.mgrid[:SIDE, :SIDE] - SIDE / 2
    angle = rng.uniform(0, 2 * np.pi)
    half = np.cos(angle) * x + np.sin(angle) * y > rng.uniform(-80, 80)
    walls = half & (again > 0)
    piece.occupied[walls] = 255
    piece.free[walls] = 0


def _close_doors(piece: Piece, rng: np.random.Generator) -> None:
    """Close some doorways by a leaf, or make them unknown."""
    n, part = cv2.connectedComponents((piece.labels == DOORWAY).astype(np.uint8))
    closed = np.zeros(n, np.bool_)
    closed[1:] = rng.random(n - 1) < rng.choice([0.1, 0.3])
    piece.block(closed[part], seen=rng.random() < 0.7)


def _furnish(piece: Piece, rng: np.random.Generator) -> None:
    """Put boxes, filled or hollow, into rooms and at times into corridors."""
    for _ in range(rng.integers(5, 60)):
        y, x = rng.integers(SIDE, size=2)
        height, width = rng.integers(2, 14, size=2)
        box = Piece(*(values[y : y + height, x : x + width] for values in piece))
        inside = box.labels == ROOM
        if rng.random() < 0.25:
            inside |= np.isin(box.labels, CIRCULATION)
        rim = np.ones(inside.shape, np.bool_)
        if rng.random() < 0.4:
            rim[1:-1, 1:-1] = False
        box.occupied[inside & rim] = 255
        box.block(inside, seen=False)


def _shine_through_windows(piece: Piece, rng: np.random.Generator) -> None:
    """Add fans of rays that leave the building: free space without a label."""
    unknown = (piece.free == 0) & (piece.occupied == 0)
    inside = np.argwhere(piece.free[::8, ::8] > 128) * 8
    for _ in range(rng.integers(1, 4) if len(inside) else 0):
        y, x = inside[rng.integers(len(inside))]
        direction, rays = rng.uniform(0, 2 * np.pi), np.zeros((SIDE, SIDE), np.uint8)
        for _ in range(rng.integers(3, 25)):
            angle, length = direction + rng.normal() * 0.3, rng.uniform(50, 150)
            end = (int(x + length * np.cos(angle)), int(y + length * np.sin(angle)))
            cv2.line(rays, (int(x), int(y)), end, 255, int(rng.integers(1, 3)))
        piece.free[(rays > 0) & unknown] = 255


def _hide(piece: Piece, rng: np.random.Generator) -> None:
    """Make parts unknown: ellipses, triangles, strips, or all cells beyond some distance."""
    hidden = np.zeros((SIDE, SIDE), np.uint8)
    for _ in range(rng.integers(1, 4)):
        y, x = (int(v) for v in rng.integers(0, SIDE, size=2))
        kind = rng.random()
        if kind < 0.5:
            axes = (int(rng.integers(10, 80)), int(rng.integers(10, 80)))
            cv2.ellipse(hidden, (x, y), axes, float(rng.uniform(0, 180)), 0, 360, 255, -1)
        elif kind < 0.65:
            corners = rng.integers(0, SIDE, size=(3, 2)).astype(np.int32)
            cv2.fillPoly(hidden, [corners], 255)
        else:
            a, b = (tuple(int(v) for v in rng.integers(0, SIDE, size=2)) for _ in range(2))
            cv2.line(hidden, a, b, 255, int(rng.integers(5, 40)))
    if rng.random() < 0.15:
        seen = np.zeros_like(hidden)
        centre = tuple(int(v) for v in rng.integers(100, SIDE - 100, size=2))
        cv2.circle(seen, centre, int(rng.integers(60, 160)), 255, -1)
        hidden |= 255 - seen
    for values in piece:
        values[hidden > 0] = 0


def _speckle(piece: Piece, rng: np.random.Generator) -> None:
    """Make single free cells occupied or unknown."""
    specks = rng.random(piece.free.shape) < rng.choice([0.002, 0.01])
    piece.free[specks] = 0
    piece.occupied[specks] = 255 if rng.random() < 0.5 else 0


_ALTERATIONS = (
    (0.15, False, _thicken),
    (0.1, False, _double),
    (0.3, False, hang_passage_doors),
    (0.5, False, _close_doors),
    (0.5, True, _furnish),
    (0.3, True, put_up_shelves),
    (0.3, True, put_up_desks),
    (0.05, False, leave_one_room),
    (0.35, False, _shine_through_windows),
    (0.4, False, _hide),
    (0.3, False, _speckle),
    (0.15, False, coarsen),
    (0.08, False, grey_walls),
)
"""Alterations in their order: probability, and whether only for floors without furniture."""


def batch(
    floors: Sequence[Sequence[LabelledFloor]],
    source_weights: Sequence[float],
    floor_weights: Sequence[NDArray[np.float64]],
    size: int,
    rng: np.random.Generator,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Inputs (size, 160, 160, 10) and targets (size, 160, 160, 5) of random pieces."""
    inputs: list[NDArray[np.float32]] = []
    targets: list[NDArray[np.float32]] = []
    while len(inputs) < size:
        source = rng.choice(len(floors), p=source_weights)
        weights = floor_weights[source]
        floor = floors[source][rng.choice(len(weights), p=weights)]
        x, y = crop(floor, rng)
        if y.sum() >= 100:
            inputs.append(x)
            targets.append(y)
    return np.stack(inputs), np.stack(targets)
