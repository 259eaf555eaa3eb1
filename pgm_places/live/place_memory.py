"""PlaceMemory: the places of all maps so far, by which those of the next map are recognised."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places.maps.components import Components
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.maps.raster_shift import raster_shift
from pgm_places.topology.naming import SAME_PLACE, middles, number_on
from pgm_places.topology.topological_map import TopologicalMap

CONTAINED = 0.8
"""Share of a place that lies in a piece which is taken for its larger self: it has grown. Share of
a piece that lies in a place of the last map which is taken for its smaller self."""


NEAR_M, SMALL_M2 = 0.5, 2.0
"""Pieces and places as small as doorways may be the same if their middles are so near."""


STAYS, LASTING = 0.1, 0.15
"""What counts for a place that was in the last map, and for one that was in ten or more maps: more
than a few cells of overlap, less than a real difference."""


MANY_MAPS = 10


@dataclass
class RememberedPlace:
    """A place as it was when it was last there.

    Parameters
    ----------
    label, name : str
    cells : (n, 2) int64
        Rows and columns in the memory's raster, in row-major order.
    anchor_m : (float, float)
    n_maps : int
        In how many maps it was there.
    """

    label: str
    name: str
    cells: NDArray[np.int64]
    anchor_m: tuple[float, float]
    n_maps: int = 1


class PlaceMemory:
    """Recognises places by their class and area, also after maps in which they were missing.

    Each place is kept as it was when it was last there. A piece of the next map may be a place of
    the same class if their common area is at least a quarter of what they cover together, if the
    place lies in the piece (it has grown), if the piece lies in the place as it was in the last
    map (it has shrunk), or if both are as small as doorways and near each other. Places are
    matched by maximum total overlap (the Hungarian method); recent and long-lived ones get a
    bonus. So a place that is divided and joined again keeps its id, and its other part gets its
    old id back if it is divided once more.

    Attributes
    ----------
    places : mapping of int to RememberedPlace
        By id.
    raster : OccupancyGrid or None
        Whose cells are meant; only its frame counts. None before the first map.
    last : set of int
        Ids that were in the last map.
    next_id : int
        The first id that has never been used.
    n_maps : int
        How many maps there have been.
    names : mapping of int to str
        The name of every id.
    anchors_m : mapping of int to (float, float)
        Where each place is anchored.
    merged : mapping of int to int
        For places of the last map that are gone: the place that has most of their area now.
    parted : mapping of int to int
        For new places: the place of the map before that had most of their area.
    """

    def __init__(self) -> None:
        self.places: dict[int, RememberedPlace] = {}
        self.raster: OccupancyGrid | None = None
        self.last: frozenset[int] = frozenset()
        self.next_id, self.n_maps = 1, 0
        self.merged: Mapping[int, int] = {}
        self.parted: Mapping[int, int] = {}

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
        """An id per piece, and the next unused id: see ``topology.naming.number_on``."""
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

    def learn(self, topology: TopologicalMap) -> None:
        """Keep the places of a map whose ids came from here."""
        cells = np.argwhere(topology.region > 0)
        number = topology.region[tuple(cells.T)]
        order = np.argsort(number, kind="stable")
        cells, number = cells[order], number[order]
        for region in topology.regions:
            low, high = np.searchsorted(number, [region.id, region.id + 1])
            before = self.places.get(region.id)
            self.places[region.id] = RememberedPlace(
                region.label,
                region.name,
                cells[low:high],
                region.anchor_m,
                1 if before is None else before.n_maps + 1,
            )
        self.raster, self.next_id = topology.grid, topology.next_id
        self.last = frozenset(region.id for region in topology.regions)

    def _move_to(self, grid: OccupancyGrid) -> None:
        """Number the remembered cells as in another map."""
        if self.raster is None:
            return
        shift = raster_shift(self.raster, grid)
        for place in self.places.values():
            if shift is None:
                # Of another raster, the cells under the middles of the old ones: their area may
                # be another, but not by much.
                centres = self.raster.cell_centres_m(place.cells)
                place.cells = np.unique(grid.cells_at_m(centres), axis=0)
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
            found = pieces.piece[row[inside], column[inside]]
            common[:, k] = np.bincount(found[found >= 0], minlength=pieces.count)
        return common

    def _scores(
        self,
        pieces: Components,
        grid: OccupancyGrid,
        label_names: Sequence[str],
        known: Sequence[int],
        common: NDArray[np.int64],
    ) -> NDArray[np.float64]:
        """(pieces, places) how well each fits; 0 where it cannot be the same."""
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
        """(pieces, places) from 1 at the same spot to 0; 0 for what is not small."""
        small_cells = SMALL_M2 / grid.resolution_m**2
        mine = np.flatnonzero(pieces.size <= small_cells)
        theirs = np.flatnonzero((size > 0) & (size <= small_cells))
        found = np.zeros((pieces.count, len(places)))
        if not (len(mine) and len(theirs)):
            return found
        middle = np.array([places[k].cells.mean(axis=0) for k in theirs.tolist()])
        here = middles(pieces)[mine]
        distance_m = np.hypot(*(here[:, None] - middle).transpose(2, 0, 1)) * grid.resolution_m
        found[np.ix_(mine, theirs)] = np.maximum(1 - distance_m / NEAR_M, 0.0)
        return found

    def _note_changes(
        self,
        ids: Sequence[int],
        known: Sequence[int],
        common: NDArray[np.int64],
        pieces: Components,
    ) -> None:
        """Which places were merged into others, and which are parts of others."""
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
