"""A labelled plan read as rooms, corridors and doors made of rectangles of cells."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places._core import largest_rectangle
from pgm_places.maps.components import connected_components
from pgm_places.simulation.floor_plan import Door, FloorPlan, Frontage, Rect, sides
from pgm_places.simulation.portable_random import MetreScale

_LEAST_SIDE_CM, _LEAST_SHARE, _MOST_RECTANGLES = 60, 25, 12
"""Most rectangles that cover a place, and their least width; none is smaller than a 25th of the
place."""

_LEAST_FILLING = (3, 4)
"""A doorway that fills a smaller share of its bounding rectangle is oblique, and gets no leaf."""

_WIDEST_LEAF_CM = 130
"""Wider doors have two leaves, which stand open along the walls."""


@dataclass(frozen=True, eq=False)
class ReadPlan:
    """The rooms, passages and doors of a labelled plan, in cells.

    Rectangles cover most of each room, and of each corridor or hall.
    """

    rooms: tuple[list[Rect], ...]
    passages: tuple[list[Rect], ...]
    doors: list[Door]

    def floor_plan(self) -> FloorPlan:
        """The rectangles of all places."""
        return FloorPlan(
            corridors=[part for place in self.passages for part in place],
            rooms=[part for place in self.rooms for part in place],
            doors=self.doors,
        )


def read_plan(
    scale: MetreScale,
    labels: NDArray[np.int16],
    solid: NDArray[np.bool_],
    *,
    passages: Sequence[int],
    doorways: Sequence[int],
) -> ReadPlan:
    """The rooms, passages and doors of a plan with ``labels`` (H, W), -1 for none.

    ``solid`` (H, W) are the cells that are not free. ``passages`` and ``doorways`` are labels; all
    other labels are kinds of rooms.
    """
    is_door = np.isin(labels, doorways)
    is_passage = np.isin(labels, passages)
    is_room = (labels >= 0) & ~is_door & ~is_passage
    return ReadPlan(
        tuple(_places(scale, is_room)),
        tuple(_places(scale, is_passage)),
        _doors(scale, is_door, is_room, solid),
    )


def _places(scale: MetreScale, mask: NDArray[np.bool_]) -> list[list[Rect]]:
    """The rectangles of each connected part of a mask."""
    parts = connected_components(mask, connectivity=4)
    return [
        [rect.moved(window[1].start, window[0].start) for rect in _rectangles(scale, part)]
        for index, window in enumerate(parts.windows())
        for part in [parts.piece[window] == index]
    ]


def _rectangles(scale: MetreScale, part: NDArray[np.bool_]) -> list[Rect]:
    """Rectangles in a part, the largest of what is left each time."""
    found: list[Rect] = []
    left, area = part.copy(), int(part.sum())
    least = scale.cells(_LEAST_SIDE_CM)
    while len(found) < _MOST_RECTANGLES:
        rect = Rect(*largest_rectangle(left))
        columns, rows = rect.size
        if columns * rows * _LEAST_SHARE < area or min(columns, rows) < least:
            break
        left[rect.slices] = False
        found.append(rect)
    return found


def _doors(
    scale: MetreScale,
    is_door: NDArray[np.bool_],
    is_room: NDArray[np.bool_],
    solid: NDArray[np.bool_],
) -> list[Door]:
    """The gap of each doorway, and on which side of it the room lies."""
    parts = connected_components(is_door, connectivity=4)
    found: list[Door] = []
    for index, window in enumerate(parts.windows()):
        rows, columns = window
        box = Rect(columns.start, rows.start, columns.stop, rows.stop)
        filled = int(parts.size[index])
        straight = filled * _LEAST_FILLING[1] >= box.size[0] * box.size[1] * _LEAST_FILLING[0]
        up, down, right, left = sides(box)
        ways = [(right, left), (up, down)]
        through = max(ways, key=lambda way: sum(_beyond(~solid, side) for side in way))
        inner = max(through, key=lambda side: _beyond(is_room, side))
        gap = _gap(solid, box, along_x=inner.along == "y")
        narrow = gap is not None and max(gap.size) <= scale.cells(_WIDEST_LEAF_CM)
        leads_in = _beyond(is_room, inner) > 0
        found.append(Door(gap or box, inner.inward, has_leaf=straight and narrow and leads_in))
    return found


def _beyond(mask: NDArray[np.bool_], side: Frontage) -> int:
    """How many cells of a mask lie right beyond a side."""
    return int(mask[side.rect(0, side.length, 0, 1).within(mask.shape).slices].sum())


def _gap(solid: NDArray[np.bool_], box: Rect, *, along_x: bool) -> Rect | None:
    """The part of a doorway between the two ends of its wall."""
    around = np.pad(solid, 1, constant_values=True)[box.y0 : box.y1 + 2, box.x0 : box.x1 + 2]
    across = around[:, 1:-1] if along_x else around[1:-1].T
    walled = np.flatnonzero(across[0] & across[-1])
    if not len(walled):
        return None
    first, last = int(walled[0]), int(walled[-1]) + 1
    if along_x:
        return Rect(box.x0 + first, box.y0, box.x0 + last, box.y1)
    return Rect(box.x0, box.y0 + first, box.x1, box.y0 + last)
