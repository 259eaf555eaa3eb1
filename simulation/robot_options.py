"""Options of a simulated robot: its laser and its motion."""

from dataclasses import dataclass
from math import radians
from typing import TYPE_CHECKING, Annotated

from pgm_places.options import AtLeastZero, Options, Positive, Seed
from pgm_places.options.marks import Ge, Gt, Le

if TYPE_CHECKING:  # the flags that these options become do without NumPy
    from pgm_places.sensing.sensor import SensorNoise
    from pgm_places.trajectories.scan import ScanGeometry


@dataclass(frozen=True, kw_only=True)
class RobotMotion(Options):
    """Motion of a round robot.

    Parameters
    ----------
    speed_m_s : float
        Driving speed (m/s).
    turn_rad_s : float
        Turning speed (rad/s).
    scan_every_s : float
        Time between scans (s).
    radius_m : float
        The robot's radius (m): how far it keeps from walls and unknown space.

    Raises
    ------
    ConfigError
        A number is not positive.

    Examples
    --------
    >>> RobotMotion(speed_m_s=0.8).radius_m
    0.25
    """

    speed_m_s: Positive = 0.4
    turn_rad_s: Positive = 1.0
    scan_every_s: Positive = 0.2
    radius_m: Positive = 0.25


@dataclass(frozen=True, kw_only=True)
class LaserOptions(Options):
    """Options of a simulated laser with a forward field of view.

    Parameters
    ----------
    n_beams : int
        Number of laser beams.
    view_degrees : float
        Field of view of the laser (degrees).
    range_m : float
        Maximum range of the laser (m).
    noise_m : float
        Standard deviation of the range noise (m).
    seed : int
        Seed of the range noise.

    Raises
    ------
    ConfigError
        A number is out of range.

    Examples
    --------
    >>> LaserOptions(view_degrees=360.0).geometry().is_full_circle
    True
    """

    n_beams: Annotated[int, Ge(1), Le(100_000)] = 180
    view_degrees: Annotated[float, Gt(0), Le(360)] = 180.0
    range_m: Positive = 30.0
    noise_m: AtLeastZero = 0.02
    seed: Seed = 0

    def geometry(self) -> "ScanGeometry":
        """The geometry of its beams."""
        from pgm_places.trajectories.scan import ScanGeometry

        view_rad = radians(self.view_degrees)
        return ScanGeometry.ahead(self.n_beams, view_rad, range_max_m=self.range_m)

    def noise(self) -> "SensorNoise | None":
        """Its range noise; None for exact ranges."""
        from pgm_places.sensing.sensor import SensorNoise

        return SensorNoise(self.noise_m, seed=self.seed) if self.noise_m else None
