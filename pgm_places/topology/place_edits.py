"""Edits of a topological map: places are renamed, merged and split; all others stay as they are."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import plain_names, sealed
from pgm_places.errors import InputError
from pgm_places.maps.components import Components, connected_components
from pgm_places.spaces.gate import Gate
from pgm_places.topology.clearance import squared_clearance
from pgm_places.topology.connections import connections_of
from pgm_places.topology.naming import name_places
from pgm_places.topology.regions import Region, describe_regions
from pgm_places.topology.topological_map import TopologicalMap

__all__ = ["doorways_between", "merged", "renamed", "split_across", "split_at"]

_N_DIRECTIONS = 24
_LEAST_PART_M2 = 0.1
"""Smaller crumbs beside a line join the part next to them."""


def renamed(topology: TopologicalMap, names: Mapping[int, str]) -> TopologicalMap:
    """The map with the names that a user has given to ids; ids that do not occur are left out.

    Raises
    ------
    InputError
        Two places would have the same name.
    """
    if not names:
        return topology
    regions = tuple(
        replace(region, name=names.get(region.id, region.name)) for region in topology.regions
    )
    plain_names("names of places", [region.name for region in regions], InputError)
    return replace(topology, regions=regions)


def merged(topology: TopologicalMap, first: int | str, second: int | str) -> TopologicalMap:
    """The map with two places made one, which keeps the id, name and label of the first.

    A doorway between them that leads nowhere else becomes part of it.

    Raises
    ------
    InputError
        A place is unknown, both are the same, or they neither touch nor share a doorway.
    """
    one, other = topology.place(first), topology.place(second)
    doors = doorways_between(topology, one, other)
    region = topology.region.copy()
    for gone in (other, *doors):
        region[region == gone.id] = one.id
    return _described(topology, region, {})


def doorways_between(topology: TopologicalMap, one: Region, other: Region) -> list[Region]:
    """The doorways that join two places and lead nowhere else; empty where they only touch.

    Raises
    ------
    InputError
        Both are the same place, or they neither touch nor share a doorway.
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
    topology: TopologicalMap,
    key: int | str,
    start_m: Sequence[float],
    end_m: Sequence[float],
) -> TopologicalMap:
    """The map with a place split by a line between two points; the larger part keeps the id.

    The other part has the same label, a new id and a new name.

    Raises
    ------
    InputError
        The place is unknown, or the line does not part it.
    """
    place = topology.place(key)
    cells = topology.cells(place.id)
    away = _distance_to_line(
        topology.grid.cell_centres_m(cells), np.asarray(start_m), np.asarray(end_m)
    )
    # Wide enough that no step from cell to cell, along a side or a corner, crosses the line.
    cut = away <= 0.75 * topology.grid.resolution_m
    origin = cells.min(axis=0)
    window = np.full(cells.max(axis=0) - origin + 1, -1, np.int16)
    kept = cells[~cut] - origin
    window[kept[:, 0], kept[:, 1]] = 0
    parts = connected_components(window)
    large = np.flatnonzero(parts.size * topology.grid.resolution_m**2 >= _LEAST_PART_M2)
    if len(large) < 2:
        raise InputError(
            f"the line from ({start_m[0]:g}, {start_m[1]:g}) to ({end_m[0]:g}, {end_m[1]:g}) "
            f"does not divide {place.name!r}; draw it from wall to wall"
        )
    biggest = large[parts.size[large].argmax()]
    number = _nearest_part(parts, large, cells - origin)
    region = topology.region.copy()
    new: dict[int, Region] = {}
    for part in large[large != biggest].tolist():
        identity = topology.next_id + len(new)
        members = cells[number == part]
        region[members[:, 0], members[:, 1]] = identity
        new[identity] = place
    return _described(topology, region, new)


def split_at(topology: TopologicalMap, key: int | str, at_m: Sequence[float]) -> TopologicalMap:
    """The map with a place split at a point, across its narrowest way there.

    Raises
    ------
    InputError
        The place is unknown, the point is not in it, or nothing is parted there.
    """
    place = topology.place(key)
    if topology.region_at(*at_m) != place:
        raise InputError(f"({at_m[0]:g}, {at_m[1]:g}) is not in {place.name!r}")
    middle, best = np.asarray(at_m, np.float64), None
    for angle in np.arange(_N_DIRECTIONS) * np.pi / _N_DIRECTIONS:
        way = np.array([np.cos(angle), np.sin(angle)])
        ends = [
            middle + side * _reach(topology, place.id, middle, side * way) * way for side in (-1, 1)
        ]
        length = float(np.hypot(*(ends[1] - ends[0])))
        if best is None or length < best[0]:
            best = (length, ends)
    assert best is not None
    return split_across(topology, key, best[1][0].tolist(), best[1][1].tolist())


def _reach(
    topology: TopologicalMap, number: int, start: NDArray[np.float64], way: NDArray[np.float64]
) -> float:
    """How far one gets from a point in a direction before the region ends, a cell beyond it."""
    step = topology.grid.resolution_m / 4
    far = float(np.hypot(*topology.grid.shape)) * topology.grid.resolution_m
    along = np.arange(0.0, far, step)
    cells = topology.grid.cells_at_m(start + along[:, None] * way)
    inside = ((cells >= 0) & (cells < topology.grid.shape)).all(axis=1)
    here = np.zeros(len(along), np.bool_)
    here[inside] = topology.region[tuple(cells[inside].T)] == number
    return float(along[np.argmin(here)]) + topology.grid.resolution_m


def _distance_to_line(
    points: NDArray[np.float64], start: NDArray[np.float64], end: NDArray[np.float64]
) -> NDArray[np.float64]:
    along = end - start
    share = (points - start) @ along / max(float(along @ along), 1e-12)
    nearest = start + np.clip(share, 0, 1)[:, None] * along
    return np.asarray(np.hypot(*(points - nearest).T))


def _nearest_part(
    parts: Components, large: NDArray[np.int64], cells: NDArray[np.int64]
) -> NDArray[np.int32]:
    """(n,) the large part that each cell is in, or nearest to."""
    from scipy.ndimage import distance_transform_edt

    outside = ~np.isin(parts.piece, large)
    rows, columns = distance_transform_edt(outside, return_distances=False, return_indices=True)
    near = parts.piece[rows, columns]
    return np.asarray(near[cells[:, 0], cells[:, 1]])


def _described(
    topology: TopologicalMap, region: NDArray[np.int32], new: Mapping[int, Region]
) -> TopologicalMap:
    """The map with other cells (H, W) for its regions; ``new`` ids and the regions they are of."""
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
    shares = _probabilities(topology, raster, len(ids))
    regions = describe_regions(
        pieces,
        topology.grid,
        topology.label_names,
        clearance,
        ids=ids.tolist(),
        names=name_places(ids.tolist(), labels, known=old),
        probabilities=shares,
        gates=[_gate(earlier[number], number in new) for number in ids.tolist()],
        anchors_m={item.id: item.anchor_m for item in topology.regions},
    )
    return replace(
        topology,
        region=sealed(region),
        regions=tuple(regions),
        connections=connections_of(pieces, topology.grid, ids.tolist(), clearance),
        next_id=max(topology.next_id, int(ids.max(initial=0)) + 1),
    )


def _gate(region: Region, is_part: bool) -> tuple[Gate, float] | None:
    """The gate that a region is; what is split off a doorway is none."""
    if region.gate is None or is_part:
        return None
    return region.gate, 1.0 if region.confidence is None else region.confidence


def _probabilities(
    topology: TopologicalMap, piece: NDArray[np.int32], count: int
) -> NDArray[np.float64] | None:
    """(P, K) mean probabilities of pieces, by the cells that they have from earlier regions."""
    if any(item.probabilities is None for item in topology.regions):
        return None
    found = np.zeros((count, len(topology.label_names)))
    for item in topology.regions:
        window = topology.window(item.id)
        inside = piece[window][topology.region[window] == item.id]
        found += np.bincount(inside, minlength=count)[:, None] * np.array(item.probabilities)
    return found / found.sum(axis=1, keepdims=True)
