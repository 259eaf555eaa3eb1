import numpy as np

from pgm_places import Sensor, SensorNoise
from pgm_places.errors import InputError
from tests.refusals import refused


def test_angles_start_along_x_and_turn_counter_clockwise() -> None:
    np.testing.assert_allclose(
        Sensor(n_beams=360).angles_rad, np.radians(np.arange(360)), rtol=1e-15
    )


def test_probabilities_of_noise_leave_room_for_each_other() -> None:
    wanted = r"p_random and p_max must sum to at most 1, got 0.75 \+ 0.5 = 1.25"
    refused(InputError, wanted, SensorNoise, p_random=0.75, p_max=0.5)
