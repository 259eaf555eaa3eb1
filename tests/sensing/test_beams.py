import numpy as np
import pytest

from pgm_places.sensing.sensor import Beams
from tests.reference.casting import direction


@pytest.mark.parametrize("n_beams", [1, 2, 3, 7, 8, 12, 45, 360, 1001])
def test_components_are_the_unit_vector(n_beams: int) -> None:
    beams = Beams.full_circle(n_beams)
    expected = np.array([direction(beam, n_beams) for beam in range(n_beams)])
    along_x, along_y = beams.components
    step_x, step_y, *_ = beams.ways(0.1)
    np.testing.assert_allclose(along_x * step_x, expected[:, 0], rtol=0, atol=1e-15)
    np.testing.assert_allclose(along_y * step_y, expected[:, 1], rtol=0, atol=1e-15)


@pytest.mark.parametrize("n_beams", [4, 8, 24, 360])
def test_multiples_of_45_degrees_are_exact(n_beams: int) -> None:
    beams = Beams.full_circle(n_beams)
    slope = beams.minor / beams.major
    eighths = 8 * np.arange(n_beams) // n_beams
    exact = 8 * np.arange(n_beams) % n_beams == 0
    np.testing.assert_array_equal(slope[exact], eighths[exact] % 2)
    assert np.all((slope[~exact] > 0) & (slope[~exact] < 1))
