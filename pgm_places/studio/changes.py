"""Changes: what a relabelling has changed outside the paint, and how much agrees with the truth."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pgm_places.graph.bands import bands_of_rows

LEAST_M2 = 0.5
"""Less is not worth a word."""


@dataclass(frozen=True, eq=False)
class Changes:
    """The cells whose label is another one than before, apart from those that were painted.

    Parameters
    ----------
    cells : (H, W) bool
    became_m2 : dict of int to float
        How much got each label.
    """

    cells: NDArray[np.bool_]
    became_m2: dict[int, float]

    @classmethod
    def between(
        cls,
        before: NDArray[np.int16],
        after: NDArray[np.int16],
        paint: NDArray[np.int16],
        resolution_m: float,
    ) -> Self:
        """Those between two labellings (H, W) by the same classes, -1 for none."""
        cells = np.zeros(after.shape, np.bool_)
        counts = np.zeros(int(after.max(initial=-1)) + 2, np.int64)
        for rows in bands_of_rows(after.shape):
            new = after[rows]
            cells[rows] = (
                (before[rows] != new) & (before[rows] >= 0) & (new >= 0) & (paint[rows] < 0)
            )
            counts += np.bincount(new[cells[rows]], minlength=len(counts))
        area_m2 = counts * resolution_m**2
        return cls(cells, {int(k): float(area_m2[k]) for k in np.flatnonzero(counts)})

    def words(self, names: Sequence[str]) -> str:
        """What became what, the most first; empty where it is hardly anything.

        Examples
        --------
        >>> one = np.zeros((2, 5), np.int16)
        >>> other = np.array([[0, 1, 1, 0, 0], [0, 1, 2, 0, 0]], np.int16)
        >>> Changes.between(one, other, np.full_like(one, -1), 1.0).words(["a", "room", "lab"])
        '3.0 m² became room, 1.0 m² lab'
        """
        listed = sorted(self.became_m2.items(), key=lambda item: -item[1])
        told = [(k, area) for k, area in listed if area >= LEAST_M2]
        return ", ".join(
            f"{area:.1f} m²{'' if number else ' became'} {names[k]}"
            for number, (k, area) in enumerate(told)
        )


def share_that_agrees(labels: NDArray[np.int16], truth: NDArray[np.int16]) -> float | None:
    """The share of the cells with a truth and a label whose label it is; None without any."""
    known = right = 0
    for rows in bands_of_rows(labels.shape):
        both = (truth[rows] >= 0) & (labels[rows] >= 0)
        known += int(both.sum())
        right += int((both & (truth[rows] == labels[rows])).sum())
    return right / known if known else None
