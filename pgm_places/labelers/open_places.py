"""Open places that scores see half as corridor and half as room, decided as a whole."""

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import row_blocks
from pgm_places.graph.layout import GridLayout
from pgm_places.maps.clearance import squared_clearance
from pgm_places.maps.occupancy_grid import OccupancyGrid

_PAIR = ("corridor", "room")

_LEAST_SHARE = 0.25
"""Where less of a place has the other label, that part is nearly always right: a corridor that
ends in a room. Chosen on the robots' maps of the training (docs/notes/tried.md)."""

_ROOM_LOG_ODDS = 2.0
"""What must speak for a corridor as a whole: open floor that is seen as both is mostly a room, and
maps of one floor agree better."""

_LEAST_RADIUS_M = 1.5
"""In narrower places corridor and room differ in width, and a border has its reason."""


def with_open_places_decided(
    log_z: NDArray[np.float64],
    place: NDArray[np.integer],
    layout: GridLayout,
    label_names: tuple[str, ...],
    known: NDArray[np.int64] | None = None,
) -> NDArray[np.float64]:
    """The scores, those of an open place that is seen as both corridor and room made the same.

    Where nothing divides a space, no border between corridor and room runs through it. If at least
    a quarter of a place between doorways is rather corridor and at least a quarter rather room, and
    a disc of 3 m fits in it, each of its cells gets the median of their log-odds, less 2 for a
    corridor; what speaks for a doorway stays.

    Parameters
    ----------
    log_z : (N, K) float
        Log-probabilities; the array itself comes back where nothing changes.
    place : (N,) int
        The place between doorways that each cell is in, -1 for none.
    layout : GridLayout
        Of the N cells.
    label_names : tuple of K str
        Without both corridor and room among them nothing changes.
    known : (N,) int, optional
        Labels of the cells that are known, -1 elsewhere. A place with known cells of one of both
        labels has this label as a whole; one with known cells of both is left alone.
    """
    if not set(_PAIR) <= set(label_names):
        return log_z
    corridor, room = (label_names.index(name) for name in _PAIR)
    label = np.empty(len(log_z), np.int16)
    for some in row_blocks(len(log_z)):
        label[some] = log_z[some].argmax(axis=1)
    n_places = int(place.max(initial=-1)) + 1
    n_corridor, n_room = (
        np.bincount(place[(label == k) & (place >= 0)], minlength=n_places)
        for k in (corridor, room)
    )
    is_mixed = np.minimum(n_corridor, n_room) >= _LEAST_SHARE * (n_corridor + n_room)
    decided = log_z
    for number in np.flatnonzero(is_mixed & (n_corridor > 0)).tolist():
        nodes = np.flatnonzero(place == number)
        if not _is_open(layout.cells[nodes], layout):
            continue
        nodes = nodes[(label[nodes] == corridor) | (label[nodes] == room)]
        odds = float(np.median(log_z[nodes, corridor] - log_z[nodes, room])) - _ROOM_LOG_ODDS
        if known is not None:
            said = np.unique(known[nodes[known[nodes] >= 0]]).tolist()
            if len(said) > 1:
                continue
            if said and (said[0] == corridor) != (odds > 0):
                odds = -odds
        decided = log_z.copy() if decided is log_z else decided
        both = np.logaddexp(log_z[nodes, corridor], log_z[nodes, room])
        decided[nodes, corridor] = both - np.logaddexp(0.0, -odds)
        decided[nodes, room] = both - np.logaddexp(0.0, odds)
    return decided


def _is_open(cells: NDArray[np.integer], layout: GridLayout) -> bool:
    """Whether a disc of that radius fits between these cells (n, 2)."""
    assert isinstance(layout.source, OccupancyGrid)  # places are those of a map
    first = cells.min(axis=0) - 1
    outside = np.ones(cells.max(axis=0) - first + 2, np.bool_)
    outside[tuple((cells - first).T)] = False
    radius_m = np.sqrt(squared_clearance(outside).max()) * layout.source.resolution_m
    return bool(radius_m >= _LEAST_RADIUS_M)
