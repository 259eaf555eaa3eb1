"""Unreachable free space: rays through windows, glimpses through doors, too narrow parts."""

from dataclasses import dataclass
from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import freeze, require_shape
from pgm_places._core import grow_pieces, label_components, open_cells, sum_pieces
from pgm_places.errors import InputError
from pgm_places.maps.components import squared_clearance
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from pgm_places.spaces.basins import open_space
from pgm_places.spaces.entered_options import EnteredOptions

MOST_RADIUS_M = 1e3
"""The largest disc radius."""

# Multiples of the radius of the discs that detect rays.
SCALES = (1, 2)

# A wall within this distance behind a border belongs to it: some maps have a rim of unknown cells.
RIM_M = 0.1

# Smaller islands of unknown cells are shadows of obstacles, and count as walls.
SHADOW_M2 = 1.0

# Least share of unknown space along the border of a piece that was seen but not entered: for a
# piece too narrow for the disc, and for one that the disc fits into.
NARROW_UNKNOWN, WIDE_UNKNOWN = 0.8, 0.7

# A narrow piece must also extend by this many radii beyond the disc: corners and sills do not.
NARROW_DEPTH = 2.0

# A disconnected space counts as entered (through a door that is closed on the map) from this area
# on, up to this share of unknown space along its border.
ROOM_M2, ROOM_UNKNOWN = 4.0, 0.5

# Larger spaces may have more unknown space along their border: the other half of a floor, behind a
# narrow gap or a drawn wall.
FLOOR_M2, FLOOR_UNKNOWN = 10.0, 0.6

# A walled-in space counts as entered, too: the outline of a piece of furniture.
BOX_UNKNOWN = 0.1

# Smaller disconnected pieces belong to their surroundings up to this share of unknown space along
# their border: corners between chairs, and specks in walls.
SCRAP_M2, SCRAP_UNKNOWN = 1.0, 0.7

# From this free share of the map's edge on, the free space along it is outside the building, as far
# as a disc wider than doors reaches. At least half of the free space must remain, as a map may be
# cropped through its rooms; less if all of the edge is free.
EDGE_FREE, OUTSIDE_RADIUS_M, LEAST_INSIDE = 0.4, 0.6, 0.5
ALL_FREE, LEAST_SURROUNDED = 0.95, 0.1

# A smaller total area is not reported.
LEAST_M2 = 0.1


@dataclass(frozen=True, eq=False)
class Unentered:
    """The unreachable free space of a map; false if it is empty.

    Parameters
    ----------
    cells : (H, W) bool
        Its cells.
    area_m2 : float
        Its area.
    free_m2 : float
        Area of all free space.
    outside_m2 : float
        The part of ``area_m2`` outside the building, along the edge of the map.
    """

    cells: NDArray[np.bool_]
    area_m2: float
    free_m2: float
    outside_m2: float = 0.0

    def __bool__(self) -> bool:
        return self.area_m2 > 0

    def __str__(self) -> str:
        share = 100 * self.area_m2 / self.free_m2 if self.free_m2 else 0.0
        outside = ""
        if self.outside_m2:
            outside = f"{self.outside_m2:.1f} m² outside the building at the edge of the map, "
        return (
            f"the robot cannot reach {self.area_m2:.1f} m² of free space ({share:.1f} %): {outside}"
            "seen through windows or doors, or too narrow"
        )


def find_unentered(
    grid: OccupancyGrid,
    disc_radius_m: float = EnteredOptions.disc_radius_m,
    *,
    except_at: NDArray[np.bool_] | None = None,
) -> Unentered:
    """The unreachable free cells of a map, which a robot cannot have entered.

    Free space, with small obstacles filled, is divided into wide pieces (the cells covered by a
    disc that fits) and narrow pieces (the rest). Wide pieces are unreachable if their borders are
    mostly at unknown space; narrow ones if they also extend farther than the disc is wide: rays and
    fans. This is repeated with discs of one and two radii. Then pieces that are not connected with
    the largest part are unreachable, by a disc of half the radius, so that narrow doors between
    walls connect; separate rooms, other parts of a floor, boxes and scraps count as entered. If
    much of the map's edge is free, the free space along it is outside the building.

    Time and memory are linear in the cells: about 33 bytes a cell at most.

    Parameters
    ----------
    grid : OccupancyGrid
    disc_radius_m : float
        0 makes all free space reachable.
    except_at : (H, W) bool, optional
        Cells that were certainly entered.

    Raises
    ------
    InputError
        The radius is negative or above a kilometre, or the shape of the mask is not the map's.

    Examples
    --------
    >>> cells = np.full((60, 90), -1, np.int8)
    >>> cells[9:41, 9:41], cells[10:40, 10:40] = 100, 0  # a room
    >>> cells[20:22, 40:85] = 0  # a ray through its wall
    >>> found = find_unentered(OccupancyGrid(cells, resolution_m=0.05))
    >>> int(found.cells[:, 41:].sum()), int(found.cells[:, :40].sum())
    (88, 0)
    """
    if not 0 <= disc_radius_m <= MOST_RADIUS_M:
        raise InputError(
            f"disc_radius_m must be from 0 to {MOST_RADIUS_M:g} metres, got {disc_radius_m}"
        )
    if except_at is not None:
        require_shape("except_at", except_at.shape, grid.shape, of="the map's")
    cell_m2 = grid.resolution_m**2
    cells = np.zeros(grid.shape, np.bool_)
    n_free, n_outside = int(np.count_nonzero(grid.free)), 0
    if disc_radius_m > 0 and n_free:
        outside, inside = outside_space(grid), grid
        if outside is not None:
            inside = grid.with_cells(np.where(outside, np.int8(UNKNOWN), grid.cells))
        raster = _Raster(inside, disc_radius_m)
        raster.close_rays()
        raster.close_cut_off()
        cells[raster.part] = raster.closed()
        if outside is not None:
            cells |= outside
        if except_at is not None:
            cells &= ~except_at
        if outside is not None:
            n_outside = int(np.count_nonzero(outside & cells))
    area_m2 = int(np.count_nonzero(cells)) * cell_m2
    if area_m2 < LEAST_M2:
        cells, area_m2 = np.zeros(grid.shape, np.bool_), 0.0
    return Unentered(freeze(cells), area_m2, n_free * cell_m2, n_outside * cell_m2)


def outside_space(grid: OccupancyGrid) -> NDArray[np.bool_] | None:
    """(H, W) the free cells outside a building whose surroundings are free on the map, or None.

    A disc of 0.6 m can reach them from the edge of the map without passing a door. The result is
    None if less than 40 % of the edge is free, or if less than half of the free space would remain
    inside (less than a tenth if at least 95 % of the edge is free).
    """
    free = grid.free
    edge = np.concatenate([free[0], free[-1], free[1:-1, 0], free[1:-1, -1]])
    edge_free = float(edge.mean())
    if edge_free < EDGE_FREE:
        return None
    radius = OUTSIDE_RADIUS_M / grid.resolution_m
    margin = 2 * ceil(radius) + 2  # free space around the map, where the disc starts
    wider = np.pad(free, margin, constant_values=True)
    standing = squared_clearance(~wider) >= _standing(radius)
    _, piece, _ = _numbered(_kind(standing))
    around = piece == piece[margin // 2, margin // 2]
    covered = squared_clearance(around) < _standing(radius)
    outside = covered[margin:-margin, margin:-margin] & free
    n_inside = np.count_nonzero(free & ~outside)
    least = LEAST_SURROUNDED if edge_free >= ALL_FREE else LEAST_INSIDE
    return outside if n_inside >= least * np.count_nonzero(free) else None


class _Sums(NamedTuple):
    """Sums per piece: sides of cells at walls, at unknown space, at other pieces, and more."""

    at_walls: NDArray[np.int64]
    at_unknown: NDArray[np.int64]
    at_others: NDArray[np.int64]
    n_free: NDArray[np.int64]  # cells that are free, not filled
    largest: NDArray[np.int64]  # the largest of some values of its cells


class _Raster:
    """The window of a map around its free cells, without unreachable ones, in a frame of wall."""

    def __init__(self, grid: OccupancyGrid, disc_radius_m: float) -> None:
        self.cell_m2, self.radius = grid.resolution_m**2, disc_radius_m / grid.resolution_m
        self.rim = max(1, round(RIM_M / grid.resolution_m))
        farthest = (1 + NARROW_DEPTH) * max(SCALES) * self.radius
        self.frame = ceil(max(farthest, self.rim)) + 2  # distances are limited to the raster
        self.part = (_span(grid.free, 0, self.rim), _span(grid.free, 1, self.rim))
        part = grid.cells[self.part]
        self.cells = np.pad(part, self.frame, constant_values=OCCUPIED)
        self.is_open = np.zeros(self.cells.shape, np.bool_)
        self.is_open[self._inside] = open_space(grid.with_cells(part), smallest_m2=0.0)
        self.squared = squared_clearance(~self.is_open)
        self._fill_shadows()

    @property
    def _inside(self) -> tuple[slice, slice]:
        height, width = self.cells.shape
        return slice(self.frame, height - self.frame), slice(self.frame, width - self.frame)

    def closed(self) -> NDArray[np.bool_]:
        """The closed free cells of the window."""
        return np.asarray((self.cells[self._inside] == FREE) & ~self.is_open[self._inside])

    def close_rays(self) -> None:
        """Close rays: pieces with unknown space along their border, at all scales."""
        for scale in SCALES:
            radius = scale * self.radius
            standing = self.squared >= _standing(radius)
            if not standing.any():
                return  # the largest part of free space is nowhere as wide as that
            away = squared_clearance(standing)
            kind = _kind(standing)
            kind[self.is_open & (away > int((radius + 0.5) ** 2))] = 1  # not covered by the disc
            scratch, piece, count = _numbered(kind)
            is_wide = np.zeros(count, np.bool_)
            is_wide[piece[standing]] = True
            grow_pieces(self.is_open, is_wide, scratch, piece)
            sums = self._sums(piece, count, away)
            unknown = _shares(sums)
            wide = (unknown >= WIDE_UNKNOWN) & (sums.at_unknown >= sums.at_others)
            deep = sums.largest >= ((1 + NARROW_DEPTH) * radius) ** 2
            chosen = np.where(is_wide, wide, (unknown >= NARROW_UNKNOWN) & deep)
            chosen[np.argmax(np.where(is_wide, sums.n_free, -1))] = False
            self._close(piece, chosen)

    def close_cut_off(self) -> None:
        """Close pieces that are not connected with the largest part; rooms and scraps stay."""
        scratch, piece, count = _numbered(_kind(self.squared >= _standing(self.radius / 2)))
        grow_pieces(self.is_open, np.ones(count, np.bool_), scratch, piece)
        rest = self.is_open & (piece < 0)
        if rest.any():
            _, numbers, n_rest = _numbered(_kind(rest))
            piece[rest] = count + numbers[rest]
            count += n_rest
        if count < 2:
            return
        sums = self._sums(piece, count, self.squared)
        unknown, area_m2 = _shares(sums), sums.n_free * self.cell_m2
        entered = (area_m2 >= ROOM_M2) & (unknown <= ROOM_UNKNOWN)
        entered |= (area_m2 >= FLOOR_M2) & (unknown <= FLOOR_UNKNOWN)
        entered |= unknown <= BOX_UNKNOWN
        entered &= sums.largest >= _standing(self.radius)
        entered |= (area_m2 < SCRAP_M2) & (unknown < SCRAP_UNKNOWN)
        entered[np.argmax(sums.n_free)] = True
        adjacent = np.zeros(count, np.bool_)
        adjacent[piece[_and_around(_in_pieces(piece, entered)) & self.is_open]] = True
        adjacent &= (sums.largest < _standing(self.radius)) & (area_m2 < SCRAP_M2)
        self._close(piece, ~(entered | adjacent))

    def _fill_shadows(self) -> None:
        """Treat small islands of cells that are not free as obstacles."""
        filled = np.empty(self.cells.shape, np.bool_)
        open_cells(_kind(self.is_open), 0, SHADOW_M2 / self.cell_m2, np.inf, 0.0, filled)
        self.cells[filled & ~self.is_open] = OCCUPIED

    def _sums(self, piece: NDArray[np.int32], count: int, values: NDArray[np.int32]) -> _Sums:
        sums = np.zeros((5, count), np.int64)
        sum_pieces(piece, self.is_open, self.cells, values, FREE, OCCUPIED, self.rim, sums)
        return _Sums(*sums)

    def _close(self, piece: NDArray[np.int32], chosen: NDArray[np.bool_]) -> None:
        if chosen.any():
            self.is_open &= ~_in_pieces(piece, chosen)
            squared_clearance(~self.is_open, out=self.squared)


def _kind(mask: NDArray[np.bool_]) -> NDArray[np.int8]:
    """(H, W) 0 in the mask, -1 elsewhere."""
    return mask.view(np.int8) - np.int8(1)


def _in_pieces(piece: NDArray[np.int32], chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(H, W) which cells are in one of the chosen pieces."""
    return np.append(chosen, False)[piece]  # the last entry is for cells without a piece, -1


def _and_around(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(H, W) the mask and the cells that share a side with it."""
    wider = mask.copy()
    wider[1:] |= mask[:-1]
    wider[:-1] |= mask[1:]
    wider[:, 1:] |= mask[:, :-1]
    wider[:, :-1] |= mask[:, 1:]
    return wider


def _numbered(kind: NDArray[np.int8]) -> tuple[NDArray[np.int32], NDArray[np.int32], int]:
    """A scratch array, the connected piece (H, W) of each cell, and the number of pieces."""
    scratch, piece = np.empty(kind.size, np.int32), np.empty(kind.shape, np.int32)
    return scratch, piece, label_components(kind, True, scratch, piece)


def _standing(radius: float) -> int:
    """Least squared distance, in cells, to the nearest blocked centre at which a disc fits."""
    return ceil((radius + 0.5) ** 2 - 1e-6)


def _shares(sums: _Sums) -> NDArray[np.float64]:
    """(P,) share of each piece's border that is at unknown space."""
    return sums.at_unknown / np.maximum(sums.at_walls + sums.at_unknown, 1)


def _span(mask: NDArray[np.bool_], axis: int, margin: int) -> slice:
    """The range of rows or columns with true cells, plus a margin."""
    where = np.flatnonzero(mask.any(axis=1 - axis))
    return slice(max(0, int(where[0]) - margin), int(where[-1]) + 1 + margin)
