"""Options of a simulated robot's motion."""

from dataclasses import dataclass

from pgm_places.options import Options, Positive


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
        Radius of the robot (m). It keeps this far from walls and unknown space.

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
