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
        ({"n_beams": 0}, "n_beams must be a whole number from 1 to 1000000, got 0"),
        ({"n_beams": 2.5}, "n_beams must be a whole number from 1 to 1000000, got 2.5"),
        ({"n_beams": True}, "n_beams must be a whole number from 1 to 1000000, got True"),
        ({"max_range_m": 0}, "max_range_m must be more than 0 metres, got 0"),
        ({"max_range_m": -1.0}, "max_range_m must be more than 0 metres, got -1"),
        ({"max_range_m": float("inf")}, "max_range_m must be a finite number, got inf"),
        ({"max_range_m": "far"}, "max_range_m must be a finite number, got 'far'"),
        ({"stop_at_unknown": "yes"}, "stop_at_unknown must be true or false, got 'yes'"),
        ({"noise": 0.1}, "noise must be a SensorNoise or None, got 0.1"),
    ],
)
def test_sensor_says_what_is_wrong(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(InputError) as caught:
        Sensor(**arguments)  # type: ignore[arg-type]
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"sigma_m": -0.1}, "sigma_m must be at least 0 metres, got -0.1"),
        ({"sigma_m": float("nan")}, "sigma_m must be a finite number, got nan"),
        ({"p_random": 1.5}, "p_random must be a probability from 0 to 1, got 1.5"),
        ({"p_max": -0.5}, "p_max must be a probability from 0 to 1, got -0.5"),
        (
            {"p_random": 0.75, "p_max": 0.5},
            "p_random and p_max must sum to at most 1, got 0.75 + 0.5 = 1.25",
        ),
        ({"seed": -1}, "seed must be a whole number from 0 to 18446744073709551615, got -1"),
    ],
)
def test_noise_says_what_is_wrong(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(InputError) as caught:
        SensorNoise(**arguments)  # type: ignore[arg-type]
    assert str(caught.value) == message
