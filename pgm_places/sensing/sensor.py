"""The simulated range sensor: maximum range, noise, and directions of its beams."""

from dataclasses import dataclass
from functools import cached_property
from math import pi
from typing import Annotated, Any, NamedTuple

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


class Octant(NamedTuple):
    """An octant; they are counted counter-clockwise from the x axis, 45 degrees each."""

    x_is_major: bool  # whether x is the major axis of its directions
    step_x: int  # sign of x
    step_y: int  # sign of y


OCTANTS = [
    Octant(n in (0, 3, 4, 7), -1 if 2 <= n <= 5 else 1, -1 if n >= 4 else 1) for n in range(8)
]


class Ways(NamedTuple):
    """Steps of M beams from cell to cell."""

    step_x: NDArray[np.int64]  # (M,) step along columns: -1, 0 or 1
    step_y: NDArray[np.int64]  # (M,) step along rows: -1, 0 or 1
    # (M,) length of ray per column, in cells; infinite for beams along a column.
    per_x: NDArray[np.float64]
    per_y: NDArray[np.float64]  # (M,) length of ray per row, in cells
    metres_x: NDArray[np.floating[Any]]  # length of ray per column and per row, in metres
    metres_y: NDArray[np.floating[Any]]


@dataclass(frozen=True, eq=False)
class Beams:
    """Unit directions of M beams in the grid's frame (x along columns, y along rows)."""

    octant: NDArray[np.int64]  # (M,) number of each beam's octant, increasing
    # major, minor: (M,) the longer and the shorter component, not negative
    major: NDArray[np.float64]
    minor: NDArray[np.float64]

    @classmethod
    def full_circle(cls, n_beams: int) -> "Beams":
        """Beams at ``2 pi i / n_beams``, their octant and the angle in it found in integers."""
        octant, rest = np.divmod(8 * np.arange(n_beams, dtype=np.int64), n_beams)
        odd = octant % 2 == 1
        on_diagonal = odd & (rest == 0)
        from_axis = np.where(odd, n_beams - rest, rest) / n_beams * (np.pi / 4)
        major, minor = np.cos(from_axis), np.sin(from_axis)
        major[on_diagonal] = minor[on_diagonal] = np.sqrt(0.5)
        # Octants 1 and 5 begin on a diagonal but have y as major axis.
        octant -= on_diagonal & np.isin(octant, (1, 5))
        return cls(octant, major, minor)

    def __len__(self) -> int:
        return len(self.octant)

    @cached_property
    def components(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(M,) sizes of the components along x and y."""
        x_is_major = np.array([octant.x_is_major for octant in OCTANTS])[self.octant]
        along_x = np.where(x_is_major, self.major, self.minor)
        along_y = np.where(x_is_major, self.minor, self.major)
        return along_x, along_y

    def ways(self, resolution_m: float) -> Ways:
        """The steps of the beams in a map with a cell size."""
        along = self.components
        signs = np.array([octant[1:] for octant in OCTANTS])[self.octant].T
        steps = [np.where(part == 0, 0, sign) for part, sign in zip(along, signs, strict=True)]
        with np.errstate(divide="ignore"):
            return Ways(
                *steps, *(1 / part for part in along), *(resolution_m / part for part in along)
            )
