"""Openings: the gaps between segments of open space."""

from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pgm_places._core import number_openings
from pgm_places.spaces.basins import half_width_m

_REACH = 2  # largest distance of neighbouring sites of a border, in half cells


@dataclass(frozen=True, eq=False)
class Borders:
    """The sites where basins of different segments touch."""

    # (M, 2) row and column halfway between the two cells, in half cells; for a cell between the
    # basins, twice its own
    halves_rc: NDArray[np.int32]
    basins: NDArray[np.int32]  # (M, 2) the two basins, the smaller number first
    relief: NDArray[np.int32]  # (M,) the lower of the two cells' heights
    is_side: NDArray[np.bool_]  # (M,) whether the cells share a side rather than a corner
    # (M,) whether both cells are free on the map, that is, neither is a filled obstacle
    is_free: NDArray[np.bool_]

    def free_ones(self) -> Self:
        """The sites that are not at filled obstacles."""
        return type(self)(*(getattr(self, field.name)[self.is_free] for field in fields(self)))


@dataclass(frozen=True, eq=False)
class Openings:
    """The gaps between segments; two segments may share several."""

    # (O, 2) the two segments, the smaller number first; rows are sorted
    segments: NDArray[np.int32]
    # (O,) half the width of the free space at the saddle: the largest distance to a wall along the
    # border
    half_width_m: NDArray[np.float64]
    saddle_rc: NDArray[np.float64]  # (O, 2) row and column of the saddle; integers are cell centres
    centre_rc: NDArray[np.float64]  # (O, 2) middle of the border
    # (O, 2) unit vector along the border; (0, 0) if it has no direction
    direction_rc: NDArray[np.float64]
    length_m: NDArray[np.float64]  # (O,) extent along the border, at least one cell
    sides: NDArray[np.int64]  # (O,) sides of cells along the border
    basins: NDArray[np.int32]  # (O, 2) two basins that touch at the saddle

    def __len__(self) -> int:
        return len(self.segments)

    def __getitem__(self, chosen: NDArray[np.bool_] | NDArray[np.int64] | slice) -> Self:
        """A selection of the openings, by mask, index or slice."""
        return type(self)(*(getattr(self, field.name)[chosen] for field in fields(self)))


def find_openings(
    borders: Borders, divisions: NDArray[np.int32], resolution_m: float
) -> list[Openings]:
    """The openings between the segments of each division.

    ``borders``: the borders of a division at least as fine as all of them. ``divisions`` (D, B):
    segment of each basin in each division.
    """
    first = np.cumsum([0, *(divisions.max(axis=1, initial=-1) + 1)])
    openings = _all_openings(borders, divisions, first, resolution_m)
    ends = np.searchsorted(openings.segments[:, 0], first).tolist()
    return [
        replace(openings[begin:end], segments=openings.segments[begin:end] - np.int32(start))
        for (begin, end), start in zip(pairwise(ends), first.tolist(), strict=False)
    ]


def _all_openings(
    borders: Borders, divisions: NDArray[np.int32], first: NDArray[np.int64], resolution_m: float
) -> Openings:
    """The openings of all divisions, with segments numbered across divisions."""
    sides = np.sort(divisions[:, borders.basins], axis=2)
    division, site = np.nonzero(sides[..., 0] != sides[..., 1])
    segments = sides[division, site] + first[division, np.newaxis].astype(np.int32)
    halves, relief = borders.halves_rc[site], borders.relief[site]
    opening = np.empty(len(site), np.int64)
    count = number_openings(segments, halves, _REACH, opening)
    place, top = halves / 2.0, np.zeros(count, np.int32)
    np.maximum.at(top, opening, relief)
    highest = np.flatnonzero(relief == top[opening])
    at_top = opening[highest]
    centre = _means(place, opening, count)
    offset = place - centre[opening]
    direction = _directions(offset, opening, count)
    return Openings(
        segments=segments[_first(opening)],
        half_width_m=half_width_m(top, resolution_m),
        saddle_rc=_means(place[highest], at_top, count),
        centre_rc=centre,
        direction_rc=direction,
        length_m=(_extents(offset, direction, opening) + 1) * resolution_m,
        sides=np.bincount(opening[borders.is_side[site]], minlength=count),
        basins=borders.basins[site[highest[_first(at_top)]]],
    )


def _first(opening: NDArray[np.int64]) -> NDArray[np.int64]:
    """(O,) the index of the first site of each opening."""
    return np.unique(opening, return_index=True)[1]


def _means(
    values: NDArray[np.float64], opening: NDArray[np.int64], count: int
) -> NDArray[np.float64]:
    """(O, D) means of values (n, D) over the sites of each opening."""
    sums = [np.bincount(opening, column, count) for column in values.T]
    return np.stack(sums, axis=1) / np.bincount(opening, minlength=count)[:, np.newaxis]


def _extents(
    offset: NDArray[np.float64], direction: NDArray[np.float64], opening: NDArray[np.int64]
) -> NDArray[np.float64]:
    """(O,) the extent of each opening's sites along its direction."""
    along = offset[:, 0] * direction[opening, 0] + offset[:, 1] * direction[opening, 1]
    low, high = np.zeros((2, len(direction)))
    np.minimum.at(low, opening, along)
    np.maximum.at(high, opening, along)
    return high - low


def _directions(
    offset: NDArray[np.float64], opening: NDArray[np.int64], count: int
) -> NDArray[np.float64]:
    """(O, 2) principal axis of each opening's sites; (0, 0) for symmetric ones."""
    r, c = offset.T
    rr, rc, cc = (np.bincount(opening, moment, count) for moment in (r * r, r * c, c * c))
    # The principal eigenvector of [[rr, rc], [rc, cc]] is at half this angle.
    angle = 0.5 * np.arctan2(2 * rc, cc - rr)
    direction = np.stack([np.sin(angle), np.cos(angle)], axis=1)
    direction[np.hypot(2 * rc, cc - rr) <= 1e-9 * (rr + cc)] = 0.0
    return direction
