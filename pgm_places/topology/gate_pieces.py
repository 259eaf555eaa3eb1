"""Gate pieces: the pieces of a labelled map whose doorways are gates that separate places."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from pgm_places.graph.bands import bands_of_rows, counted
from pgm_places.maps.components import Components, connected_components, number_type
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.spaces.doorways import Doorways
from pgm_places.topology.corrections import Correction, correct_regions
from pgm_places.topology.rules import CorrectionRules

Numbers: TypeAlias = NDArray[np.int16] | NDArray[np.int32]

_NEIGHBOURS = [(dr, dc) for dr in (-1, 0, 1) for dc in (-1, 0, 1) if dr or dc]


@dataclass(frozen=True, eq=False)
class GatePieces:
    """The pieces of a map whose doorways are gates."""

    pieces: Components
    gate: NDArray[np.int64]  # (R,) number of each piece's gate, -1 for pieces of places
    corrections: tuple[Correction, ...]  # the relabelled pieces


def pieces_between(
    labels: NDArray[np.int16],
    grid: OccupancyGrid,
    label_names: Sequence[str],
    doorways: Doorways,
    rules: CorrectionRules,
    *,
    correct: bool = True,
) -> GatePieces:
    """The pieces of a map according to its labels and gates.

    The labelled cells in the rectangle of a gate form its doorway, with any labels; where
    rectangles overlap, the more probable gate wins. All others are grouped by place and label:
    cells of one label in two places are two pieces. Cells labelled as doorways but outside all
    gates take the nearest other label of their place.

    ``labels`` (H, W): label per cell, -1 for none; labels of cells that are not free are ignored.
    ``label_names``: the label of doorways among them. ``doorways``: the gates of the map, possibly
    at another resolution. ``rules``: pieces of places below ``min_area_m2``, or without room for a
    disc of ``min_clearance_m``, get the label and place of the neighbour with the longest border; a
    gate counts as a neighbour only if there is no other. Gates are not corrected. ``correct``:
    whether to apply these corrections.
    """
    division = _Division(labels, grid, label_names, doorways, rules)
    log = division.without_gate()
    division.number_places(doorways.place_on(grid))
    division.relabel()
    key, names = division.keys(len(doorways))
    first_gate, n_labels, doorway = len(names) - len(doorways), len(label_names), division.doorway
    del division  # frees the rasters of a huge map
    if correct:
        # Gates of any size stay; places merge only with places.
        bare = replace(rules, min_doorway_area_m2=0.0)
        key, corrected = correct_regions(
            key, names, grid.resolution_m, bare, fixed_doorways=True, free=grid.free
        )
        log += corrected
    return _pieces(key, first_gate, n_labels, doorway, tuple(log))


class _Division:
    """Division of a map: labels, gates and places of its cells."""

    place: Numbers
    n_places: int

    def __init__(
        self,
        labels: NDArray[np.int16],
        grid: OccupancyGrid,
        names: Sequence[str],
        doorways: Doorways,
        rules: CorrectionRules,
    ) -> None:
        self.grid, self.names, self.rules = grid, names, rules
        self.doorway = names.index(rules.doorway_label)
        self.labels = _on_free_cells(labels, grid)
        self.gate = _painted_gates(self.labels, grid, doorways)
        self.painted = (self.labels == self.doorway) & (self.gate < 0)

    @property
    def bands(self) -> Iterator[slice]:
        """Bands of rows, which bound the memory for huge maps."""
        return bands_of_rows(self.grid.shape)

    def without_gate(self) -> list[Correction]:
        """A correction for each painted doorway that no gate touches."""
        if not self.painted.any():
            return []
        pieces = connected_components(self.labels == self.doorway)
        with_gate = np.zeros(pieces.count, np.bool_)
        for band in self.bands:
            piece = pieces.piece[band]
            with_gate[piece[(piece >= 0) & (self.gate[band] >= 0)]] = True
        cells = np.argwhere(self.painted)
        numbers, first = np.unique(pieces.piece[self.painted], return_index=True)
        cell_m2, name = self.grid.resolution_m**2, self.names[self.doorway]
        log = []
        for number, (r, c) in zip(numbers.tolist(), cells[first].tolist(), strict=True):
            if not with_gate[number]:
                area_m2 = float(pieces.size[number]) * cell_m2
                log.append(Correction((r, c), area_m2, name, "", "no gate"))
        return log

    def number_places(self, place: Numbers) -> None:
        """Number the places of labelled cells outside gates, -1 elsewhere."""
        # The numbers are written into place if they fit. Pieces that only rectangles separate form
        # one place. Exceptions are places of at least min_area_m2 that a leak next to a gate
        # connects: their border is at the narrowest point, not along rectangles.
        labels = self.labels
        grow(place, (place < 0) & (labels >= 0), np.zeros(labels.shape, np.int8))
        parted = connected_components((labels >= 0) & (self.gate < 0)).piece
        n = int(place.max(initial=-1)) + 2  # the first is for cells in no place

        def pairs(rows: slice) -> NDArray[np.int64]:
            inside = parted[rows] >= 0
            return parted[rows][inside].astype(np.int64) * n + place[rows][inside] + 1

        kinds, cells = counted(pairs(rows) for rows in self.bands)
        piece = kinds // n
        order = np.lexsort((kinds, -cells, piece))
        largest = order[np.unique(piece[order], return_index=True)[1]]
        home = np.where(
            (cells * self.grid.resolution_m**2 >= self.rules.min_area_m2) & (kinds % n > 0),
            np.arange(len(kinds)),
            largest[piece],
        )
        used, number = np.unique(home, return_inverse=True)
        place = place.astype(np.promote_types(place.dtype, number_type(len(used))), copy=False)
        for rows in self.bands:
            both = pairs(rows)
            place[rows] = -1
            place[rows][parted[rows] >= 0] = number.reshape(-1)[np.searchsorted(kinds, both)]
        self.place, self.n_places = place, len(used)

    def relabel(self) -> None:
        """Give painted doorways outside gates another label of their place."""
        labels, painted, n_labels = self.labels.copy(), self.painted, len(self.names)
        counts = np.zeros(n_labels, np.int64)
        for rows in self.bands:
            labels[rows][painted[rows] | (self.gate[rows] >= 0)] = -1
            counts += np.bincount(labels[rows][labels[rows] >= 0], minlength=n_labels)
        grow(labels, painted, self.place)
        others = [k for k in range(n_labels) if k != self.doorway]
        most = max(others, key=lambda k: counts[k], default=self.doorway)
        for rows in self.bands:
            labels[rows][painted[rows] & (labels[rows] < 0)] = (
                most  # places with doorway labels only
            )
        self.labels = labels

    def keys(self, n_gates: int) -> tuple[NDArray[np.int32], list[str]]:
        """A key for each cell's place and label, gates last, and the name of each key."""
        k, n_places = len(self.names), self.n_places
        key = np.full(self.grid.shape, -1, np.int32)
        for rows in self.bands:
            place, gate = self.place[rows].astype(np.int32), self.gate[rows].astype(np.int32)
            np.copyto(key[rows], place * k + self.labels[rows], where=place >= 0)
            np.copyto(key[rows], gate + n_places * k, where=gate >= 0)
        return key, [*list(self.names) * n_places, *[self.names[self.doorway]] * n_gates]


def _on_free_cells(labels: NDArray[np.int16], grid: OccupancyGrid) -> NDArray[np.int16]:
    """(H, W) the labels, -1 on cells that are not free; copied only if that changes any."""
    for rows in bands_of_rows(labels.shape):
        if (labels[rows][~grid.free[rows]] >= 0).any():
            return np.where(grid.free, labels, np.int16(-1))
    return labels


def _painted_gates(labels: NDArray[np.int16], grid: OccupancyGrid, doorways: Doorways) -> Numbers:
    """(H, W) index of the gate at each labelled cell, -1 for none."""
    # Rectangles extend one cell into the walls and are thick enough that no diagonal step between
    # cells passes them.
    gate_at: Numbers = np.full(grid.shape, -1, number_type(len(doorways)))
    side = grid.resolution_m
    edge = 1e-6 * side  # cell centres on the edge of a rectangle are inside, for any heading
    for g in np.argsort(doorways.probability, kind="stable").tolist():
        gate = doorways.gates[g]
        thicker = max(0.75 * side - gate.depth_m / 2, 0.0)
        r, c = gate.cells(grid, wider_m=side + edge, deeper_m=thicker + edge).T
        inside = labels[r, c] >= 0
        gate_at[r[inside], c[inside]] = g
    return gate_at


def grow(
    values: NDArray[np.signedinteger],
    open_cells: NDArray[np.bool_],
    group: NDArray[np.signedinteger],
) -> None:
    """Grow values into open cells, ring by ring, within groups; the smallest neighbour wins.

    Values below 0 are empty; unreached cells are unchanged.
    """
    todo = np.argwhere(open_cells & (values < 0))
    none = np.iinfo(values.dtype).max
    while len(todo):
        best = np.full(len(todo), none, values.dtype)
        here = group[todo[:, 0], todo[:, 1]]
        for step in _NEIGHBOURS:
            r, c, near = _inside(todo + step, values.shape)
            near &= (values[r, c] >= 0) & (group[r, c] == here)
            best = np.where(near, np.minimum(best, values[r, c]), best)
        reached = todo[best < none]
        values[reached[:, 0], reached[:, 1]] = best[best < none]
        todo = _empty_around(reached, open_cells, values)


def _inside(
    cells: NDArray[np.int64], shape: tuple[int, ...]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Rows and columns of cells (n, 2), 0 outside the raster, and a mask of the cells inside."""
    r, c = cells.T
    inside = (r >= 0) & (c >= 0) & (r < shape[0]) & (c < shape[1])
    return np.where(inside, r, 0), np.where(inside, c, 0), inside


def _empty_around(
    reached: NDArray[np.int64], open_cells: NDArray[np.bool_], values: Numbers
) -> NDArray[np.int64]:
    """(n, 2) the open cells without a value next to some cells: the next ring."""
    neighbours = [reached + step for step in _NEIGHBOURS]
    r, c, inside = _inside(np.concatenate(neighbours), values.shape)
    inside &= open_cells[r, c] & (values[r, c] < 0)
    flat = np.unique(r[inside] * values.shape[1] + c[inside])
    return np.stack(np.divmod(flat, values.shape[1]), axis=1)


def _pieces(
    key: NDArray[np.int32],
    first_gate: int,
    n_labels: int,
    doorway: int,
    corrections: tuple[Correction, ...],
) -> GatePieces:
    """Connected cells of one key; all parts of a gate form one piece."""
    parts = connected_components(key)
    of_gate = parts.label >= first_gate
    alone = np.where(of_gate, parts.label, first_gate + np.arange(parts.count) + int(key.max()) + 1)
    _, first, piece_of = np.unique(alone, return_index=True, return_inverse=True)
    order = np.argsort(first)  # pieces are numbered in the order of their first cell
    number = np.empty(len(order), np.int32)
    number[order] = np.arange(len(order))
    number = number[piece_of.reshape(-1)]
    piece = parts.on_cells(number, -1, out=parts.piece)
    size = np.bincount(number, parts.size, len(order)).astype(np.int64)
    keys = parts.label[first[order]].astype(np.int64)
    gate = np.where(keys >= first_gate, keys - first_gate, -1)
    label = np.where(gate >= 0, doorway, keys % n_labels).astype(np.int32)
    return GatePieces(Components(piece, label, size), gate, corrections)
