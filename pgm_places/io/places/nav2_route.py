"""The route graph of Nav2's Route Server (GeoJSON), with ids that stay stable across exports."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from pgm_places.errors import InputError
from pgm_places.io.atomic import write_json
from pgm_places.io.input_file import read_json
from pgm_places.progress import warn
from pgm_places.topology.route_graph import RouteGraph
from pgm_places.topology.topological_map import DIGITS, LOCAL_METRES, TopologicalMap

FIRST_NODE, FIRST_EDGE = 10_001, 30_001
"""Lower ids belong to places. Nav2 holds ids in 16 bits."""

SAME_M = 0.5
"""A node within this distance of an earlier one is the same node."""

_MOST_BYTES = 1 << 28


Feature = dict[str, Any]


@dataclass(frozen=True)
class EarlierIds:
    """Ids of an earlier export: of nodes without a place, and of edges by the ids of their ends."""

    nodes: dict[int, tuple[float, float]] = field(default_factory=dict)
    edges: dict[tuple[int, int], int] = field(default_factory=dict)

    @classmethod
    def read(cls, path: Path | None) -> "EarlierIds":
        """The ids in a GeoJSON file of an earlier export; none, and a warning, if it is damaged."""
        if path is None or not path.is_file():
            return cls()
        try:
            record = read_json(path, InputError, "a route graph", max_bytes=_MOST_BYTES)
            nodes: dict[int, tuple[float, float]] = {}
            edges: dict[tuple[int, int], int] = {}
            for feature in record["features"]:
                values = feature["properties"]
                if feature["geometry"]["type"] == "Point":
                    if not values["metadata"]["is_anchor"]:
                        x, y = feature["geometry"]["coordinates"]
                        nodes[int(values["id"])] = (float(x), float(y))
                else:
                    edges[int(values["startid"]), int(values["endid"])] = int(values["id"])
        except (InputError, KeyError, TypeError, ValueError) as error:
            warn(f"{path} cannot be read, so all nodes and edges get new ids: {error}")
            return cls()
        return cls(nodes, edges)


def node_ids(routes: RouteGraph, earlier: EarlierIds) -> list[int]:
    """The id of each node: its place's, an earlier node's at its position, or a new one."""
    places = {node.region for node in routes.nodes if node.is_anchor}
    ids: list[int | None] = [node.region if node.is_anchor else None for node in routes.nodes]
    taken = {*places}
    for index, number in _matches(routes, earlier):
        if ids[index] is None and number not in taken:
            ids[index] = number
            taken.add(number)
    new = _unused(FIRST_NODE, {*earlier.nodes, *earlier.edges.values(), *places})
    return [next(new) if number is None else number for number in ids]


def edge_ids(
    ways: Sequence[tuple[int, int]], nodes: Sequence[int], earlier: EarlierIds
) -> list[int]:
    """The id of each directed edge, by the ids of its nodes: the earlier one, or a new one."""
    new = _unused(FIRST_EDGE, {*nodes, *earlier.edges.values(), *earlier.nodes})
    own = {*nodes}
    known = [earlier.edges.get(way) for way in ways]
    return [next(new) if number is None or number in own else number for number in known]


def _matches(routes: RouteGraph, earlier: EarlierIds) -> Iterator[tuple[int, int]]:
    """Pairs of a node's index and an earlier id near it, the nearest pairs first."""
    if not earlier.nodes or not routes.nodes:
        return
    from scipy.spatial import cKDTree

    numbers = list(earlier.nodes)
    trees = [
        cKDTree(np.array(points))
        for points in ([node.point_m for node in routes.nodes], list(earlier.nodes.values()))
    ]
    near = trees[0].sparse_distance_matrix(trees[1], SAME_M, output_type="ndarray")
    for match in near[np.lexsort((near["j"], near["i"], near["v"]))]:
        yield int(match["i"]), numbers[int(match["j"])]


def _unused(first: int, taken: set[int]) -> Iterator[int]:
    """Unused numbers from ``first`` on."""
    return (number for number in count(first) if number not in taken)


def route_features(
    topology: TopologicalMap,
    routes: RouteGraph,
    *,
    speeds_m_s: Mapping[str, float] | None = None,
    earlier: EarlierIds | None = None,
) -> dict[str, Any]:
    """A FeatureCollection of nodes (Points) and directed edges (MultiLineStrings).

    The node of a place has the id of the place; other nodes count from 10,001, edges from 30,001;
    ids are unique. Edges are directed and come in pairs. Metadata hold the ``class`` for Nav2's
    ``SemanticScorer``, the ``name`` of the place, the ``clearance_m``, and for nodes in doorways
    their ``width_m``; never null, which the loader refuses. With speeds, edges have the lowest
    limit of the places that they touch as ``abs_speed_limit``, for Nav2's ``TimeScorer``.
    Operations are left to the user.

    Parameters
    ----------
    topology : TopologicalMap
    routes : RouteGraph
    speeds_m_s : mapping of str to float, optional
        The largest speed by class or name of place; a place's limit overrides its class's.
    earlier : EarlierIds, optional
        Ids of an earlier export, which nodes at the same positions and their edges keep.

    Raises
    ------
    InputError
        The graph has no edge, or a name is neither a place nor a class.
    """
    topology.ids_of(speeds_m_s or ())
    if not routes.edges:
        raise InputError(
            f"a robot with a radius of {routes.robot_radius_m:g} m can go nowhere: no two places "
            "are connected by a passage wide enough; Nav2's Route Server needs at least one edge"
        )
    earlier = earlier or EarlierIds()
    ids = node_ids(routes, earlier)
    return {
        "type": "FeatureCollection",
        "name": "graph",
        "crs": LOCAL_METRES,
        "features": [
            *_nodes(topology, routes, ids),
            *_edges(topology, routes, ids, earlier, speeds_m_s or {}),
        ],
    }


def _nodes(topology: TopologicalMap, routes: RouteGraph, ids: list[int]) -> list[Feature]:
    features = []
    for number, node in zip(ids, routes.nodes, strict=True):
        metadata = {
            **_place(topology, node.region),
            "region": node.region,
            "is_anchor": node.is_anchor,
            "clearance_m": round(node.clearance_m, DIGITS),
        }
        width_m = _door_width_m(topology, node.region)
        if width_m is not None:
            metadata["width_m"] = round(width_m, DIGITS)
        features.append(
            {
                "type": "Feature",
                "properties": {"id": number, "frame": "map", "metadata": metadata},
                "geometry": {"type": "Point", "coordinates": _rounded(node.point_m)},
            }
        )
    return features


def _edges(
    topology: TopologicalMap,
    routes: RouteGraph,
    ids: list[int],
    earlier: EarlierIds,
    speeds_m_s: Mapping[str, float],
) -> list[Feature]:
    features: list[Feature] = []
    ways = [
        (ids[start], ids[end])
        for edge in routes.edges
        for start, end in ((edge.first, edge.second), (edge.second, edge.first))
    ]
    numbers = iter(edge_ids(ways, ids, earlier))
    for edge in routes.edges:
        metadata = {**_place(topology, edge.region), "clearance_m": round(edge.clearance_m, DIGITS)}
        places = [topology.place(routes.nodes[k].region) for k in (edge.first, edge.second)]
        known = [speeds_m_s.get(place.name, speeds_m_s.get(place.label)) for place in places]
        # Floats: Nav2 keeps the type of a number in the file, and only accepts floats here.
        if limits := [float(value) for value in known if value is not None]:
            metadata["abs_speed_limit"] = min(limits)
        for start, end in ((edge.first, edge.second), (edge.second, edge.first)):
            line = [_rounded(routes.nodes[k].point_m) for k in (start, end)]
            properties = {
                "id": next(numbers),
                "startid": ids[start],
                "endid": ids[end],
                "cost": round(edge.length_m, DIGITS),
                "overridable": True,
                "metadata": metadata,
            }
            geometry = {"type": "MultiLineString", "coordinates": [line]}
            features.append({"type": "Feature", "properties": properties, "geometry": geometry})
    return features


def _place(topology: TopologicalMap, number: int) -> dict[str, Any]:
    region = topology.place(number)
    return {"class": region.label, "name": region.name}


def _door_width_m(topology: TopologicalMap, number: int) -> float | None:
    """The width of a doorway at its narrowest passage; None for other places."""
    if topology.place(number).label != topology.doorway_label:
        return None
    return min(
        (
            connection.width_m
            for connection in topology.connections
            if number in (connection.first, connection.second)
        ),
        default=None,
    )


def _rounded(point: tuple[float, float]) -> list[float]:
    return [round(value, DIGITS) for value in point]


def write_nav2_route(
    path: Path | str,
    topology: TopologicalMap,
    routes: RouteGraph,
    *,
    speeds_m_s: Mapping[str, float] | None = None,
    earlier: Path | None = None,
) -> Path:
    """Write the graph for Nav2's Route Server; nodes and edges keep the ids of ``earlier``."""
    known = EarlierIds.read(earlier)
    return write_json(path, route_features(topology, routes, speeds_m_s=speeds_m_s, earlier=known))
