"""Directions of beams by octant, so that mirrored beams have exactly mirrored slopes.

A direction has a *major* component, the longer one, and a *minor* one. Within an octant the axis of
the longer one and both signs are the same, so that after swapping and mirroring axes every octant
looks like the first: major component forward, minor component upward, slope from 0 to 1.

Beams on a diagonal have two equal components; they count the x axis as their major one, and where a
ray meets the corner of four cells it steps along x first. Sweep and DDA share that convention.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Octant(NamedTuple):
    """An octant; they are counted counter-clockwise from the x axis, 45 degrees each."""

    x_is_major: bool
    """Whether x is the major axis of its directions."""
    step_x: int
    """Sign of x."""
    step_y: int
    """Sign of y."""


OCTANTS = [
    Octant(n in (0, 3, 4, 7), -1 if 2 <= n <= 5 else 1, -1 if n >= 4 else 1) for n in range(8)
]


class Ways(NamedTuple):
    """Steps of M beams from cell to cell."""

    step_x: NDArray[np.int64]
    """(M,) step along columns: -1, 0 or 1."""
    step_y: NDArray[np.int64]
    """(M,) step along rows: -1, 0 or 1."""
    per_x: NDArray[np.float64]
    """(M,) length of ray per column, in cells; infinite for beams along a column."""
    per_y: NDArray[np.float64]
    """(M,) length of ray per row, in cells."""
    metres_x: NDArray[np.floating[Any]]
    """Length of ray per column and per row, in metres."""
    metres_y: NDArray[np.floating[Any]]


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
