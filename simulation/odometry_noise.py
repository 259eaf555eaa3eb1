"""Odometry noise of a simulated robot."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array
from pgm_places.options import AtLeastZero, Options, Seed


@dataclass(frozen=True)
class OdometryNoise(Options):
    """The odometry motion model: each step is a turn, a straight distance, and a turn.

    For a true step of a turn ``r1``, a distance ``d`` and a turn ``r2``, the measured values have
    gaussian errors with variances ``a1 r² + a2 d²`` for each turn and ``a3 d² + a4 (r1² + r2²)``
    for the distance (Thrun, Burgard and Fox, "Probabilistic Robotics", 2005, section 5.4, table
    5.6). The error of the pose grows without bound, as with real wheels.

    Parameters
    ----------
    turn_by_turn, turn_by_way, way_by_way, way_by_turn : float
        The square roots of a1, a2, a3 and a4: radians per radian, radians per metre, metres per
        metre, metres per radian.
    seed : int
        From 0 on.

    Raises
    ------
    ConfigError
        A number is negative or not finite.

    Examples
    --------
    >>> still = OdometryNoise(0, 0, 0, 0)
    >>> still.odometry([[0, 1, 0.1], [1, 2, 0.2], [1, 3, 2.0]]).round(9).tolist()
    [[0.0, 1.0, 0.1], [1.0, 2.0, 0.2], [1.0, 3.0, 2.0]]
    """

    turn_by_turn: AtLeastZero = 0.03
    turn_by_way: AtLeastZero = 0.01
    way_by_way: AtLeastZero = 0.02
    way_by_turn: AtLeastZero = 0.01
    seed: Seed = 0

    def scaled(self, times: float) -> "OdometryNoise":
        """The noise with all standard deviations multiplied by ``times``."""
        return OdometryNoise(
            times * self.turn_by_turn,
            times * self.turn_by_way,
            times * self.way_by_way,
            times * self.way_by_turn,
            self.seed,
        )

    def odometry(self, poses: ArrayLike) -> NDArray[np.float64]:
        """(T, 3) odometry along true poses (T, 3), starting at the first pose."""
        true = finite_array("poses", poses, ("T", 3))
        if len(true) < 2:
            return true.copy()
        step = np.diff(true[:, :2], axis=0)
        way = np.hypot(step[:, 0], step[:, 1])
        turned = _half_turn(np.diff(true[:, 2]))
        ahead = np.arctan2(step[:, 1], step[:, 0])
        first = np.where(way > 0, _half_turn(ahead - true[:-1, 2]), 0.0)
        # A step backwards is no half turn, and robots do not turn round for a few millimetres.
        backwards = np.abs(first) > np.pi / 2
        first = np.where(backwards, _half_turn(first + np.pi), first)
        way = np.where(backwards, -way, way)
        last = _half_turn(turned - first)
        rng = np.random.default_rng(self.seed)
        errors = rng.standard_normal((3, len(way)))
        first_off = errors[0] * np.hypot(self.turn_by_turn * first, self.turn_by_way * way)
        last_off = errors[2] * np.hypot(self.turn_by_turn * last, self.turn_by_way * way)
        turns = np.hypot(first, last)
        way_off = errors[1] * np.hypot(self.way_by_way * way, self.way_by_turn * turns)
        heading = true[0, 2] + np.concatenate(
            [[0.0], np.cumsum(first + first_off + last + last_off)]
        )
        towards = heading[:-1] + first + first_off
        measured = way + way_off
        x = true[0, 0] + np.concatenate([[0.0], np.cumsum(measured * np.cos(towards))])
        y = true[0, 1] + np.concatenate([[0.0], np.cumsum(measured * np.sin(towards))])
        return np.column_stack([x, y, _half_turn(heading)])


def _half_turn(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    turned: NDArray[np.float64] = np.mod(angles + np.pi, 2 * np.pi) - np.pi
    return turned
