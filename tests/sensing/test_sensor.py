import numpy as np
import pytest

from pgm_places.errors import InputError
from pgm_places.sensing.sensor import Sensor, SensorNoise


def test_defaults_are_a_full_turn_of_360_beams_up_to_30_m() -> None:
    sensor = Sensor()
    assert (sensor.n_beams, sensor.max_range_m, sensor.stop_at_unknown) == (360, 30.0, True)
    assert sensor.noise is None
    assert SensorNoise().is_silent


def test_angles_start_along_x_and_turn_counter_clockwise() -> None:
    np.testing.assert_allclose(
        Sensor(n_beams=360).angles_rad, np.radians(np.arange(360)), rtol=1e-15
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"n_beams": 2}, "n_beams must be a whole number from 3 to 3600, got 2"),
        ({"noise": 0.1}, "noise must be a table of options (SensorNoise) or None, got 0.1"),
    ],
)
def test_sensor_says_what_is_wrong(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(InputError) as caught:
        Sensor(**arguments)  # type: ignore[arg-type]
    assert str(caught.value) == message


def test_probabilities_of_noise_leave_room_for_each_other() -> None:
    wanted = r"p_random and p_max must sum to at most 1, got 0.75 \+ 0.5 = 1.25"
    with pytest.raises(InputError, match=wanted):
        SensorNoise(p_random=0.75, p_max=0.5)
