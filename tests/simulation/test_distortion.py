import math

import numpy as np
import pytest
from scipy import ndimage

from pgm_places.simulation.distortion import _tangent, pushed
from pgm_places.simulation.portable_random import Dice


def test_neither_bent_nor_turned_is_the_raster_with_a_margin() -> None:
    raster = np.arange(12 * 17).reshape(12, 17)
    same = pushed(Dice(0, 0), raster.shape, knot=5, bend=0.0, turn_degrees=0.0).apply(raster, -7)
    rows, columns = np.nonzero(same >= 0)
    inside = same[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
    np.testing.assert_array_equal(inside, raster)
    assert (same == -7).any()


@pytest.mark.parametrize("degrees", [-45.0, -12.3, 0.0, 1.0, 45.0])
def test_a_bar_is_turned_by_so_many_degrees(degrees: float) -> None:
    bar = np.zeros((41, 201), np.int8)
    bar[20] = 1
    turned = pushed(Dice(0, 0), bar.shape, knot=10, bend=0.0, turn_degrees=degrees).apply(bar, 0)
    rows, columns = np.nonzero(turned)
    slope = np.polyfit(columns, rows, 1)[0]
    assert math.degrees(math.atan(slope)) == pytest.approx(degrees, abs=0.3)
    assert ndimage.label(turned, np.ones((3, 3)))[1] == 1  # no ray gets through
    assert np.hypot(np.ptp(rows), np.ptp(columns)) == pytest.approx(200, abs=2)


@pytest.mark.parametrize("bend", [0.01, 0.05])
def test_a_bent_bar_is_nowhere_steeper_than_allowed(bend: float) -> None:
    bar = np.zeros((61, 800), np.int8)
    bar[30] = 1
    bent = pushed(Dice(3, 0), bar.shape, knot=40, bend=bend, turn_degrees=0.0).apply(bar, 0)
    columns = np.flatnonzero(bent.any(axis=0))
    middle = np.array([np.flatnonzero(bent[:, column]).mean() for column in columns])
    assert np.ptp(middle) > 40 * bend
    assert np.abs(middle[100:] - middle[:-100]).max() <= 100 * bend + 1.5


@pytest.mark.parametrize("angle", np.linspace(-math.pi / 8, math.pi / 8, 7))
def test_the_tangent_is_one(angle: float) -> None:
    assert _tangent(angle) == pytest.approx(math.tan(angle), abs=1e-6)
