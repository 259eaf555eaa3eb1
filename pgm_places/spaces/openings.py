"""Openings: the gaps between segments of open space."""

from dataclasses import dataclass, fields
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pgm_places.spaces.relief import half_width_m

__all__ = ["Borders", "Openings", "find_openings"]

_REACH = 2
"""Sites of one border are at most a cell apart: two halves."""


@dataclass(frozen=True, eq=False)
class Borders:
    """Every site where basins of different segments touch.

    Parameters
    ----------
    halves_rc : (M, 2) int32
        Row and column halfway between the two cells, in half cells; for a cell between the basins,
        twice its own.
    basins : (M, 2) int32
        The two basins, the smaller number first.
    relief : (M,) int32
        The lower of the two cells' heights.
    is_side : (M,) bool
        Whether the cells share a side rather than a corner.
    is_free : (M,) bool
        Whether both cells are free on the map, that is, neither is a filled obstacle.
    """

    halves_rc: NDArray[np.int32]
    basins: NDArray[np.int32]
    relief: NDArray[np.int32]
    is_side: NDArray[np.bool_]
    is_free: NDArray[np.bool_]

    def free_ones(self) -> Self:
        """The sites that are not at filled obstacles."""
        return type(self)(*(getattr(self, field.name)[self.is_free] for field in fields(self)))


@dataclass(frozen=True, eq=False)
class Openings:
    """The gaps between segments; two segments may share several.

    Parameters
    ----------
    segments : (O, 2) int32
        The two segments, the smaller number first; rows are sorted.
    half_width_m : (O,) float64
        Half the width of the free space at the saddle: the largest distance to a wall along the
        border.
    saddle_rc : (O, 2) float64
        Row and column of the saddle; integers are cell centres.
    centre_rc : (O, 2) float64
        Middle of the border.
    direction_rc : (O, 2) float64
        Unit vector along the border; (0, 0) if it has no direction.
    length_m : (O,) float64
        Extent along the border, at least one cell.
    sides : (O,) int64
        Sides of cells along the border.
    basins : (O, 2) int32
        Two basins that touch at the saddle.
    """

    segments: NDArray[np.int32]
    half_width_m: NDArray[np.float64]
    saddle_rc: NDArray[np.float64]
    centre_rc: NDArray[np.float64]
    direction_rc: NDArray[np.float64]
    length_m: NDArray[np.float64]
    sides: NDArray[np.int64]
    basins: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.segments)

    def __getitem__(self, chosen: NDArray[np.bool_] | NDArray[np.int64]) -> Self:
        """A selection of the openings, by mask or index."""
        return type(self)(*(getattr(self, field.name)[chosen] for field in fields(self)))


def find_openings(borders: Borders, segment_of: NDArray[np.int32], resolution_m: float) -> Openings:
    """The openings between segments.

    Parameters
    ----------
    borders : Borders
        Those of a division at least as fine.
    segment_of : (B,) int32
        Segment of each basin.
    resolution_m : float

    Sites of one pair of segments belong to the same opening if they are at most a cell apart, so
    that a pillar or a wall between two doors separates two openings.
    """
    both = np.sort(segment_of[borders.basins], axis=1)
    kept = np.flatnonzero((both[:, 0] != both[:, 1]) & (both[:, 0] >= 0))
    both = both[kept]
    opening = _pieces(both, borders.halves_rc[kept])
    first = np.unique(opening, return_index=True)[1]
    count = len(first)
    sites = borders.halves_rc[kept] / 2.0
    relief = borders.relief[kept]
    top = np.zeros(count, np.int32)
    np.maximum.at(top, opening, relief)
    at_saddle = np.flatnonzero(relief == top[opening])
    centre = _means(opening, sites, count)
    direction, extent = _directions(opening, sites - centre[opening], count)
    saddle = at_saddle[np.unique(opening[at_saddle], return_index=True)[1]]
    return Openings(
        segments=both[first],
        half_width_m=half_width_m(top, resolution_m),
        saddle_rc=_means(opening[at_saddle], sites[at_saddle], count),
        centre_rc=centre,
        direction_rc=direction,
        length_m=(extent + 1) * resolution_m,
        sides=np.bincount(opening, borders.is_side[kept], count).astype(np.int64),
        basins=borders.basins[kept][saddle],
    )


def _pieces(both: NDArray[np.int32], halves_rc: NDArray[np.int32]) -> NDArray[np.int64]:
    """(M,) number of the connected piece of border that each site belongs to, sorted by pair."""
    from pgm_places.spaces._border_kernels import join_sites

    if not len(both):
        return np.zeros(0, np.int64)
    span = halves_rc.max(axis=0).astype(np.int64) + 2 * _REACH + 1
    pair = np.unique(both[:, 0].astype(np.int64) << 32 | both[:, 1], return_inverse=True)[1]
    site = halves_rc + _REACH
    key = (pair * span[0] + site[:, 0]) * span[1] + site[:, 1]
    known, index = np.unique(key, return_inverse=True)
    # numbered in the order of the pairs, then of the first site
    piece = np.empty(len(known), np.int64)
    join_sites(known, int(span[1]), _REACH, piece)
    return np.asarray(piece[index])


def _means(group: NDArray[np.int64], sites: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    n = np.bincount(group, minlength=count)
    return np.stack([np.bincount(group, axis, count) / n for axis in sites.T], axis=1)


def _directions(
    group: NDArray[np.int64], offset: NDArray[np.float64], count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(O, 2) principal axis of each group's offsets from its mean, and the extent along it."""
    rr, rc, cc = (
        np.bincount(group, product, count)
        for product in (offset[:, 0] ** 2, offset[:, 0] * offset[:, 1], offset[:, 1] ** 2)
    )
    # The principal eigenvector of [[rr, rc], [rc, cc]] is at half this angle.
    angle = 0.5 * np.arctan2(2 * rc, cc - rr)
    direction = np.stack([np.sin(angle), np.cos(angle)], axis=1)
    direction[np.hypot(2 * rc, cc - rr) <= 1e-9 * (rr + cc)] = 0.0
    along = (offset * direction[group]).sum(axis=1)
    low, high = np.zeros(count), np.zeros(count)
    np.minimum.at(low, group, along)
    np.maximum.at(high, group, along)
    return direction, high - low
