"""A survey as one would do it by hand: rays in fractions, searches over neighbours, no kernels."""

from collections import deque
from collections.abc import Iterator
from fractions import Fraction
from itertools import product

import numpy as np
from numpy.typing import NDArray


def largest_area(mask: NDArray[np.bool_]) -> int:
    """Cells of the largest rectangle in a mask, by trying all of them."""
    height, width = mask.shape
    areas = [
        (y1 - y0) * (x1 - x0)
        for y0, x0 in product(range(height), range(width))
        for y1, x1 in product(range(y0 + 1, height + 1), range(x0 + 1, width + 1))
        if mask[y0:y1, x0:x1].all()
    ]
    return max(areas, default=0)


def steps(drivable: NDArray[np.bool_], start: tuple[int, int]) -> NDArray[np.int64]:
    """(H, W) least number of steps to the four sides, -1 where there is no way."""
    found = np.full(drivable.shape, -1)
    found[start] = 0
    waiting = deque([start])
    while waiting:
        row, column = waiting.popleft()
        for y, x in ((row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)):
            inside = 0 <= y < drivable.shape[0] and 0 <= x < drivable.shape[1]
            if inside and drivable[y, x] and found[y, x] < 0:
                found[y, x] = found[row, column] + 1
                waiting.append((y, x))
    return found


def ray(start: tuple[int, int], direction: tuple[int, int]) -> Iterator[tuple[int, int]]:
    """Columns and rows along a ray, one cell further in its longer direction each time."""
    longer = max(abs(direction[0]), abs(direction[1]))
    x, y = start
    step = 0
    while True:
        step += 1
        ahead = [_rounded(Fraction(step * part, longer)) for part in direction]
        yield x + ahead[0], y + ahead[1]


def _rounded(value: Fraction) -> int:
    """The nearest whole number, the larger one of two."""
    return (2 * value.numerator + value.denominator) // (2 * value.denominator)


def survey_counts(
    solid: NDArray[np.bool_],
    glass: NDArray[np.bool_],
    stations: NDArray[np.int64],
    offsets: NDArray[np.int64],
    through: NDArray[np.int64],
    late: NDArray[np.int64],
    fan: NDArray[np.int64],
    n_steps: int,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(H, W) how often rays passed and ended in each cell; the rim swallows them."""
    height, width = solid.shape
    passed, ended = np.zeros(solid.shape, np.int64), np.zeros(solid.shape, np.int64)
    for number, (s, d) in enumerate(product(range(len(stations)), range(len(fan)))):
        direction = (int(fan[d, 0]), int(fan[d, 1]))
        true = (int(stations[s, 0]), int(stations[s, 1]))
        noted = (true[0] + int(offsets[s, 0]), true[1] + int(offsets[s, 1]))
        left, behind = int(through[number]), False
        places = zip(ray(true, direction), ray(noted, direction), range(1, n_steps), strict=False)
        for (x, y), (noted_x, noted_y), step in places:
            if x in (0, width - 1) or y in (0, height - 1):
                break
            if glass[y, x] and left > 0:
                behind = True
            if behind:
                left -= 1
            if solid[y, x] and not (behind and left > 0):
                far = step + int(late[number])
                end_x, end_y = (
                    base + _rounded(Fraction(far * part, max(map(abs, direction))))
                    for base, part in zip(noted, direction, strict=True)
                )
                ended[np.clip(end_y, 0, height - 1), np.clip(end_x, 0, width - 1)] += 1
                break
            if 0 <= noted_x < width and 0 <= noted_y < height:
                passed[noted_y, noted_x] += 1
    return passed, ended
