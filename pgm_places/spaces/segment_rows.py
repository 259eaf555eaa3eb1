"""The segments of several divisions, row after row, so that all are described at once."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.spaces.segmentation import Segments


@dataclass(frozen=True, eq=False)
class SegmentRows:
    """The segments of divisions of one map, those of one division after those of the other.

    Parameters
    ----------
    divisions : sequence of Segments
        At least one.
    """

    divisions: Sequence[Segments]

    @cached_property
    def first(self) -> NDArray[np.int64]:
        """(D + 1,) the first segment of each division, and S, the number of all."""
        return np.cumsum([0, *(division.count for division in self.divisions)])

    @property
    def count(self) -> int:
        """S."""
        return int(self.first[-1])

    @property
    def resolution_m(self) -> float:
        """The map's cell size."""
        return self.divisions[0].watershed.grid.resolution_m

    @cached_property
    def area_m2(self) -> NDArray[np.float64]:
        """(S,) area of each segment."""
        return np.concatenate([division.area_m2 for division in self.divisions])

    @cached_property
    def radius_m(self) -> NDArray[np.float64]:
        """(S,) radius of the largest disc in each segment."""
        return np.concatenate([division.radius_m for division in self.divisions])

    @cached_property
    def ends(self) -> NDArray[np.int64]:
        """(2 O,) the two segments of each opening."""
        return self._numbered(division.openings.segments for division in self.divisions).reshape(-1)

    @cached_property
    def half_width_m(self) -> NDArray[np.float64]:
        """(2 O,) half the width of each opening, twice."""
        openings = [division.openings.half_width_m for division in self.divisions]
        return np.repeat(np.concatenate(openings), 2)

    @cached_property
    def open_sides(self) -> NDArray[np.float64]:
        """(S,) sides of cells at openings."""
        sides = np.concatenate([division.openings.sides for division in self.divisions])
        twice = np.repeat(sides, 2).astype(np.float64)
        return np.asarray(np.bincount(self.ends, twice, self.count), np.float64)

    @cached_property
    def neighbours(self) -> NDArray[np.int64]:
        """(E, 2) the pairs of segments that share an opening."""
        return self._numbered(division.neighbours for division in self.divisions)

    def by_division(self, values: NDArray[Any]) -> list[NDArray[Any]]:
        """Values (S, ...) of all segments as those of each division."""
        return np.split(values, self.first[1:-1])

    def _numbered(self, pairs: Iterator[NDArray[np.int32]]) -> NDArray[np.int64]:
        """Pairs of segments of each division by their numbers among all."""
        starts = self.first.tolist()
        return np.concatenate(
            [part.astype(np.int64) + start for part, start in zip(pairs, starts, strict=False)]
        )
