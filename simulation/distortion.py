"""Distorted maps: the drift of a mapper, and a map frame not aligned with the walls.

Only additions, multiplications and divisions, which every platform rounds alike.
"""

from dataclasses import dataclass
from math import pi
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from pgm_places.simulation.portable_random import Dice

T = TypeVar("T", bound=np.generic)


def shifted(
    dice: Dice, cells: NDArray[np.int8], labels: NDArray[np.int16]
) -> tuple[NDArray[np.int8], NDArray[np.int16]]:
    """Both rasters with columns and rows shifted a little, as by a mapper's drift."""
    height, width = cells.shape
    rows, columns = np.indices((height, width), sparse=True)
    rows = np.clip(rows + _parabola(dice, width)[None, :], 0, height - 1)
    columns = np.clip(columns + _parabola(dice, height)[:, None], 0, width - 1)
    return cells[rows, columns], labels[rows, columns]


def _parabola(dice: Dice, length: int) -> NDArray[np.int64]:
    """(length,) a slow wave around zero in integer cells: up to 1 % of the length."""
    most = length // 200
    slope, wave = dice.integer(-most, most), dice.integer(-most, most)
    at = np.arange(length, dtype=np.int64) - length // 2
    return (slope * at // length) + (4 * wave * at * at // (length * length))


@dataclass(frozen=True, eq=False)
class Bend:
    """A bent and rotated raster, as the source of each cell (H, W); -1 for none."""

    rows: NDArray[np.int64]
    columns: NDArray[np.int64]

    def apply(self, raster: NDArray[T], outside: int) -> NDArray[T]:
        """A straight raster, bent; cells beyond its edges are ``outside``."""
        bent = raster[self.rows, self.columns]
        bent[self.rows < 0] = outside
        return bent


def pushed(
    dice: Dice, shape: tuple[int, int], *, knot: int, bend: float, turn_degrees: float
) -> Bend:
    """A raster of a shape (rows, columns), turned about its middle and bent.

    The shift of rows and columns changes its direction every ``knot`` cells, by at most ``bend``
    cells for each cell ahead. ``turn_degrees`` is from -45 to 45, counter-clockwise.
    """
    height, width = shape
    # With t the tangent of half the angle, cos = (1 - t^2) / (1 + t^2) and sin = 2 t / (1 + t^2).
    t = _tangent(turn_degrees * pi / 360)
    cos, sin = (1 - t * t) / (1 + t * t), 2 * t / (1 + t * t)
    rows_out = _whole(height * cos + width * abs(sin)) + 2 * knot
    columns_out = _whole(width * cos + height * abs(sin)) + 2 * knot
    y = np.arange(rows_out)[:, None] - (rows_out - 1) / 2
    x = np.arange(columns_out)[None, :] - (columns_out - 1) / 2
    straight_x = x * cos + y * sin
    straight_y = y * cos - x * sin
    columns = _nearest(straight_x + (width - 1) / 2 + _wander(dice, rows_out, knot, bend)[:, None])
    rows = _nearest(straight_y + (height - 1) / 2 + _wander(dice, columns_out, knot, bend)[None, :])
    outside = (rows < 0) | (rows >= height) | (columns < 0) | (columns >= width)
    rows[outside] = columns[outside] = -1
    return Bend(rows, columns)


def _tangent(angle: float) -> float:
    """The tangent of at most pi / 8 in either direction, to 1e-6, by its series."""
    # math.tan is the platform's, and may differ in its last bit.
    square = angle * angle
    terms = (1 / 3, 2 / 15, 17 / 315, 62 / 2835, 1382 / 155925)
    factor, power = 1.0, square
    for term in terms:
        factor, power = factor + term * power, power * square
    return angle * factor


def _wander(dice: Dice, length: int, knot: int, bend: float) -> NDArray[np.float64]:
    """(length,) a smooth random walk around zero whose slope is at most ``bend``."""
    n_knots = length // knot + 3
    drawn = dice.integers(-1000, 1000, n_knots + 1)
    slopes = (drawn[1:] + drawn[:-1]) / 2000 * bend  # neighbours are alike
    at = np.arange(length)
    index, along = at // knot, (at % knot) / knot
    slope = slopes[index] + (slopes[index + 1] - slopes[index]) * along
    walk = np.add.accumulate(slope)  # one after the other, unlike a sum in pairs
    centred: NDArray[np.float64] = walk - walk[length // 2]
    return centred


def _nearest(positions: NDArray[np.float64]) -> NDArray[np.int64]:
    return np.floor(positions + 0.5).astype(np.int64)


def _whole(length: float) -> int:
    return int(length) + 1
