"""The simulated range sensor: its beams, its maximum range and its noise."""

from dataclasses import dataclass
from math import pi
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from pgm_places._arguments import public_options
from pgm_places.errors import InputError
from pgm_places.options import AtLeastZero, Options, Positive, Probability, Seed, check_options
from pgm_places.options.marks import Ge, Le


@public_options
@dataclass(frozen=True)
class SensorNoise:
    """The noise of a range sensor (paper section 7).

    Each reading is independently a maximum reading with probability ``p_max``, else a random one
    with probability ``p_random``, else the true range plus gaussian noise; the result is clipped
    to [0, maximum range]. Beams without an obstacle within reach get no gaussian noise.

    Parameters
    ----------
    sigma_m : float
        Standard deviation of the gaussian part in metres.
    p_random : float
        Probability of a reading that is uniform in [0, maximum range].
    p_max : float
        Probability of a reading at the maximum range. ``p_random + p_max`` is at most 1.
    seed : int
        From 0 to 2**64 - 1. A reading's noise depends only on the seed, its cell and its beam, not
        on other cells.

    Examples
    --------
    >>> SensorNoise(sigma_m=0.02, p_random=0.01, p_max=0.01, seed=7).sigma_m
    0.02
    """

    sigma_m: AtLeastZero = 0.0
    p_random: Probability = 0.0
    p_max: Probability = 0.0
    seed: Seed = 0

    def __post_init__(self) -> None:
        check_options(self)
        if self.p_random + self.p_max > 1:
            raise InputError(
                "p_random and p_max must sum to at most 1, "
                f"got {self.p_random:g} + {self.p_max:g} = {self.p_random + self.p_max:g}"
            )

    @property
    def is_silent(self) -> bool:
        """Whether all readings are exact."""
        return self.sigma_m == 0 and self.p_random == 0 and self.p_max == 0


@public_options
@dataclass(frozen=True)
class Sensor(Options):
    """A laser range finder with a full-circle field of view.

    Parameters
    ----------
    n_beams : int
        Beams, evenly spaced over the full circle.
    max_range_m : float
        Longest range; beams without an obstacle within it read this value.
    stop_at_unknown : bool
        Whether a beam ends where it enters unknown space, as at an obstacle. Space outside the map
        always ends it.
    noise : SensorNoise or None
        None for exact ranges.

    Examples
    --------
    >>> sensor = Sensor(n_beams=4, max_range_m=10.0)
    >>> sensor.angles_rad.round(4).tolist()
    [0.0, 1.5708, 3.1416, 4.7124]
    """

    n_beams: Annotated[int, Ge(3), Le(3600)] = 360
    max_range_m: Positive = 30.0
    stop_at_unknown: bool = True
    noise: SensorNoise | None = None

    @property
    def angles_rad(self) -> NDArray[np.float64]:
        """(n_beams,) direction of each beam, counter-clockwise from the grid's x axis.

        Beam ``i`` points along ``2 pi i / n_beams``: along a row of cells for ``i = 0``.
        """
        return np.arange(self.n_beams, dtype=np.float64) * (2 * pi / self.n_beams)
