"""Corrections beyond the paper's: too wide or leaking doorways, and rooms to be split."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.maps.components import Components, connected_components
from pgm_places.topology.borders import contacts
from pgm_places.topology.chords import has_short_chord
from pgm_places.topology.clearance import squared_clearance
from pgm_places.topology.corrections import Correction, CorrectionRules
from pgm_places.topology.parting import Parting, Split

__all__ = ["close_leaks", "find_splits", "split_rooms", "trim_doorways"]

MOST_SADDLES = 100_000
CELLS_AT_ONCE = 1_000_000
"""Cells around saddles that are listed at a time."""

LEAST_RATIO = 1.2
"""The parts on both sides of a narrow passage are wider by at least this factor."""

NEAR_M = 0.2
"""Chords through cells up to this far from a saddle are tried as well."""


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
    became = pieces.label.astype(np.int16)
    wanted = pieces.label == len(label_names)
    members, start = _cells_of_pieces(pieces, wanted)
    log = []
    for k, number in enumerate(np.flatnonzero(wanted).tolist()):
        around = slice(*length.indptr[number : number + 2].tolist())
        others = [
            (-float(share), int(other))
            for share, other in zip(length.data[around], length.indices[around], strict=True)
            if pieces.label[other] not in (doorway, len(label_names))
        ]
        became[number] = pieces.label[min(others)[1]] if others else doorway
        if others:
            first = divmod(int(members[start[k]]), labels.shape[1])
            area_m2 = int(pieces.size[number]) * resolution_m**2
            name = label_names[became[number]]
            log.append(Correction(first, area_m2, rules.doorway_label, name, "too wide"))
    return pieces.on_cells(became, -1), log


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
    parting = Parting(labels, doorway, resolution_m, rules.min_part_m2)
    cells, start = _cells_of_pieces(doors, np.ones(doors.count, np.bool_))
    splits = parting.draw(cells, start, rules.close_leaks_m / resolution_m)
    log = [_filled(split, label_names, resolution_m, rules, "leak") for split in splits]
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
    parting = Parting(labels, doorway, resolution_m, rules.min_part_m2)
    piece = parting.pieces.piece
    inside = np.flatnonzero(piece >= 0)
    order = inside[np.argsort(-clearance.ravel()[inside], kind="stable")]
    # No passage is wider than the map; beyond, the square would be more than an integer holds.
    longest = min(rules.split_rooms_m / resolution_m, float(sum(labels.shape)))
    widest = int(((longest + 1) / 2) ** 2)
    saddles = np.empty(MOST_SADDLES, np.int64)
    parent = np.full(labels.size, -1, np.int32)
    count = find_saddles(piece, clearance, order, widest, LEAST_RATIO**2, parent, saddles)
    reach = round(NEAR_M / resolution_m)
    at_once = max(1, CELLS_AT_ONCE // (2 * reach + 1) ** 2)
    found = []
    for first in range(0, min(count, MOST_SADDLES), at_once):
        some = saddles[first : min(first + at_once, count)]
        found += parting.draw(*_around(some, piece, reach), longest)
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
    centres: NDArray[np.int64], piece: NDArray[np.int32], reach: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The cells of each centre's piece up to ``reach`` rows and columns away, and where they begin.

    Cells are numbered row by row, and so are those of each centre ordered.
    """
    height, width = piece.shape
    steps = np.arange(-reach, reach + 1)
    rows = (centres // width)[:, None, None] + steps[:, None]
    columns = (centres % width)[:, None, None] + steps
    near = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    cells = np.where(near, rows * width + columns, 0)
    near &= piece.ravel()[cells] == piece.ravel()[centres][:, None, None]
    return cells[near], np.append(0, np.cumsum(near.sum(axis=(1, 2))))


def _cells_of_pieces(
    pieces: Components, wanted: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The cells of each wanted piece, numbered row by row, and where each one's begin."""
    numbers = np.append(wanted, False)[pieces.piece].ravel()  # the last is for cells without one
    cells = np.flatnonzero(numbers)
    numbers = pieces.piece.ravel()[cells]
    cells = cells[np.argsort(numbers, kind="stable")]
    return cells, np.append(0, np.cumsum(pieces.size[wanted]))


def _filled(
    split: Split,
    label_names: Sequence[str],
    resolution_m: float,
    rules: CorrectionRules,
    reason: str,
) -> Correction:
    row, column = split.cells[0].tolist()
    area_m2 = len(split.cells) * resolution_m**2
    was = label_names[split.label]
    return Correction((row, column), area_m2, was, rules.doorway_label, reason)
