"""Persistent ids and names: places are recognised by their position, new ones get new ids."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import LabelError
from pgm_places.graph.bands import bands_of_rows, counted
from pgm_places.maps.components import Components
from pgm_places.maps.occupancy_grid import OccupancyGrid, at_cells

SAME_PLACE = 0.25
"""Smallest intersection over union of areas at which a place keeps its id."""

ROW_M = 3.0
"""Places whose anchors differ by less than this in y count as one row when numbering."""


class EarlierPlaces(Protocol):
    """Places of before, by which those of a map are recognised."""

    @property
    def names(self) -> Mapping[int, str]:
        """The name of every id."""
        ...

    @property
    def anchors_m(self) -> Mapping[int, tuple[float, float]]:
        """Where each place is anchored: it stays there as long as that is inside the place."""
        ...

    def identify(
        self,
        pieces: Components,
        grid: OccupancyGrid,
        label_names: Sequence[str],
        doorway_label: str = "doorway",
    ) -> tuple[list[int], int]:
        """An id per piece, and the next unused id."""
        ...


@dataclass(frozen=True, eq=False)
class KnownPlaces:
    """Places of an earlier run, used to recognise the same places again.

    Parameters
    ----------
    grid : OccupancyGrid
        The earlier map; only its frame is used.
    region : (H, W) int32
        Id of the place at each cell, 0 for none.
    labels, names : mappings of int to str
        Class and name of each id.
    next_id : int
        The first id that has never been used.
    anchors_m : mapping of int to (float, float)
        Where each place is anchored: it stays there as long as that is inside the place.
    """

    grid: OccupancyGrid
    region: NDArray[np.int32]
    labels: Mapping[int, str]
    names: Mapping[int, str]
    next_id: int
    anchors_m: Mapping[int, tuple[float, float]] = field(default_factory=dict)

    def identify(
        self,
        pieces: Components,
        grid: OccupancyGrid,
        label_names: Sequence[str],
        doorway_label: str = "doorway",
    ) -> tuple[list[int], int]:
        """An id per piece, and the next unused id.

        A piece takes the id of the known place of the same class with which it shares most of
        their common area, if that is at least a quarter; each id goes to one piece. The others are
        numbered on from ``next_id`` in reading order, doorways after all others. Maps may differ
        in size, resolution and origin, as long as their frames agree.
        """
        ids, taken = [0] * pieces.count, set()
        for _, piece, place in sorted(_overlaps(pieces, grid, label_names, self)):
            if not ids[piece] and place not in taken:
                ids[piece] = place
                taken.add(place)
        return number_on(ids, self.next_id, pieces, grid, label_names, doorway_label)


def number_on(
    ids: list[int],
    next_id: int,
    pieces: Components,
    grid: OccupancyGrid,
    label_names: Sequence[str],
    doorway_label: str,
) -> tuple[list[int], int]:
    """The ids with those that are 0 replaced by new ones from ``next_id``, and the next unused one.

    They are given from top to bottom and from left to right, doorways last: the numbers of rooms
    and corridors on a map are not interrupted by those of the doors between them.
    """
    is_doorway = np.array([label_names[label] == doorway_label for label in pieces.label], np.bool_)
    order = reading_order(pieces, grid)
    found = list(ids)
    for piece in [*order[~is_doorway[order]].tolist(), *order[is_doorway[order]].tolist()]:
        if not found[piece]:
            found[piece] = next_id
            next_id += 1
    return found, next_id


def _overlaps(
    pieces: Components, grid: OccupancyGrid, label_names: Sequence[str], known: KnownPlaces
) -> list[tuple[float, int, int]]:
    """Pieces and places that may be the same, best match first: (-share, piece, place)."""
    n_places = int(known.region.max(initial=0)) + 1
    height, width = known.grid.shape
    bands = [*bands_of_rows((height, 4 * width))]  # positions take much more than cells
    keys, counts = counted(_shared_cells(pieces, grid, known, rows, n_places) for rows in bands)
    old_cells = np.zeros(n_places, np.int64)
    for rows in bands:
        old_cells += np.bincount(known.region[rows].ravel(), minlength=n_places)
    old_m2 = old_cells * known.grid.resolution_m**2
    new_m2 = pieces.size * grid.resolution_m**2
    found = []
    for key, count in zip(keys.tolist(), counts.tolist(), strict=True):
        new, old = divmod(key, n_places)
        if label_names[pieces.label[new]] != known.labels.get(old):
            continue
        common = count * known.grid.resolution_m**2
        share = common / (new_m2[new] + old_m2[old] - common)
        if share >= SAME_PLACE:
            found.append((-float(share), new, old))
    return found


def _shared_cells(
    pieces: Components, grid: OccupancyGrid, known: KnownPlaces, rows: slice, n_places: int
) -> NDArray[np.int64]:
    """(n,) ``piece n_places + place`` of the cells of a band of the earlier map that have both."""
    cells = np.argwhere(known.region[rows] > 0)
    cells[:, 0] += rows.start
    there = grid.cells_at_m(known.grid.cell_centres_m(cells))
    piece = at_cells(pieces.piece, there, -1).astype(np.int64)
    place = known.region[tuple(cells.T)]
    return (piece * n_places + place)[piece >= 0]


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
    """A name per place: the user's name, else the one it had, else its class and its id.

    A place is known by one number: names such as ``"room 3"`` that places had from earlier runs
    give way to their class and id.

    Parameters
    ----------
    ids, labels : sequences
        Id and class of each place.
    known : mapping of int to str
        Names from an earlier run.
    own : mapping of int to str
        The user's names.

    Raises
    ------
    LabelError
        Two places have the same name.

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
        if numbered in own.values():  # the user calls another place so
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
