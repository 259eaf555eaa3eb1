"""Names beside the discs that they belong to, where they hide the least."""

from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.report.drawing import text_width

__all__ = ["name_spots"]

_SQUARE = 64.0
"""Side of the squares by which boxes are found, in pixels: about the length of a name."""


def name_spots(
    names: Sequence[str], discs: ArrayLike, others: ArrayLike, *, size: float, radius: float
) -> NDArray[np.float64]:
    """(N, 2) the middles of N names: below their discs, or above or beside them if that is freer.

    Parameters
    ----------
    names : sequence of str
    discs : (N, 2) float
        The middles of the discs that are named, in pixels.
    others : (M, 2) float
        The middles of what else should not be hidden; as large as the discs.
    size : float
        Of the text.
    radius : float
        Of the discs.

    Names are placed one after another, each where it covers the least area of discs, others and
    the names before it.
    """
    points = np.asarray(discs, np.float64).reshape(-1, 2)
    solid = np.concatenate([points, np.asarray(others, np.float64).reshape(-1, 2)])
    taken = _Boxes(np.concatenate([solid - radius, solid + radius], axis=1))
    spots = np.empty_like(points)
    for number, (name, point) in enumerate(zip(names, points, strict=True)):
        half = np.array([text_width(name, size) / 2 + 2, size / 2 + 1])
        down, across = radius + half[1] + 3, radius + half[0] + 1
        ways = np.array([(0, down), (0, -down), (across, 0), (-across, 0)])
        boxes = np.concatenate([point + ways - half, point + ways + half], axis=1)
        best = int(np.argmin(_hidden(boxes, taken.near(boxes))))  # the first of equals
        spots[number] = point + ways[best]
        taken.add(boxes[best])
    return spots


class _Boxes:
    """Boxes (left, top, right, bottom), found by the squares of the picture that they touch."""

    def __init__(self, boxes: NDArray[np.float64]) -> None:
        self._boxes: list[NDArray[np.float64]] = []
        self._in_square: defaultdict[tuple[int, int], list[int]] = defaultdict(list)
        for box in boxes:
            self.add(box)

    def add(self, box: NDArray[np.float64]) -> None:
        for square in _squares(box):
            self._in_square[square].append(len(self._boxes))
        self._boxes.append(box)

    def near(self, boxes: NDArray[np.float64]) -> NDArray[np.float64]:
        """(M, 4) at least those that overlap any of some boxes, in the order they were added."""
        around = np.concatenate([boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)])
        numbers = {number for square in _squares(around) for number in self._in_square[square]}
        return np.array([self._boxes[number] for number in sorted(numbers)]).reshape(-1, 4)


def _squares(box: NDArray[np.float64]) -> Iterator[tuple[int, int]]:
    left, top, right, bottom = np.floor(box / _SQUARE).astype(int).tolist()
    for x in range(left, right + 1):
        for y in range(top, bottom + 1):
            yield x, y


def _hidden(boxes: NDArray[np.float64], taken: NDArray[np.float64]) -> NDArray[np.float64]:
    """(B,) area of each box (left, top, right, bottom) that lies on boxes already taken."""
    low = np.maximum(boxes[:, None, :2], taken[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], taken[None, :, 2:])
    sides = (high - low).clip(0)
    return np.asarray(sides.prod(axis=2).sum(axis=1), np.float64)
