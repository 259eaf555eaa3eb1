"""Directions of beams, cut into octants so that mirrored beams have exactly mirrored slopes.

A direction is written as *major* and *minor* component: the longer and the shorter one, both
non-negative, with the axis of the longer one and the two signs. Beams on a diagonal have two equal
components; they count the x axis as their major one, and wherever a ray meets the corner of four
cells it steps along x first. Sweep and DDA share that convention.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Beams"]


@dataclass(frozen=True, eq=False)
class Beams:
    """Unit directions of M beams in the grid's frame (x along columns, y along rows).

    Parameters
    ----------
    step_x, step_y : (M,) int64
        -1, 0 or 1: to which neighbouring column and row the beam leads.
    major, minor : (M,) float64
        The longer and the shorter component, not negative.
    x_is_major : (M,) bool
        Whether the longer component is the one along x.
    """

    step_x: NDArray[np.int64]
    step_y: NDArray[np.int64]
    major: NDArray[np.float64]
    minor: NDArray[np.float64]
    x_is_major: NDArray[np.bool_]

    @classmethod
    def full_circle(cls, n_beams: int) -> "Beams":
        """Beams at ``2 pi i / n_beams``, their octant and the angle in it found in integers."""
        octant, rest = np.divmod(8 * np.arange(n_beams, dtype=np.int64), n_beams)
        on_diagonal = (octant % 2 == 1) & (rest == 0)
        from_axis = np.where(octant % 2 == 0, rest, n_beams - rest) / n_beams * (np.pi / 4)
        major, minor = np.cos(from_axis), np.sin(from_axis)
        major[on_diagonal] = minor[on_diagonal] = np.sqrt(0.5)
        x_is_major = np.isin(octant, (0, 3, 4, 7)) | on_diagonal
        along_x = np.where(x_is_major, major, minor)
        along_y = np.where(x_is_major, minor, major)
        leftward = np.isin(octant, (2, 3, 4, 5))
        downward = octant >= 4
        return cls(
            np.where(along_x == 0, 0, np.where(leftward, -1, 1)),
            np.where(along_y == 0, 0, np.where(downward, -1, 1)),
            major,
            minor,
            x_is_major,
        )

    def __len__(self) -> int:
        return len(self.major)

    @property
    def along_x(self) -> NDArray[np.float64]:
        """(M,) size of the component along x."""
        return np.where(self.x_is_major, self.major, self.minor)

    @property
    def along_y(self) -> NDArray[np.float64]:
        """(M,) size of the component along y."""
        return np.where(self.x_is_major, self.minor, self.major)
