"""Ids and names of places: recognition of the places of earlier maps in the next map."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import LabelError
from pgm_places.graph.bands import bands_of_rows
from pgm_places.maps.components import Components
from pgm_places.maps.occupancy_grid import OccupancyGrid, at_cells, raster_shift
from pgm_places.topology.regions import Region

SAME_PLACE = 0.25
"""Smallest intersection over union of areas at which a place keeps its id."""

ROW_M = 3.0
"""Places whose anchors differ by less than this in y count as one row when numbering."""

CONTAINED = 0.8
"""Least share of a place inside a piece for a match with a grown place, and least share of a piece
inside a place of the last map for a match with a shrunk place."""


NEAR_M, SMALL_M2 = 0.5, 2.0
"""Greatest distance of the middles, and area, at which small pieces match places nearby."""


STAYS, LASTING = 0.1, 0.15
"""Bonus of a place of the last map, and of a place of ten or more maps: more than the effect of a
few cells, less than a real difference."""


MANY_MAPS = 10


@dataclass
class RememberedPlace:
    """A place in its last known state."""

    label: str
    name: str
    cells: NDArray[np.int64]  # (n, 2) rows and columns in the memory's raster, in row-major order
    anchor_m: tuple[float, float]
    n_maps: int = 1  # number of maps with this place


SAME_MAP, SAME_RASTER, OTHER_MAP = 0.9, 0.95, 0.5
"""Shares of the area of earlier places that is free in a map. At least the first: the same map. At
least the second, compared by rows and columns: the map with another origin. Below the third: a
different map."""


class IdentifiedPlaces(Protocol):
    """The attributes of a topological map that determine its ids."""

    @property
    def grid(self) -> OccupancyGrid:
        """The map."""
        ...

    @property
    def regions(self) -> tuple[Region, ...]:
        """The places."""
        ...

    @property
    def next_id(self) -> int:
        """The first unused id."""
        ...

    def cells(self, key: int) -> NDArray[np.int64]:
        """(n, 2) row and column of the cells of a place."""
        ...


class PlaceIds:
    """Recognises places by their class and area, even after maps without them.

    A piece of the next map can match the last known state of a place of its class if their
    intersection over union is at least a quarter; if the place lies in the piece (it has grown); if
    the piece lies in a place of the last map (it has shrunk); or if both are as small as doorways
    and near each other. Matching maximises the total overlap (the Hungarian method), with a bonus
    for recent and long-lived places. A place that is divided and merged keeps its id, and so does
    its other part.

    ``raster`` is the frame of the cells of ``places``, None before the first map; ``last`` the ids
    in the last map, ``next_id`` the first unused id, ``anchors_m`` the places' anchors. ``merged``
    maps vanished places to the place with most of their area now; ``parted`` maps new places to the
    previous map's place that had most of theirs.
    """

    def __init__(self) -> None:
        self.places: dict[int, RememberedPlace] = {}
        self.raster: OccupancyGrid | None = None
        self.last: frozenset[int] = frozenset()
        self.next_id, self.n_maps = 1, 0
        self.merged: Mapping[int, int] = {}
        self.parted: Mapping[int, int] = {}

    @classmethod
    def of(cls, topology: IdentifiedPlaces) -> Self:
        """The ids of one map."""
        ids = cls()
        ids.learn(topology)
        return ids

    @property
    def names(self) -> Mapping[int, str]:
        """The name of every id."""
        return {number: place.name for number, place in self.places.items()}

    @property
    def anchors_m(self) -> Mapping[int, tuple[float, float]]:
        """Where each place is anchored."""
        return {number: place.anchor_m for number, place in self.places.items()}

    def identify(
        self,
        pieces: Components,
        grid: OccupancyGrid,
        label_names: Sequence[str],
        doorway_label: str = "doorway",
    ) -> tuple[list[int], int]:
        """An id per piece, and the next unused id: see :func:`number_on`."""
        from scipy.optimize import linear_sum_assignment

        self._move_to(grid)
        ids = [0] * pieces.count
        known = sorted(self.places)
        common = self._common(pieces, known)
        score = self._scores(pieces, grid, label_names, known, common)
        for piece, place in zip(*linear_sum_assignment(-score), strict=True):
            if score[piece, place] > 0:
                ids[piece] = known[place]
        ids, next_id = number_on(ids, self.next_id, pieces, grid, label_names, doorway_label)
        self._note_changes(ids, known, common, pieces)
        return ids, next_id

    def learn(self, topology: IdentifiedPlaces) -> None:
        """Store the places of a map that got its ids here."""
        for region in topology.regions:
            before = self.places.get(region.id)
            self.places[region.id] = RememberedPlace(
                region.label,
                region.name,
                topology.cells(region.id),
                region.anchor_m,
                1 if before is None else before.n_maps + 1,
            )
        self.raster, self.next_id = topology.grid, max(self.next_id, topology.next_id)
        self.last = frozenset(region.id for region in topology.regions)

    def fit_to(self, grid: OccupancyGrid) -> str:
        """Adopt an edited origin of the next map, which moves all cells in the map frame.

        Returns a warning of an edited origin, or of another map, where most places are not free;
        else "".
        """
        if self.raster is None or not self.last:
            return ""
        n_cells, n_free = 0, np.zeros(2, np.int64)
        for number in self.last:
            cells = self.places[number].cells
            here = grid.cells_at_m(self.raster.cell_centres_m(cells))
            n_free += [int(at_cells(grid.free, rc, False).sum()) for rc in (here, cells)]
            n_cells += len(cells)
        share, by_cell = (n_free / max(n_cells, 1)).tolist()
        before, now = (
            f"({x:g}, {y:g}) m, {yaw_rad:g} rad"
            for (x, y), yaw_rad in (
                (raster.origin_xy_m, raster.yaw_rad) for raster in (self.raster, grid)
            )
        )
        if share < SAME_MAP and by_cell >= SAME_RASTER and before != now:
            for place in self.places.values():
                at = self.raster.points_at_m([place.anchor_m])
                [[x, y]] = grid.cell_centres_m(at[:, ::-1] - 0.5).tolist()
                place.anchor_m = (x, y)
            self.raster = grid
            return (
                f"the origin of the map was {before} when its places were numbered and is {now} "
                "now; they keep their ids"
            )
        if share < OTHER_MAP:
            return (
                f"the ids are those of another map, or its frame has moved: {100 * share:.0f} % of "
                "the area of its places is free here; places not recognised are numbered from "
                f"{self.next_id}"
            )
        return ""

    def _move_to(self, grid: OccupancyGrid) -> None:
        """Convert the stored cells to the raster of another map."""
        if self.raster is None:
            return
        shift = raster_shift(self.raster, grid)
        for place in self.places.values():
            if shift is None:
                place.cells = _resampled(place.cells, self.raster, grid)
            elif shift.any():
                place.cells = place.cells + shift
        self.raster = grid

    def _common(self, pieces: Components, known: Sequence[int]) -> NDArray[np.int64]:
        """(pieces, places) cells that each piece has in common with each place."""
        common = np.zeros((pieces.count, len(known)), np.int64)
        height, width = pieces.piece.shape
        for k, number in enumerate(known):
            row, column = self.places[number].cells.T
            inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
            piece = pieces.piece[row[inside], column[inside]]
            common[:, k] = np.bincount(piece[piece >= 0], minlength=pieces.count)
        return common

    def _scores(
        self,
        pieces: Components,
        grid: OccupancyGrid,
        label_names: Sequence[str],
        known: Sequence[int],
        common: NDArray[np.int64],
    ) -> NDArray[np.float64]:
        """(pieces, places) score of each match; 0 for impossible ones."""
        places = [self.places[number] for number in known]
        size = np.array([len(place.cells) for place in places], np.int64)
        both = pieces.size[:, None] + size - common
        overlap = common / np.maximum(both, 1)
        contained = common / np.maximum(size, 1)
        names = np.array([label_names[label] for label in pieces.label], object)
        same = names[:, None] == np.array([place.label for place in places], object)
        nearness = self._nearness(pieces, grid, size, places)
        was_there = np.array([number in self.last for number in known], np.bool_)
        shrunk = was_there & (common >= CONTAINED * pieces.size[:, None])
        has_changed = (contained >= CONTAINED) | shrunk | (nearness > 0)
        fits = same & ((overlap >= SAME_PLACE) | has_changed)
        prior = [
            STAYS * (number in self.last) + LASTING * min(place.n_maps / MANY_MAPS, 1.0)
            for number, place in zip(known, places, strict=True)
        ]
        return np.where(fits, np.maximum(overlap, SAME_PLACE * nearness) + np.array(prior), 0.0)

    def _nearness(
        self,
        pieces: Components,
        grid: OccupancyGrid,
        size: NDArray[np.int64],
        places: Sequence[RememberedPlace],
    ) -> NDArray[np.float64]:
        """(pieces, places) nearness from 1 at the same spot to 0; 0 unless both are small."""
        small_cells = SMALL_M2 / grid.resolution_m**2
        mine = np.flatnonzero(pieces.size <= small_cells)
        theirs = np.flatnonzero((size > 0) & (size <= small_cells))
        nearness = np.zeros((pieces.count, len(places)))
        if not (len(mine) and len(theirs)):
            return nearness
        middle = np.array([places[k].cells.mean(axis=0) for k in theirs.tolist()])
        here = middles(pieces)[mine]
        distance_m = np.hypot(*(here[:, None] - middle).transpose(2, 0, 1)) * grid.resolution_m
        nearness[np.ix_(mine, theirs)] = np.maximum(1 - distance_m / NEAR_M, 0.0)
        return nearness

    def _note_changes(
        self,
        ids: Sequence[int],
        known: Sequence[int],
        common: NDArray[np.int64],
        pieces: Components,
    ) -> None:
        """Note places that were merged into others, and places that were split off others."""
        column = {number: k for k, number in enumerate(known)}
        self.merged, self.parted = {}, {}
        for number in sorted(self.last.difference(ids)):
            shared = common[:, column[number]]
            if len(shared) and 2 * shared.max() > len(self.places[number].cells):
                self.merged[number] = ids[int(shared.argmax())]
        last = [column[number] for number in sorted(self.last)]
        for piece, number in enumerate(ids):
            if number in self.last or not last:
                continue
            best = max(last, key=lambda k: common[piece, k])
            if 2 * common[piece, best] > pieces.size[piece]:
                self.parted[number] = known[best]


def _resampled(
    cells: NDArray[np.int64], old: OccupancyGrid, new: OccupancyGrid
) -> NDArray[np.int64]:
    """(n, 2) cells of a new raster whose centres lie in cells (m, 2) of an old one."""
    if not len(cells):
        return cells
    low, high = cells.min(axis=0), cells.max(axis=0) + 1
    inside = np.zeros(high - low, np.bool_)
    inside[tuple((cells - low).T)] = True
    corners = np.array([low, (low[0], high[1]), (high[0], low[1]), high]) - 0.5
    box = new.cells_at_m(old.cell_centres_m(corners))
    first, shape = box.min(axis=0), tuple((np.ptp(box, axis=0) + 1).tolist())
    parts = [np.empty((0, 2), np.int64)]
    for rows in bands_of_rows(shape):
        here = np.indices((rows.stop - rows.start, shape[1])).reshape(2, -1).T
        here += first + np.array([rows.start, 0])
        there = old.cells_at_m(new.cell_centres_m(here)) - low
        parts.append(here[at_cells(inside, there, False)])
    return np.concatenate(parts)


def number_on(
    ids: list[int],
    next_id: int,
    pieces: Components,
    grid: OccupancyGrid,
    label_names: Sequence[str],
    doorway_label: str,
) -> tuple[list[int], int]:
    """The ids with each 0 replaced by a new id from ``next_id`` on, and the next unused id.

    New ids run from top left to bottom right, doorways last, so that rooms have consecutive ids.
    """
    is_doorway = np.array([label_names[label] == doorway_label for label in pieces.label], np.bool_)
    order = reading_order(pieces, grid)
    numbered = list(ids)
    for piece in [*order[~is_doorway[order]].tolist(), *order[is_doorway[order]].tolist()]:
        if not numbered[piece]:
            numbered[piece] = next_id
            next_id += 1
    return numbered, next_id


def middles(pieces: Components) -> NDArray[np.float64]:
    """(R, 2) mean row and column of the cells of each piece."""
    sums = np.zeros((2, pieces.count))
    for part in bands_of_rows(pieces.piece.shape):
        band = pieces.piece[part]
        inside = np.nonzero(band >= 0)
        numbers = band[inside]
        sums[0] += np.bincount(numbers, inside[0] + part.start, pieces.count)
        sums[1] += np.bincount(numbers, inside[1], pieces.count)
    return (sums / pieces.size).T


def reading_order(pieces: Components, grid: OccupancyGrid) -> NDArray[np.intp]:
    """(R,) pieces by row from the top, each row from the left, by their mean cells."""
    rows, columns = middles(pieces).T
    band = np.floor((grid.shape[0] - rows) * grid.resolution_m / ROW_M)
    return np.lexsort((columns, band))


def name_places(
    ids: Sequence[int],
    labels: Sequence[str],
    *,
    known: Mapping[int, str] | None = None,
    own: Mapping[int, str] | None = None,
) -> list[str]:
    """A name per place: the user's ``own``, the earlier one (``known``), or its class and id.

    Earlier names such as ``"room 3"`` get the new class and id. LabelError for equal names.

    Examples
    --------
    >>> name_places([1, 2, 3], ["room", "corridor", "room"], own={3: "kitchen"})
    ['room 1', 'corridor 2', 'kitchen']
    """
    known, own = known or {}, own or {}
    result = []
    for place, label in zip(ids, labels, strict=True):
        earlier = known.get(place, "")
        numbered = f"{label} {place}"
        if numbered in own.values():  # the user's name of another place
            numbered += f" (id {place})"
        automatic = not earlier or re.fullmatch(re.escape(label) + r" \d+( \(id \d+\))?", earlier)
        result.append(own.get(place) or (numbered if automatic else earlier))
    twice = [name for name, count in Counter(result).items() if count > 1]
    if twice:
        places = [str(place) for place, name in zip(ids, result, strict=True) if name == twice[0]]
        raise LabelError(
            f"places {' and '.join(places)} are both named {twice[0]!r}; give one another name"
        )
    return result
