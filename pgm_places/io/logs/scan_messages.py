"""Scans of ROS messages: their beams checked once, readings as the whole package writes them."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError, LogError
from pgm_places.trajectories.scan import Scan, ScanGeometry

__all__ = ["ScanMessages"]


class ScanMessages:
    """Makes scans of ``sensor_msgs/LaserScan``; scans with the same beams share one geometry.

    Parameters
    ----------
    source : str
        Where the messages come from, for the error about a bad one.
    range_max_m : float, optional
        Readings of at least this mean no return; what the messages say by default.
    """

    def __init__(self, source: str, range_max_m: float | None = None) -> None:
        self._source, self._range_max_m = source, range_max_m
        self._known: dict[tuple[float, ...], ScanGeometry] = {}

    def scan(
        self, message: Any, time_s: float, pose: NDArray[np.float64], *, mirrored: bool = False
    ) -> Scan:
        """The scan of a message, taken at a pose (3,) of the laser.

        Parameters
        ----------
        message : LaserScan
        time_s : float
        pose : (3,) float
        mirrored : bool
            The laser is mounted upside down: its beams point to the other side.

        Raises
        ------
        LogError
            The message has no beams or no limits of a range.
        """
        geometry = self._geometry(message, mirrored)
        ranges = geometry.cleaned(message.ranges)
        return Scan(time_s, pose, ranges[::-1] if mirrored else ranges, geometry)

    def _geometry(self, message: Any, mirrored: bool) -> ScanGeometry:
        n_beams = len(message.ranges)
        low, high = _shortest(message.range_min), _shortest(message.range_max)
        reach = high if self._range_max_m is None else self._range_max_m
        start, spacing = float(message.angle_min), float(message.angle_increment)
        # Drivers compute the angles for each message; a thousandth of a radian is the same beam.
        key = (n_beams, round(start, 3), round(spacing * n_beams, 3), low, reach, mirrored)
        if key not in self._known:
            angles = start + spacing * np.arange(n_beams, dtype=np.float64)
            try:
                geometry = ScanGeometry(angles, reach, low)
            except InputError as error:
                raise LogError(
                    f"{self._source}: a scan of {n_beams} beams says range_min {low:g} and "
                    f"range_max {high:g}: {error}; give the correct one as range_max_m"
                ) from None
            if mirrored:
                geometry = replace(geometry, angles_rad=-geometry.angles_rad[::-1])
            self._known[key] = geometry
        return self._known[key]


def _shortest(value: float) -> float:
    """The shortest decimal of a single-precision number: 81.83, not 81.83000183105469."""
    return float(str(np.float32(value)))
