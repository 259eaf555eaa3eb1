"""Chords: straight lines across free space from wall to wall."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Chord", "chord_directions", "has_short_chord", "shortest_chords"]

N_DIRECTIONS = 36


@dataclass(frozen=True)
class Chord:
    """A straight line from wall to wall; positions in cells, integers being cell centres.

    Parameters
    ----------
    start_rc, end_rc : (float, float)
        Row and column of its ends.
    """

    start_rc: tuple[float, float]
    end_rc: tuple[float, float]

    @property
    def length(self) -> float:
        """Distance of its ends in cells."""
        return float(np.hypot(*np.subtract(self.end_rc, self.start_rc)))

    @property
    def middle(self) -> NDArray[np.float64]:
        """(2,) row and column of the midpoint."""
        return np.add(self.start_rc, self.end_rc) / 2


def shortest_chords(blocked: ArrayLike, cells_rc: ArrayLike, longest: float) -> list[Chord]:
    """The shortest chord of free space in each direction through any of the given cells.

    Parameters
    ----------
    blocked : (H, W) bool
        Where chords end; they also end at the raster's edge.
    cells_rc : (n, 2) int
        Row and column of free cells.
    longest : float
        Longest chord to look for, in cells.

    Returns
    -------
    list of Chord
        At most one for each of 36 directions, to a quarter of a cell, shortest first.

    Examples
    --------
    >>> corridor = np.zeros((3, 9), bool)
    >>> found = shortest_chords(corridor, [[1, 4]], 5.0)[0]
    >>> found.start_rc, found.end_rc, found.length
    ((2.5, 4.0), (-0.75, 4.0), 3.25)
    """
    from pgm_places.topology._refinement_kernels import shortest_chords as kernel

    cells = np.asarray(cells_rc, np.int64).reshape(-1, 2)
    length, ends = np.empty(N_DIRECTIONS), np.empty((N_DIRECTIONS, 4))
    kernel(
        np.ascontiguousarray(blocked, np.bool_),
        np.ascontiguousarray(cells[:, 0]),
        np.ascontiguousarray(cells[:, 1]),
        chord_directions(),
        float(longest),
        length,
        ends,
    )
    order = [d for d in np.argsort(length, kind="stable") if np.isfinite(length[d])]
    return [Chord((r0, c0), (r1, c1)) for r0, c0, r1, c1 in ends[order].tolist()]


def has_short_chord(
    blocked: NDArray[np.bool_], cells_rc: NDArray[np.int64], longest: float
) -> NDArray[np.bool_]:
    """(n,) whether some chord through each cell is at most ``longest`` cells long."""
    from pgm_places.topology._refinement_kernels import mark_narrow

    narrow = np.empty(len(cells_rc), np.bool_)
    rows, columns = (np.ascontiguousarray(axis) for axis in cells_rc.T)
    mark_narrow(blocked, rows, columns, chord_directions(), float(longest), narrow)
    return narrow


def chord_directions() -> NDArray[np.float64]:
    """(36, 2) row and column steps of length 1 over half a turn."""
    angles = np.arange(N_DIRECTIONS) * np.pi / N_DIRECTIONS
    # Make straight up exact, whatever the library's cosine of 90 degrees.
    return np.round(np.stack([np.cos(angles), np.sin(angles)], axis=1), 12)
