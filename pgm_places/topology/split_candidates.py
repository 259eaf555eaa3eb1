"""Places that look like several rooms, for a person to decide on: doorways that were missed."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from pgm_places.errors import InputError
from pgm_places.maps.clearance import squared_clearance
from pgm_places.topology.cuts import Line, cut_along, has_jambs, line_width_m, opening_cuts
from pgm_places.topology.regions import Region
from pgm_places.topology.topological_map import TopologicalMap

WIDEST_M, DEEPEST_M = 1.9, 0.75
"""Wider openings without jambs are parts of a room; what is narrow for longer than any wall is
thick lies between a wall and a bed, or a counter."""

DOOR_WIDTH_M, DOOR_DEPTH_M = 1.2, 0.55
"""Openings up to this size are doors even where a room is hardly broader."""

CASED_WIDTH_M = 2.5
"""So are single openings up to this width between jambs, as those between the rooms of homes."""

LEAST_PART_M2 = 4.0
"""What is smaller is a niche, or lies between furniture."""

DOOR_SHARE, OTHER_SHARE = 1.15, 0.75
"""The opening is narrower than this times the breadth of what lies on either side of it."""

CIRCULATION = ("corridor", "hall")
"""Long and winding by nature: they narrow at each joint, and are one place nonetheless."""

_FOUND: WeakKeyDictionary[TopologicalMap, tuple["SplitCandidate", ...]] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class SplitCandidate:
    """A place that looks like several, and where it would be split.

    Parameters
    ----------
    place : Region
    lines_m : tuple of ((float, float), (float, float))
        Ends of the lines across its openings, in the map frame.
    areas_m2 : tuple of float
        Of the parts between them, descending.
    """

    place: Region
    lines_m: tuple[Line, ...]
    areas_m2: tuple[float, ...]

    @property
    def count(self) -> int:
        """How many rooms it looks like."""
        return len(self.areas_m2)


def split_candidates(topology: TopologicalMap) -> tuple[SplitCandidate, ...]:
    """The places that look like several rooms, by their ids.

    An opening parts rooms if it is no wider than 1.9 m and no deeper than a thick wall (0.75 m),
    leaves at least 4 m² on either side, and is narrow for what lies there: narrower than 0.75 of
    four times the mean clearance, which is the width of a strip, or than 1.15 of it where the
    opening has the size of a door, 1.2 m and 0.55 m deep. A cased opening, a single one up to 2.5 m
    wide and 0.55 m deep between jambs, counts like a door. Two or three openings between the same
    two parts count as one. Corridors and halls, which narrow at each joint, are left out, as are
    doorways.

    Examples
    --------
    >>> from pgm_places import OccupancyGrid
    >>> from pgm_places.topology.from_labels import topological_map
    >>> cells = np.zeros((20, 42), np.int8)
    >>> cells[:, 20:22], cells[8:12, 20:22] = 100, 0  # two rooms, a wall, a door of 0.8 m
    >>> grid = OccupancyGrid(cells, resolution_m=0.2)
    >>> found = topological_map(grid, np.where(cells == 0, 0, -1), ["room"])
    >>> [(item.place.name, item.count) for item in split_candidates(found)]
    [('room 1', 2)]
    """
    if topology not in _FOUND:
        _FOUND[topology] = tuple(_looked_for(topology))
    return _FOUND[topology]


def _looked_for(topology: TopologicalMap) -> Iterator[SplitCandidate]:
    for place in topology.regions:
        if place.label in (topology.doorway_label, *CIRCULATION):
            continue
        if place.area_m2 >= 2 * LEAST_PART_M2:
            lines = _accepted(topology, place)
            if lines:
                areas_m2 = cut_along(topology, place, lines).area_m2
                yield SplitCandidate(place, lines, tuple(areas_m2.tolist()))


def _accepted(topology: TopologicalMap, place: Region) -> tuple[Line, ...]:
    """The lines of all cuts that part rooms; where two overlap, those of the narrower one."""
    cuts = [
        cut
        for cut, depth_m in opening_cuts(topology, place, CASED_WIDTH_M)
        if depth_m <= DEEPEST_M and _parts_rooms(topology, place, cut, depth_m)
    ]
    chosen: tuple[Line, ...] = ()
    for cut in sorted(cuts, key=lambda lines: sum(map(line_width_m, lines))):
        more = tuple(dict.fromkeys((*chosen, *cut)))
        n_before = len(cut_along(topology, place, chosen)) if chosen else 1
        areas_m2 = cut_along(topology, place, more).area_m2
        if len(areas_m2) > n_before and areas_m2[-1] >= LEAST_PART_M2:
            chosen = more
    return chosen


def _parts_rooms(
    topology: TopologicalMap, place: Region, cut: tuple[Line, ...], depth_m: float
) -> bool:
    """Whether both sides of a cut are large enough, and broad for its widest line."""
    parts = cut_along(topology, place, cut)
    if len(parts) < 2 or parts.area_m2[-1] < LEAST_PART_M2:
        return False
    rows, columns = topology.window(place.id)
    squared = squared_clearance(topology.region[rows, columns] != place.id)
    inside = parts.cells - (rows.start, columns.start)
    clearance_m = np.sqrt(squared[tuple(inside.T)]) * topology.grid.resolution_m
    breadth_m = 4 * np.bincount(parts.number, clearance_m) / np.bincount(parts.number)
    width_m = max(map(line_width_m, cut))
    share = width_m / float(breadth_m.min())
    if width_m <= WIDEST_M and share <= OTHER_SHARE:
        return True
    has_door_size = width_m <= DOOR_WIDTH_M or (
        len(cut) == 1 and has_jambs(topology, place, cut[0])
    )
    return depth_m <= DOOR_DEPTH_M and share <= DOOR_SHARE and has_door_size


def propose_splits(
    topology: TopologicalMap, narrower_than_m: float, *, min_part_m2: float = 4.0
) -> list[SplitCandidate]:
    """Openings that divide places, except doorways, alone or two or three together.

    Those are the narrow openings between segments of open space that no doorway fills. Single ones
    come first, then by the area of the smaller part. Lines that divide a place only together, such
    as two doors between the same two rooms, are one proposal.

    Parameters
    ----------
    topology : TopologicalMap
    narrower_than_m : float
        Widest opening to list, from wall to wall; those between offices are up to 1.5 m wide.
    min_part_m2 : float
        Minimum area of either part.

    Raises
    ------
    InputError
        A width that is not positive.
    """
    if not narrower_than_m > 0:
        raise InputError(
            f"narrower_than_m must be a positive length in metres, got {narrower_than_m}"
        )
    proposals = []
    for place in topology.regions:
        if place.label == topology.doorway_label or place.area_m2 < 2 * min_part_m2:
            continue
        for lines, _ in opening_cuts(topology, place, narrower_than_m):
            larger, smaller = _parts_m2(topology, place, lines)
            fewer = [[*lines[:k], *lines[k + 1 :]] for k in range(len(lines)) if len(lines) > 1]
            alone = max((_parts_m2(topology, place, some)[1] for some in fewer), default=0.0)
            if smaller >= min_part_m2 > alone:
                proposals.append(SplitCandidate(place, lines, (larger, smaller)))
    return sorted(proposals, key=lambda split: (len(split.lines_m), -split.areas_m2[1]))


def _parts_m2(
    topology: TopologicalMap, place: Region, lines: Sequence[Line]
) -> tuple[float, float]:
    """Areas of the two largest parts between lines, 0 where there is no second."""
    areas_m2 = [*cut_along(topology, place, lines).area_m2.tolist(), 0.0]
    return areas_m2[0], areas_m2[1]
