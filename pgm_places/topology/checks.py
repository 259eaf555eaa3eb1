"""Checks: places that are likely to be labelled wrongly, or look like several rooms."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from pgm_places._arguments import public
from pgm_places.errors import InputError
from pgm_places.maps.components import squared_clearance
from pgm_places.topology.cuts import (
    Line,
    cut_along,
    has_jambs,
    in_one_opening,
    line_width_m,
    opening_cuts,
)
from pgm_places.topology.regions import Region
from pgm_places.topology.topological_map import TopologicalMap


@dataclass(frozen=True, eq=False)
class PlaceCheck:
    """A place with its uncertainty.

    Parameters
    ----------
    place : Region
    probability : float
        Probability of its label: the place's confidence.
    second_label : str or None
        The most probable other label; None if there is no other.
    second_probability : float or None
        Its probability: a share of ``1 - probability`` in proportion to the mean over the place's
        cells, as the probability of a gate may differ from that of its cells.
    """

    place: Region
    probability: float
    second_label: str | None
    second_probability: float | None

    @property
    def doubt(self) -> float:
        """The probability that the label is wrong, 0 to 1."""
        return 1.0 - self.probability

    @property
    def doubtful_m2(self) -> float:
        """Doubt times area: the expected wrongly labelled area."""
        return self.doubt * self.place.area_m2


@public
def places_to_check(topology: TopologicalMap) -> list[PlaceCheck]:
    """The places of a map with known probabilities, by descending uncertain area.

    With calibrated probabilities, checking places in this order corrects the most area with the
    fewest checks.

    Examples
    --------
    >>> from pgm_places import LabelGraph, OccupancyGrid, topological_map
    >>> grid = OccupancyGrid([[0, 0, 0, 0]], resolution_m=1.0)
    >>> places = topological_map(
    ...     grid,
    ...     [[0, 0, 1, 1]],
    ...     ["room", "corridor"],
    ...     beliefs=[[0.9, 0.1], [0.9, 0.1], [0.4, 0.6], [0.3, 0.7]],
    ...     layout=LabelGraph.from_grid(grid).layout,
    ... )
    >>> for check in places_to_check(places):
    ...     print(f"{check.place.name}: {check.doubtful_m2:.1f} m2, or {check.second_label}")
    corridor 2: 0.7 m2, or room
    room 1: 0.2 m2, or corridor
    """
    checks = [
        PlaceCheck(region, region.confidence, *_second(region, topology.label_names))
        for region in topology.regions
        if region.confidence is not None
    ]
    return sorted(checks, key=lambda check: (-check.doubtful_m2, check.place.id))


def doubtful_share(topology: TopologicalMap) -> float | None:
    """The expected share of wrongly labelled area; None without probabilities.

    Places without probabilities are left out. Probabilities of gates only do not suffice.
    """
    checks = places_to_check(topology)
    if all(check.place.probabilities is None for check in checks):
        return None
    area_m2 = sum(check.place.area_m2 for check in checks)
    return sum(check.doubtful_m2 for check in checks) / area_m2 if area_m2 else None


def _second(place: Region, label_names: tuple[str, ...]) -> tuple[str | None, float | None]:
    """The most probable label other than the place's own, and its probability."""
    known = zip(label_names, place.probabilities or (), strict=False)
    others = {name: probability for name, probability in known if name != place.label}
    total = sum(others.values())
    if not total or place.confidence is None:
        return None, None
    name = max(others, key=lambda label: others[label])
    return name, others[name] / total * (1.0 - place.confidence)


WIDEST_M, DEEPEST_M = 1.9, 0.75
"""Greatest width and depth (m) of openings: wider ones without jambs are parts of a room, deeper
ones are passages along a bed or a counter."""

DOOR_WIDTH_M, DOOR_DEPTH_M = 1.2, 0.55
"""Greatest width and depth (m) of doors, which need a smaller difference in width to the room."""

CASED_WIDTH_M = 2.5
"""Greatest width (m) of a single opening between jambs that counts as a door, as in homes."""

LEAST_PART_M2 = 4.0
"""Least area (m²) of either side; smaller ones are niches, or space between furniture."""

DOOR_SHARE, OTHER_SHARE = 1.15, 0.75
"""Greatest ratios of the width of an opening to the breadth of a side: for doors, for others."""

CIRCULATION = ("corridor", "hall")
"""Classes of long and winding places, which narrow at each joint without being several places."""

_FOUND: WeakKeyDictionary[TopologicalMap, tuple["SplitCandidate", ...]] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class SplitCandidate:
    """A place that looks like several rooms, and the lines that would split it."""

    place: Region
    lines_m: tuple[Line, ...]  # ends of the lines across its openings, in the map frame
    areas_m2: tuple[float, ...]  # areas of the parts between the lines, descending

    @property
    def count(self) -> int:
        """The number of rooms."""
        return len(self.areas_m2)


def split_candidates(topology: TopologicalMap) -> tuple[SplitCandidate, ...]:
    """The places that look like several rooms, by id.

    An opening separates rooms if it is at most 1.9 m wide and 0.75 m deep (a thick wall), leaves at
    least 4 m² on both sides, and is narrow compared with both sides. The breadth of a side is four
    times its mean clearance, the width of a strip. The opening must be narrower than 0.75 of it, or
    than 1.15 of it for an opening of the size of a door, 1.2 m wide and 0.55 m deep. A cased
    opening, which is single, at most 2.5 m wide and 0.55 m deep, and lies between jambs, counts as
    a door. Two or three openings between two parts count as one. Doorways are left out, and so are
    corridors and halls, which narrow at each joint, and openings that the user removed.

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
    """The lines of all cuts that separate rooms; of two overlapping cuts, the narrower one."""
    cuts = [
        cut
        for cut, depth_m in opening_cuts(topology, place, CASED_WIDTH_M)
        if depth_m <= DEEPEST_M
        and not any(
            in_one_opening(line, removed) for line in cut for removed in topology.removed_openings
        )
        and _parts_rooms(topology, place, cut, depth_m)
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
    """Whether both sides of a cut are large, and broad compared with its widest line."""
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
    """Openings within places, alone or up to three together, that divide them.

    They are narrow openings between segments of open space without a doorway. Single openings come
    first, then by the area of the smaller part. Lines that divide a place only together, such as
    two doors between two rooms, form one proposal.

    ``narrower_than_m``: widest opening to list, from wall to wall; those between offices are up to
    1.5 m wide. ``min_part_m2``: minimum area of either part.

    InputError: the width is not positive.
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
    """Areas of the two largest parts between lines, 0 for a missing second part."""
    areas_m2 = [*cut_along(topology, place, lines).area_m2.tolist(), 0.0]
    return areas_m2[0], areas_m2[1]
