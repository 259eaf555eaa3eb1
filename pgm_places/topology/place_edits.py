"""Place edits: places of a topological map are renamed, merged and split."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import freeze, plain_names
from pgm_places.errors import InputError
from pgm_places.maps.components import Components, squared_clearance
from pgm_places.spaces.gates import Gate
from pgm_places.topology import cuts
from pgm_places.topology.checks import split_candidates
from pgm_places.topology.cuts import Line, Parts
from pgm_places.topology.place_ids import name_places
from pgm_places.topology.regions import Region, connections_of, describe_regions, extent
from pgm_places.topology.topological_map import TopologicalMap

_WIDER_M = 0.5  # excess width (m) of further openings over the first that is cut


def renamed(topology: TopologicalMap, names: Mapping[int, str]) -> TopologicalMap:
    """The map with a user's names, by id; unknown ids are ignored.

    Raises
    ------
    InputError
        Two places would have one name.
    """
    if not names:
        return topology
    regions = tuple(
        replace(region, name=names.get(region.id, region.name)) for region in topology.regions
    )
    plain_names("names of places", [region.name for region in regions], InputError)
    return replace(topology, regions=regions)


def merged(topology: TopologicalMap, first: int | str, second: int | str) -> TopologicalMap:
    """The map with two places merged into one with the id, name and label of the first.

    A doorway that connects only these two becomes part of it. The openings between them are no
    longer :func:`split candidates <pgm_places.topology.checks.split_candidates>`.

    Raises
    ------
    InputError
        A place is unknown, both are identical, or they neither touch nor share a doorway.
    """
    one, other = topology.place(first), topology.place(second)
    doors = doorways_between(topology, one, other)
    region = topology.region.copy()
    for gone in (other, *doors):
        region[region == gone.id] = one.id
    after = _described(topology, region, {})
    removed = tuple(
        cuts.narrowest_line(after, after.place(one.id), at_m) if gate is None else gate.line_m
        for at_m, gate in _openings_between(topology, one, other, doors)
    )
    lines = dict.fromkeys((*topology.removed_openings, *removed))
    return replace(after, removed_openings=tuple(lines))


def _openings_between(
    topology: TopologicalMap, one: Region, other: Region, doors: Sequence[Region]
) -> Iterator[tuple[tuple[float, float], Gate | None]]:
    """A point in each opening between two places, and the gate of a doorway."""
    for door in doors:
        yield door.anchor_m, door.gate
    for item in topology.connections:
        if {item.first, item.second} == {one.id, other.id}:
            yield item.point_m, None


def doorways_between(topology: TopologicalMap, one: Region, other: Region) -> list[Region]:
    """The doorways that connect two places and no others; empty if the places only touch.

    InputError: both places are identical, or they neither touch nor share a doorway.
    """
    if one.id == other.id:
        raise InputError(f"{one.name!r} cannot be merged with itself; name two places")
    near = {region.id: region for region in topology.neighbours(one.id)}
    far = {region.id for region in topology.neighbours(other.id)}
    doors = [
        region
        for region in near.values()
        if region.label == topology.doorway_label
        and region.id != other.id
        and {item.id for item in topology.neighbours(region.id)} == {one.id, other.id}
    ]
    if other.id not in near and not doors:
        shared = ", ".join(near[number].name for number in sorted(set(near) & far))
        between = f"; both touch {shared}" if shared else ""
        raise InputError(
            f"{one.name!r} and {other.name!r} neither touch nor share a doorway of their own"
            f"{between}; merge places that lie next to each other"
        )
    return doors


def split_across(
    topology: TopologicalMap, key: int | str, start_m: Sequence[float], end_m: Sequence[float]
) -> TopologicalMap:
    """The map with a place split by a line between two points; the larger part keeps the id.

    The other part has the same label, a new id and a new name. A line that does not divide the
    place is extended to the borders of the place, or to doorways, up to two metres from its ends.

    Raises
    ------
    InputError
        The place is unknown, or the line does not divide it.
    """
    place, ends = topology.place(key), (_point(start_m), _point(end_m))
    parts = cuts.cut_along(topology, place, [ends])
    are_inside = all(topology.region_at(*end) == place for end in ends)
    if len(parts) < 2 and are_inside and ends[0] != ends[1]:
        unpainted = np.full(topology.grid.shape, -1, np.int16)
        x_y = [_point(point) for point in topology.grid.points_at_m(ends).tolist()]
        limits = cuts.Limits(unpainted, topology=topology)
        parts = cuts.cut_along(topology, place, [cuts.cut_line(x_y, topology.grid, limits)])
    if len(parts) < 2:
        raise InputError(
            f"the line from ({start_m[0]:g}, {start_m[1]:g}) to ({end_m[0]:g}, {end_m[1]:g}) "
            f"does not divide {place.name!r}; draw it from wall to wall ({extent(place)})"
        )
    return _split(topology, place, parts)


def split_apart(topology: TopologicalMap, key: int | str) -> TopologicalMap:
    """The map with a split candidate split into its rooms; the largest keeps the id.

    Raises
    ------
    InputError
        The place is unknown, or looks like one room.
    """
    place = topology.place(key)
    candidates = [item for item in split_candidates(topology) if item.place.id == place.id]
    if not candidates:
        raise InputError(
            f"{place.name!r} looks like one room, so there is nothing to split it along; give a "
            "point in an opening, or both ends of a line from wall to wall"
        )
    return _split(topology, place, cuts.cut_along(topology, place, candidates[0].lines_m))


def split_all_apart(topology: TopologicalMap) -> TopologicalMap:
    """The map with every split candidate split into its rooms; the largest keeps the id.

    Raises
    ------
    InputError
        Every place looks like one room.
    """
    candidates = split_candidates(topology)
    if not candidates:
        raise InputError(
            "every place looks like one room, so there is nothing to split; name a place and give "
            "a point in an opening, or both ends of a line from wall to wall"
        )
    for item in candidates:
        parts = cuts.cut_along(topology, topology.place(item.place.id), item.lines_m)
        topology = _split(topology, item.place, parts)
    return topology


def split_at(topology: TopologicalMap, key: int | str, at_m: Sequence[float]) -> TopologicalMap:
    """The map with a place split across its narrowest passage at a point.

    If one or two other openings lead around this line, such as a second door between a room and a
    corridor, all of them are cut together.

    Raises
    ------
    InputError
        The place is unknown, the point is not in it, or no line there divides it.
    """
    place, here = topology.place(key), topology.region_at(*at_m)
    point = f"({at_m[0]:g}, {at_m[1]:g})"
    if here != place:
        other = "no place is there" if here is None else f"that is {here.name!r}"
        raise InputError(f"{point} is not in {place.name!r}; {other}")
    line = cuts.narrowest_line(topology, place, at_m)
    parts = cuts.cut_along(topology, place, [line])
    if len(parts) < 2:
        parts = _cut_together(topology, place, line) or parts
    if len(parts) < 2:
        raise InputError(
            f"cutting {place.name!r} at {point}, across its narrowest way there, does not divide "
            "it, because one can go around; choose a point in a doorway or where the place is "
            "narrow, or give both ends of a line from wall to wall"
        )
    return _split(topology, place, parts)


def _cut_together(topology: TopologicalMap, place: Region, line: Line) -> Parts | None:
    """The parts after a cut together with other openings; None if these do not suffice."""
    middle = np.mean(line, axis=0)
    for lines, _ in cuts.opening_cuts(topology, place, cuts.line_width_m(line) + _WIDER_M):
        away = [float(np.hypot(*(np.mean(other, axis=0) - middle))) for other in lines]
        nearest = int(np.argmin(away))
        if away[nearest] <= cuts.SAME_OPENING_M:
            parts = cuts.cut_along(topology, place, [*lines[:nearest], line, *lines[nearest + 1 :]])
            if len(parts) > 1:
                return parts
    return None


def _split(topology: TopologicalMap, place: Region, parts: Parts) -> TopologicalMap:
    """The map with the parts of a place as places; the largest keeps the id."""
    region, new = topology.region.copy(), range(topology.next_id, topology.next_id + len(parts) - 1)
    for part, identity in enumerate(new, start=1):
        region[tuple(parts.cells[parts.number == part].T)] = identity
    return _described(topology, region, dict.fromkeys(new, place))


def _point(at_m: Sequence[float]) -> tuple[float, float]:
    x, y = at_m
    return float(x), float(y)


def _described(
    topology: TopologicalMap, region: NDArray[np.int32], new: Mapping[int, Region]
) -> TopologicalMap:
    """The map with new cells (H, W) of its regions; ``new`` maps ids to their former regions."""
    earlier = {item.id: item for item in topology.regions} | dict(new)
    ids, piece = np.unique(region[region > 0], return_inverse=True)
    raster = np.full(region.shape, -1, np.int32)
    raster[region > 0] = piece
    labels = [earlier[number].label for number in ids.tolist()]
    pieces = Components(
        raster,
        np.array([topology.label_names.index(label) for label in labels], np.int32),
        np.bincount(piece, minlength=len(ids)).astype(np.int64),
    )
    old = {item.id: item.name for item in topology.regions}
    clearance = squared_clearance(region == 0)
    probabilities, halls = _probabilities(topology, raster, len(ids))
    regions = describe_regions(
        pieces,
        topology.grid,
        topology.label_names,
        clearance,
        ids=ids.tolist(),
        names=name_places(ids.tolist(), labels, known=old),
        probabilities=probabilities,
        halls=halls,
        gates=[_gate(earlier[number], number in new) for number in ids.tolist()],
        anchors_m={item.id: item.anchor_m for item in topology.regions},
    )
    return replace(
        topology,
        region=freeze(region),
        regions=tuple(regions),
        connections=connections_of(pieces, topology.grid, ids.tolist(), clearance),
        next_id=max(topology.next_id, int(ids.max(initial=0)) + 1),
    )


def _gate(region: Region, is_part: bool) -> tuple[Gate, float] | None:
    """The gate of a region; a part split off a doorway has none."""
    if region.gate is None or is_part:
        return None
    return region.gate, 1.0 if region.confidence is None else region.confidence


def _probabilities(
    topology: TopologicalMap, piece: NDArray[np.int32], count: int
) -> tuple[NDArray[np.float64] | None, NDArray[np.float64] | None]:
    """(P, K) and (P,) mean probabilities of labels and of halls, by the cells' earlier regions."""
    if any(item.probabilities is None for item in topology.regions):
        return None, None
    shares, halls = np.zeros((count, len(topology.label_names))), np.zeros(count)
    for item in topology.regions:
        window = topology.window(item.id)
        inside = piece[window][topology.region[window] == item.id]
        cells = np.bincount(inside, minlength=count)
        shares += cells[:, None] * np.array(item.probabilities)
        halls += cells * (np.nan if item.hall is None else item.hall)
    total = shares.sum(axis=1)
    return shares / total[:, None], halls / total
