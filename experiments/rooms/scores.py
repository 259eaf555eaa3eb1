"""How well rooms are found: recall and precision as published, F1 of matched rooms, doors."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.rooms.maps import LEAST_PIXELS
from pgm_places.errors import InputError
from pgm_places.maps.components import connected_components, squared_clearance

WIDEST_DOOR_M = 2.0
"""Wider borders between rooms are openings, not doors."""

NEAR_M = 0.5
"""A found doorway and a true door are the same where they come so near each other."""


@dataclass(frozen=True)
class RoomScores:
    """Figures of one map, from 0 to 1.

    Parameters
    ----------
    recall : float
        Mean over the true rooms of the share that the found room with the largest overlap covers.
    precision : float
        Mean over the found rooms of the share that lies in the true room with the largest overlap.
    f1 : float
        Of rooms that are matched: intersection over union above 0.5, which no room has with two.
    n_true, n_found : int
        Numbers of rooms.
    """

    recall: float
    precision: float
    f1: float
    n_true: int
    n_found: int


@dataclass(frozen=True)
class DoorCounts:
    """Doors of one map: true doors, recalled ones, found doors, correct ones.

    Parameters
    ----------
    n_true, n_recalled, n_found, n_right : int
    """

    n_true: int
    n_recalled: int
    n_found: int
    n_right: int


def score_rooms(true: NDArray[np.int32], found: NDArray[np.int32]) -> RoomScores:
    """The figures of rooms (H, W) numbered from 0, -1 for none; those of 100 cells are left out.

    Recall and precision are the average of individual ones of Bormann et al.

    Examples
    --------
    >>> true = np.repeat([[0, 1]], 200, axis=1).reshape(4, 100).astype(np.int32)
    >>> score_rooms(true, np.zeros_like(true))
    RoomScores(recall=1.0, precision=0.5, f1=0.0, n_true=2, n_found=1)
    """
    if true.shape != found.shape:
        raise InputError(f"true rooms have {true.shape} cells, found ones {found.shape}")
    n_true, n_found = int(true.max(initial=-1)) + 1, int(found.max(initial=-1)) + 1
    both = (true >= 0) & (found >= 0)
    pairs = true[both].astype(np.int64) * n_found + found[both]
    overlap = np.bincount(pairs, minlength=n_true * n_found).reshape(n_true, n_found)
    true_size = np.bincount(true[true >= 0], minlength=n_true)
    found_size = np.bincount(found[found >= 0], minlength=n_found)
    rows, columns = true_size >= LEAST_PIXELS, found_size >= LEAST_PIXELS
    overlap, true_size, found_size = overlap[rows][:, columns], true_size[rows], found_size[columns]
    if not overlap.size:
        return RoomScores(0.0, 0.0, 0.0, len(true_size), len(found_size))
    union = true_size[:, None] + found_size - overlap
    n_matched = int((2 * overlap > union).sum())
    return RoomScores(
        float((overlap.max(axis=1) / true_size).mean()),
        float((overlap.max(axis=0) / found_size).mean()),
        2 * n_matched / (len(true_size) + len(found_size)),
        len(true_size),
        len(found_size),
    )


def score_doors(
    rooms: NDArray[np.int32],
    free: NDArray[np.bool_],
    doorways: NDArray[np.int32],
    resolution_m: float,
) -> DoorCounts:
    """The doors of a map: free space between true rooms, at most 2 m long, is a true one.

    Parameters
    ----------
    rooms : (H, W) int32
        True rooms, -1 for none.
    free : (H, W) bool
        Free space of the map.
    doorways : (H, W) int32
        Found doorways numbered from 0, -1 for none.
    resolution_m : float
    """
    doors = _doors(rooms, free, resolution_m)
    n_true, n_found = int(doors.max(initial=-1)) + 1, int(doorways.max(initial=-1)) + 1
    return DoorCounts(
        n_true,
        _near(doors, n_true, doorways >= 0, resolution_m),
        n_found,
        _near(doorways, n_found, doors >= 0, resolution_m),
    )


def _doors(
    rooms: NDArray[np.int32], free: NDArray[np.bool_], resolution_m: float
) -> NDArray[np.int32]:
    """(H, W) number of the true door that each cell is in, -1 for none."""
    pieces = connected_components(free & (rooms < 0))
    found = np.full(rooms.shape, -1, np.int32)
    count = 0
    framed = np.pad(rooms, 1, constant_values=-1)
    for k, (rows, columns) in enumerate(pieces.windows()):
        sides = rows.stop - rows.start, columns.stop - columns.start
        if np.hypot(*sides) * resolution_m > WIDEST_DOOR_M:
            continue
        inside = pieces.piece[rows, columns] == k
        around = framed[rows.start : rows.stop + 2, columns.start : columns.stop + 2]
        touched = set()
        for dr in range(3):
            for dc in range(3):
                shifted = around[dr : dr + sides[0], dc : dc + sides[1]]
                touched |= set(np.unique(shifted[inside]).tolist())
        if len(touched - {-1}) >= 2:
            found[rows, columns][inside] = count
            count += 1
    return found


def _near(
    pieces: NDArray[np.int32], count: int, others: NDArray[np.bool_], resolution_m: float
) -> int:
    """How many pieces come near one of the others."""
    if not count or not others.any():
        return 0
    margin = int(NEAR_M / resolution_m) + 2  # beyond the raster all counts as one of the others
    away = squared_clearance(np.pad(others, margin))[margin:-margin, margin:-margin]
    nearest = np.full(count, np.iinfo(np.int32).max, np.int32)
    np.minimum.at(nearest, pieces[pieces >= 0], away[pieces >= 0])
    return int((np.sqrt(nearest) * resolution_m <= NEAR_M).sum())
