"""Directions of beams, cut into octants so that mirrored beams have exactly mirrored slopes.

A direction has a *major* component, the longer one, and a *minor* one. Within an octant the axis of
the longer one and both signs are the same, so that after swapping and mirroring axes every octant
looks like the first: major component forward, minor component upward, slope from 0 to 1.

Beams on a diagonal have two equal components; they count the x axis as their major one, and where a
ray meets the corner of four cells it steps along x first. Sweep and DDA share that convention.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Octant:
    """The octant counted counter-clockwise from the x axis, 0 to 7.

    It begins at 45 degrees times its number.
    """

    number: int

    @property
    def x_is_major(self) -> bool:
        """Whether its directions are longer along x than along y."""
        return self.number in (0, 3, 4, 7)

    @property
    def step_x(self) -> int:
        """Sign of x."""
        return -1 if self.number in (2, 3, 4, 5) else 1

    @property
    def step_y(self) -> int:
        """Sign of y."""
        return -1 if self.number >= 4 else 1


@dataclass(frozen=True, eq=False)
class Beams:
    """Unit directions of M beams in the grid's frame (x along columns, y along rows).

    Parameters
    ----------
    octant : (M,) int64
        Number of each beam's octant, increasing.
    major, minor : (M,) float64
        The longer and the shorter component, not negative.
    """

    octant: NDArray[np.int64]
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
    def steps(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(M,) -1, 0 or 1 each: to which neighbouring column and row a beam leads."""
        kinds = [Octant(number) for number in range(8)]
        x = np.array([kind.step_x for kind in kinds])[self.octant]
        y = np.array([kind.step_y for kind in kinds])[self.octant]
        along_x, along_y = self.components
        return np.where(along_x == 0, 0, x), np.where(along_y == 0, 0, y)

    @cached_property
    def components(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(M,) sizes of the components along x and y."""
        x_is_major = np.array([Octant(number).x_is_major for number in range(8)])[self.octant]
        along_x = np.where(x_is_major, self.major, self.minor)
        along_y = np.where(x_is_major, self.minor, self.major)
        return along_x, along_y
