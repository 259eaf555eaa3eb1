"""Proposed splits for a person to decide on: rooms joined by missed doorways (paper, Fig. 9)."""

from collections.abc import Sequence

from pgm_places.errors import InputError
from pgm_places.topology.cuts import Line, cut_along, opening_cuts
from pgm_places.topology.hidden_rooms import HiddenRooms
from pgm_places.topology.regions import Region
from pgm_places.topology.topological_map import TopologicalMap


def propose_splits(
    topology: TopologicalMap, narrower_than_m: float, *, min_part_m2: float = 4.0
) -> list[HiddenRooms]:
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
                proposals.append(HiddenRooms(place, lines, (larger, smaller)))
    return sorted(proposals, key=lambda split: (len(split.lines_m), -split.areas_m2[1]))


def _parts_m2(
    topology: TopologicalMap, place: Region, lines: Sequence[Line]
) -> tuple[float, float]:
    """Areas of the two largest parts between lines, 0 where there is no second."""
    areas_m2 = [*cut_along(topology, place, lines).area_m2.tolist(), 0.0]
    return areas_m2[0], areas_m2[1]
