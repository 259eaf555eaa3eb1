"""Corrections beyond the paper's: too wide or leaking doorways, and rooms to be split."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.topology.borders import contacts
from pgm_places.topology.chords import Chord, has_short_chord, shortest_chords
from pgm_places.topology.clearance import squared_clearance
from pgm_places.topology.components import Components, connected_components
from pgm_places.topology.corrections import Correction, CorrectionRules

__all__ = ["Split", "close_leaks", "find_splits", "split_rooms", "trim_doorways"]

DOORWAY_DEPTH_M = 0.3
"""Depth of a doorway drawn across a passage, within the range of hand-made labels."""

LEAST_RATIO = 1.2
"""The parts on both sides of a narrow passage are wider by at least this factor."""

NEAR_M = 0.2
"""Chords through cells up to this far from a saddle are tried as well."""

MOST_SADDLES = 100_000
EIGHT = np.ones((3, 3), bool)


@dataclass(frozen=True, eq=False)
class Split:
    """A place where a doorway could split a region in two.

    Parameters
    ----------
    chord : Chord
        From wall to wall across the narrowest point.
    cells : (n, 2) int64
        Row and column of the cells that would be the doorway.
    label : int
        Label of the region.
    areas_m2 : (float, float)
        Areas of the larger and the smaller part.
    """

    chord: Chord
    cells: NDArray[np.int64]
    label: int
    areas_m2: tuple[float, float]


def trim_doorways(
    labels: NDArray[np.int16],
    clearance: NDArray[np.int32],
    label_names: Sequence[str],
    resolution_m: float,
    rules: CorrectionRules,
) -> tuple[NDArray[np.int16], list[Correction]]:
    """The labels without doorway cells where a disc of ``widest_doorway_m`` fits, and the changes.

    These cells are in a room or a corridor: a morphological opening of free space keeps them, and
    no line from wall to wall through them is that short. Each connected piece takes the label of
    the non-doorway region with which it shares the longest border; without one, it is unchanged.

    Parameters
    ----------
    labels : (H, W) int16
    clearance : (H, W) int32
        Squared distance in cells to the nearest cell that is not free.
    label_names : sequence of str
    resolution_m : float
    rules : CorrectionRules
    """
    doorway = _doorway(label_names, rules)
    widest = min(rules.widest_doorway_m / resolution_m, float(sum(labels.shape)))
    centres = 2 * np.sqrt(clearance) - 1 > widest
    wide = (labels == doorway) & (squared_clearance(centres) <= (widest / 2) ** 2)
    cells = np.argwhere(wide)
    # A disc in a room bulges into an opening in a thin wall, where the passage is still narrow.
    narrow = cells[has_short_chord(labels < 0, cells, widest)]
    wide[narrow[:, 0], narrow[:, 1]] = False
    marked = labels.copy()
    marked[wide] = len(label_names)
    pieces = connected_components(marked)
    length = contacts(pieces.piece, pieces.count).matrix(pieces.count)
    table = np.append(pieces.label, np.int16(-1))
    cells_of = _cells_of_pieces(pieces, pieces.label == len(label_names))
    log = []
    for number, members in cells_of.items():
        around = length[[number]]
        others = [
            (-float(share), int(other))
            for share, other in zip(around.data, around.indices, strict=True)
            if pieces.label[other] not in (doorway, len(label_names))
        ]
        table[number] = pieces.label[min(others)[1]] if others else doorway
        if others:
            became = label_names[table[number]]
            log.append(_entry(members, resolution_m, rules.doorway_label, became, "too wide"))
    return table[pieces.piece].astype(np.int16, copy=False), log


def close_leaks(
    labels: NDArray[np.int16],
    label_names: Sequence[str],
    resolution_m: float,
    rules: CorrectionRules,
) -> tuple[NDArray[np.int16], list[Correction]]:
    """The labels with doorways extended to close the gaps beside them, and the changes.

    A chord from wall to wall through a cell of a doorway becomes part of it if the chord is at most
    ``close_leaks_m`` long and divides the region that leaks past the doorway into two parts of at
    least ``min_part_m2``.
    """
    doorway = _doorway(label_names, rules)
    doors = connected_components(np.where(labels == doorway, labels, np.int16(-1)))
    parting = _Parting(labels, doorway, resolution_m, rules.min_part_m2)
    longest = rules.close_leaks_m / resolution_m
    blocked = labels < 0
    log = []
    for cells in _cells_of_pieces(doors, np.ones(doors.count, np.bool_)).values():
        split = parting.split(shortest_chords(blocked, cells, longest))
        if split is not None:
            log.append(_filled(split, label_names, resolution_m, rules, "leak"))
    return parting.labels, log


def find_splits(
    labels: NDArray[np.int16],
    clearance: NDArray[np.int32],
    label_names: Sequence[str],
    resolution_m: float,
    rules: CorrectionRules,
) -> list[Split]:
    """Where regions other than doorways are narrow between two wide parts, widest part first.

    A candidate is a saddle of the clearance, at most ``split_rooms_m`` wide, between two peaks at
    least 1.2 times as wide. It counts if a nearby chord from wall to wall, no longer than that,
    divides the region into two parts of at least ``min_part_m2`` each. Each split is found as if
    the previous ones had been made.
    """
    return _splits(labels, clearance, label_names, resolution_m, rules)[0]


def _splits(
    labels: NDArray[np.int16],
    clearance: NDArray[np.int32],
    label_names: Sequence[str],
    resolution_m: float,
    rules: CorrectionRules,
) -> tuple[list[Split], NDArray[np.int16]]:
    """The splits, and the labels with a doorway in each."""
    from pgm_places.topology._refinement_kernels import find_saddles

    doorway = _doorway(label_names, rules)
    parting = _Parting(labels, doorway, resolution_m, rules.min_part_m2)
    piece = parting.pieces.piece
    inside = np.flatnonzero(piece >= 0)
    order = inside[np.argsort(-clearance.ravel()[inside], kind="stable")]
    # No passage is wider than the map; beyond, the square would be more than an integer holds.
    longest = min(rules.split_rooms_m / resolution_m, float(sum(labels.shape)))
    widest = int(((longest + 1) / 2) ** 2)
    saddles = np.empty(MOST_SADDLES, np.int64)
    parent = np.full(labels.size, -1, np.int32)
    count = find_saddles(piece, clearance, order, widest, LEAST_RATIO**2, parent, saddles)
    blocked = labels < 0
    found = []
    for cell in saddles[: min(count, MOST_SADDLES)].tolist():
        near = _around(divmod(cell, labels.shape[1]), piece, resolution_m)
        split = parting.split(shortest_chords(blocked, near, longest))
        if split is not None:
            found.append(split)
    return found, parting.labels


def split_rooms(
    labels: NDArray[np.int16],
    clearance: NDArray[np.int32],
    label_names: Sequence[str],
    resolution_m: float,
    rules: CorrectionRules,
) -> tuple[NDArray[np.int16], list[Correction]]:
    """The labels with a doorway across every passage that ``find_splits`` finds, and the changes.

    The paper's Fig. 9 has two rooms joined because the doorway between them was not recognised.
    """
    found, changed = _splits(labels, clearance, label_names, resolution_m, rules)
    return changed, [
        _filled(split, label_names, resolution_m, rules, "narrow passage") for split in found
    ]


def _doorway(label_names: Sequence[str], rules: CorrectionRules) -> int:
    if rules.doorway_label not in label_names:
        raise InputError(
            f"correcting doorways needs the label {rules.doorway_label!r}, got "
            f"{', '.join(label_names)}; set doorway_label to yours"
        )
    return list(label_names).index(rules.doorway_label)


def _around(
    cell: tuple[int, int], piece: NDArray[np.int32], resolution_m: float
) -> NDArray[np.int64]:
    """(n, 2) the cells of a cell's piece within ``NEAR_M`` in rows and columns."""
    reach = round(NEAR_M / resolution_m)
    row, column = cell
    low = max(0, row - reach), max(0, column - reach)
    near = piece[low[0] : row + reach + 1, low[1] : column + reach + 1] == piece[row, column]
    return np.argwhere(near) + np.array(low)


class _Parting:
    """Labels that doorways are drawn into if they split a region in two."""

    def __init__(
        self, labels: NDArray[np.int16], doorway: int, resolution_m: float, min_part_m2: float
    ) -> None:
        from scipy.ndimage import find_objects

        self.labels, self.doorway = labels.copy(), doorway
        self.resolution_m, self.min_part_m2 = resolution_m, min_part_m2
        self.pieces = connected_components(np.where(labels == doorway, np.int16(-1), labels))
        self.windows = find_objects(self.pieces.piece + 1)

    def split(self, chords: Sequence[Chord]) -> Split | None:
        """Draw a doorway along the first chord that splits a region; None if none does."""
        for chord in chords:
            split = self._along(chord)
            if split is not None:
                self.labels[split.cells[:, 0], split.cells[:, 1]] = self.doorway
                return split
        return None

    def _along(self, chord: Chord) -> Split | None:
        cells = self._gap(chord)
        cells = cells[self.labels[cells[:, 0], cells[:, 1]] != self.doorway]
        if not len(cells):
            return None
        numbers, counts = np.unique(self.pieces.piece[cells[:, 0], cells[:, 1]], return_counts=True)
        number = int(numbers[counts.argmax()])
        areas = self._areas_m2(number, cells)
        if len(areas) < 2 or areas[1] < self.min_part_m2:
            return None
        return Split(chord, cells, int(self.pieces.label[number]), (areas[0], areas[1]))

    def _areas_m2(self, number: int, cells: NDArray[np.int64]) -> list[float]:
        """Areas of the parts adjacent to the cells once these are removed, largest first."""
        from scipy.ndimage import label as components

        rows, columns = self.windows[number]
        left = self.pieces.piece[rows, columns] == number
        left &= self.labels[rows, columns] != self.doorway  # drawn earlier
        taken = np.zeros_like(left)
        local = cells - np.array([rows.start, columns.start])
        local = local[((local >= 0) & (local < left.shape)).all(axis=1)]
        taken[local[:, 0], local[:, 1]] = True
        parts, _ = components(left & ~taken, EIGHT)
        touching = np.unique(parts[_grown(taken)])
        sizes = np.bincount(parts.ravel())[touching[touching > 0]]
        areas: list[float] = (np.sort(sizes)[::-1] * self.resolution_m**2).tolist()
        return areas

    def _gap(self, chord: Chord) -> NDArray[np.int64]:
        """(n, 2) the labelled cells near a chord that are connected to its middle."""
        from scipy.ndimage import label as components

        # With 0.75 cells on both sides, no step between cells, even a diagonal one, crosses it.
        reach = max(0.75, DOORWAY_DEPTH_M / self.resolution_m / 2)
        rows, columns, near = chord.band(reach, self.labels.shape)
        near &= self.labels[rows, columns] >= 0
        corner = np.array([rows.start, columns.start])
        cells = np.argwhere(near)
        if not len(cells):
            return cells
        parts, _ = components(near, EIGHT)
        home = cells[((cells + corner - chord.middle) ** 2).sum(axis=1).argmin()]
        return np.argwhere(parts == parts[tuple(home)]) + corner


def _grown(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The cells and their eight neighbours."""
    from scipy.ndimage import binary_dilation

    grown: NDArray[np.bool_] = binary_dilation(mask, EIGHT)
    return grown


def _cells_of_pieces(pieces: Components, wanted: NDArray[np.bool_]) -> dict[int, NDArray[np.int64]]:
    """(n, 2) row and column of the cells of each wanted piece, by its number."""
    from scipy.ndimage import find_objects

    found = {}
    for number, (rows, columns) in enumerate(find_objects(pieces.piece + 1)):
        if wanted[number]:
            inside = pieces.piece[rows, columns] == number
            found[number] = np.argwhere(inside) + np.array([rows.start, columns.start])
    return found


def _filled(
    split: Split,
    label_names: Sequence[str],
    resolution_m: float,
    rules: CorrectionRules,
    reason: str,
) -> Correction:
    return _entry(split.cells, resolution_m, label_names[split.label], rules.doorway_label, reason)


def _entry(
    cells: NDArray[np.int64], resolution_m: float, was: str, became: str, reason: str
) -> Correction:
    row, column = cells[0].tolist()
    return Correction((row, column), len(cells) * resolution_m**2, was, became, reason)
