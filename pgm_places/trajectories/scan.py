"""A laser scan: the directions of its beams, their maximum range, and their readings."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import isfinite, pi
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._arguments import public
from pgm_places._checks import (
    finite_array,
    number_array,
    pose_array,
    require_at_least,
    set_frozen,
)
from pgm_places.errors import InputError

_ANGLE_TOLERANCE_RAD = 2e-4  # a hundredth of a degree
_GAP_OF_A_FULL_CIRCLE = 1.5  # in beam spacings; a wider gap is a blind sector


@public
@dataclass(frozen=True, eq=False)
class ScanGeometry:
    """The beams of a laser range finder and the distances that it can measure.

    Parameters
    ----------
    angles_rad : (M,) float
        Direction of each beam against the sensor's heading, counter-clockwise, at least one beam.
    range_max_m : float
        Maximum range. A beam without a return reads exactly ``range_max_m``; "no return" has no
        other encoding in this package.
    range_min_m : float
        Shortest distance; anything below it is no measurement.

    Raises
    ------
    InputError
        There is no beam, an angle is not finite, or the limits are not
        ``0 <= range_min_m < range_max_m``.

    Examples
    --------
    >>> geometry = ScanGeometry.half_circle(180, range_max_m=80.0)
    >>> geometry
    ScanGeometry(180 beams over 179 degrees, 0 to 80 m)
    >>> geometry.is_full_circle, ScanGeometry.full_circle(360).is_full_circle
    (False, True)
    """

    angles_rad: NDArray[np.float64]
    range_max_m: float
    range_min_m: float = 0.0

    def __post_init__(self) -> None:
        angles = finite_array("angles_rad", self.angles_rad, ("M",))
        if len(angles) == 0:
            raise InputError("angles_rad must hold at least one beam, got none")
        low, high = float(self.range_min_m), float(self.range_max_m)
        if not (isfinite(high) and 0 <= low < high):
            raise InputError(
                "range limits must be finite metres with 0 <= range_min_m < range_max_m, got "
                f"range_min_m {low:g} and range_max_m {high:g}"
            )
        set_frozen(self, angles_rad=angles, range_min_m=low, range_max_m=high)

    def __repr__(self) -> str:
        return (
            f"ScanGeometry({self.n_beams} beams over {np.rad2deg(self.field_of_view_rad):.4g} "
            f"degrees, {self.range_min_m:g} to {self.range_max_m:g} m)"
        )

    @classmethod
    def full_circle(
        cls, n_beams: int = 360, *, range_max_m: float = 30.0, range_min_m: float = 0.0
    ) -> Self:
        """Beams at ``2 pi i / n_beams``, as the laser features require."""
        return cls(
            np.arange(n_beams, dtype=np.float64) * (2 * pi / n_beams), range_max_m, range_min_m
        )

    @classmethod
    def half_circle(
        cls, n_beams: int = 180, *, range_max_m: float = 30.0, range_min_m: float = 0.0
    ) -> Self:
        """Beams from the right (-90 degrees) to the left of a forward-looking scanner.

        An even number of beams is spaced by ``pi / n_beams`` and leaves out the last direction
        (180 beams: -90, -89, ..., 89 degrees), an odd number reaches it (181 beams: -90 to 90).
        This is the convention of all readers of logs.
        """
        spacing = pi / (n_beams - 1 if n_beams % 2 and n_beams > 1 else n_beams)
        return cls(
            np.arange(n_beams, dtype=np.float64) * spacing - pi / 2, range_max_m, range_min_m
        )

    @classmethod
    def ahead(cls, n_beams: int, view_rad: float, *, range_max_m: float = 30.0) -> Self:
        """Beams around the direction ahead that share a field of view of up to a full circle.

        A half circle and a full circle have the beams of :meth:`half_circle` and
        :meth:`full_circle`; other views reach from edge to edge.
        """
        require_at_least("n_beams", n_beams, 1)
        if np.isclose(view_rad, 2 * pi):
            return cls.full_circle(n_beams, range_max_m=range_max_m)
        if np.isclose(view_rad, pi):
            return cls.half_circle(n_beams, range_max_m=range_max_m)
        return cls(np.linspace(-view_rad / 2, view_rad / 2, n_beams), range_max_m)

    @property
    def n_beams(self) -> int:
        """M, the number of beams."""
        return len(self.angles_rad)

    @cached_property
    def _gaps(self) -> NDArray[np.float64]:
        """(M,) angle from each beam to the next one around the circle, sorted by direction."""
        around = np.sort(np.mod(self.angles_rad, 2 * pi))
        return np.diff(around, append=around[0] + 2 * pi)

    @cached_property
    def spacing_rad(self) -> float | None:
        """Angle from each beam to the next one where all are the same, else None; 0 for one beam.

        Negative where the beams come in clockwise order.
        """
        if self.n_beams == 1:
            return 0.0
        spacing = float(self.angles_rad[-1] - self.angles_rad[0]) / (self.n_beams - 1)
        even = self.angles_rad[0] + spacing * np.arange(self.n_beams)
        is_even = np.allclose(self.angles_rad, even, rtol=0.0, atol=_ANGLE_TOLERANCE_RAD)
        return spacing if is_even else None

    @property
    def field_of_view_rad(self) -> float:
        """The angle spanned by the beams: the full circle less the widest gap between two beams."""
        return 2 * pi - float(self._gaps.max())

    @property
    def is_full_circle(self) -> bool:
        """Whether the beams go all around: no gap is much wider than their usual spacing."""
        if self.n_beams < 3:
            return False
        return bool(self._gaps.max() <= _GAP_OF_A_FULL_CIRCLE * np.median(self._gaps))

    def same_as(self, other: ScanGeometry) -> bool:
        """Whether both have the same beams, to a hundredth of a degree, and the same limits."""
        return (
            self.n_beams == other.n_beams
            and (self.range_min_m, self.range_max_m) == (other.range_min_m, other.range_max_m)
            and bool(
                np.allclose(self.angles_rad, other.angles_rad, rtol=0.0, atol=_ANGLE_TOLERANCE_RAD)
            )
        )

    def cleaned(self, readings_m: ArrayLike) -> NDArray[np.float32]:
        """Raw readings (..., M) as ranges: a reading that is no distance becomes ``range_max_m``.

        These readings are NaN, both infinities, and values below ``range_min_m`` or beyond
        ``range_max_m``, including the codes of sensors for "no return".

        Raises
        ------
        InputError
            The last axis does not have one reading per beam.

        Examples
        --------
        >>> geometry = ScanGeometry([-0.1, 0.0, 0.1], range_max_m=8.0, range_min_m=0.1)
        >>> geometry.cleaned([float("nan"), 0.02, 3.5]).tolist()
        [8.0, 8.0, 3.5]
        """
        with np.errstate(over="ignore"):  # beyond single precision is beyond every sensor
            readings = number_array("readings_m", readings_m, np.float32)
        if readings.shape[-1:] != (self.n_beams,):
            raise InputError(
                f"readings must have {self.n_beams} beams on their last axis, got shape "
                f"{readings.shape}"
            )
        reach = np.float32(self.range_max_m)
        # Comparisons with NaN are false, so this test, and not its opposite, excludes NaN.
        is_distance = (readings >= np.float32(self.range_min_m)) & (readings <= reach)
        return np.where(is_distance, readings, reach)

    def returned(self, ranges_m: ArrayLike) -> NDArray[np.bool_]:
        """Mask of the ranges (..., M) that are returns."""
        ranges = number_array("ranges_m", ranges_m, None)
        return np.asarray(ranges < np.float32(self.range_max_m))


@public
@dataclass(frozen=True, eq=False)
class Scan:
    """One scan with its time and pose: the input of an online labeler at each step.

    Parameters
    ----------
    time_s : float
        Time of the scan.
    pose : (3,) float
        x, y in metres and heading in radians of the sensor.
    ranges_m : (M,) float32
        Distance along each beam; ``geometry.range_max_m`` without a return.
    geometry : ScanGeometry
        Its beams.
    odometry : (3,) float or None
        The pose by wheel odometry, if ``pose`` is a better one.
    """

    time_s: float
    pose: NDArray[np.float64]
    ranges_m: NDArray[np.float32]
    geometry: ScanGeometry
    odometry: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        set_frozen(self, time_s=float(self.time_s), pose=pose_array("pose", self.pose, (3,)))
        ranges = finite_array("ranges_m", self.ranges_m, (self.geometry.n_beams,), dtype=np.float32)
        set_frozen(self, ranges_m=ranges)
        if self.odometry is not None:
            set_frozen(self, odometry=pose_array("odometry", self.odometry, (3,)))
