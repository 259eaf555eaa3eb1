"""A similarity transform of the plane, from one coordinate frame to another."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._arguments import public
from pgm_places._checks import finite_array
from pgm_places.errors import InputError


@public
@dataclass(frozen=True)
class Similarity:
    """Turn, scale and shift: ``q = scale * R(rotation_rad) p + translation_m``.

    It puts a robot's log, which begins wherever the robot was switched on, into the frame of a map.

    Parameters
    ----------
    rotation_rad : float
        Counter-clockwise.
    translation_m : (float, float)
        The image of the origin.
    scale : float
        1 for two frames in true metres; a map whose resolution was judged by eye may need 0.99.

    Raises
    ------
    InputError
        A number is not finite, or the scale is not positive.

    Examples
    --------
    >>> turn = Similarity(rotation_rad=np.pi / 2, translation_m=(1.0, 0.0))
    >>> turn.of_positions([[2.0, 0.0]]).round(6).tolist()
    [[1.0, 2.0]]
    """

    rotation_rad: float = 0.0
    translation_m: tuple[float, float] = (0.0, 0.0)
    scale: float = 1.0

    def __post_init__(self) -> None:
        numbers = (self.rotation_rad, *self.translation_m, self.scale)
        if len(numbers) != 4 or not all(map(isfinite, numbers)) or self.scale <= 0:
            raise InputError(
                "a similarity needs a finite rotation, two finite shifts and a positive scale, got "
                f"rotation_rad={self.rotation_rad}, translation_m={self.translation_m}, "
                f"scale={self.scale}"
            )

    @classmethod
    def from_points(cls, positions_m: ArrayLike, seen_at_m: ArrayLike) -> Self:
        """The similarity that best maps points (N, 2) to their positions (N, 2) in another frame.

        Least squares over at least two different points (Umeyama, "Least-squares estimation of
        transformation parameters between two point patterns", 1991, equations 40 to 42).

        Raises
        ------
        InputError
            The shapes differ, or the points do not determine a similarity.

        Examples
        --------
        >>> Similarity.from_points([[0, 0], [1, 0]], [[5, 5], [5, 7]]).scale
        2.0
        """
        source = finite_array("positions_m", positions_m, ("N", 2))
        target = finite_array("seen_at_m", seen_at_m, (len(source), 2))
        if len(source) < 2:
            raise InputError(f"a similarity needs at least two points, got {len(source)}")
        # In the plane a rotation is a complex factor, and the best one is a quotient of sums.
        p = source @ np.array([1, 1j])
        q = target @ np.array([1, 1j])
        p_mean, q_mean = p.mean(), q.mean()
        spread = np.sum(np.abs(p - p_mean) ** 2)
        factor = np.sum(np.conj(p - p_mean) * (q - q_mean)) / spread if spread else 0
        if factor == 0:
            raise InputError("the points do not determine a similarity: all coincide")
        shift = q_mean - factor * p_mean
        return cls(
            float(np.angle(factor)), (float(shift.real), float(shift.imag)), float(abs(factor))
        )

    @property
    def _matrix(self) -> NDArray[np.float64]:
        cos, sin = np.cos(self.rotation_rad), np.sin(self.rotation_rad)
        return self.scale * np.array([[cos, -sin], [sin, cos]])

    def of_positions(self, positions_m: ArrayLike) -> NDArray[np.float64]:
        """Positions (N, 2) in the other frame."""
        positions = finite_array("positions_m", positions_m, ("N", 2))
        return positions @ self._matrix.T + np.asarray(self.translation_m)

    def of_poses(self, poses: ArrayLike) -> NDArray[np.float64]:
        """Poses (N, 3) in the other frame, their headings from -pi to pi."""
        array = finite_array("poses", poses, ("N", 3))
        headings = np.mod(array[:, 2] + self.rotation_rad + np.pi, 2 * np.pi) - np.pi
        return np.column_stack([self.of_positions(array[:, :2]), headings])

    def inverse(self) -> Self:
        """The inverse transform."""
        back = type(self)(-self.rotation_rad, scale=1 / self.scale)
        shift = -back.of_positions([self.translation_m])[0]
        return type(self)(back.rotation_rad, (float(shift[0]), float(shift[1])), back.scale)
