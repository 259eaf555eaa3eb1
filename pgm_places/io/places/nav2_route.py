"""The route graph for Nav2's Route Server (GeoJSON)."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pgm_places.errors import InputError
from pgm_places.io.atomic import write_json
from pgm_places.io.places.region_features import DIGITS, LOCAL_METRES
from pgm_places.topology.route_graph import RouteGraph
from pgm_places.topology.topological_map import TopologicalMap

Feature = dict[str, Any]


def route_features(
    topology: TopologicalMap, routes: RouteGraph, *, speeds_m_s: Mapping[str, float] | None = None
) -> dict[str, Any]:
    """A FeatureCollection of nodes (Points) and directed edges (MultiLineStrings).

    The node that stands for a place has the id of the place; every id is used once. Edges come in
    both directions, each with an id of its own. Metadata hold the ``class`` that Nav2's
    ``SemanticScorer`` looks for, the ``name`` of the place, the ``clearance_m``, and for nodes in
    doorways their ``width_m``; never null, which the loader refuses. Where speeds are given, edges
    have the lowest of the places that they touch as ``abs_speed_limit``, which Nav2's
    ``TimeScorer`` looks for. Operations are left to the user.

    Parameters
    ----------
    topology : TopologicalMap
    routes : RouteGraph
    speeds_m_s : mapping of str to float, optional
        The largest speed by class or name of place; a place's own wins over that of its class.

    Raises
    ------
    InputError
        There is no edge, or a name is neither a place nor a class.
    """
    topology.ids_of(speeds_m_s or ())
    if not routes.edges:
        raise InputError(
            f"a robot with a radius of {routes.robot_radius_m:g} m can go nowhere: no two places "
            "are connected by a passage wide enough; Nav2's Route Server needs at least one edge"
        )
    free = max((region.id for region in topology.regions), default=0) + 1
    others = iter(range(free, free + len(routes.nodes)))
    ids = [node.region if node.is_anchor else next(others) for node in routes.nodes]
    first = next(others)
    return {
        "type": "FeatureCollection",
        "name": "graph",
        "crs": LOCAL_METRES,
        "features": [
            *_nodes(topology, routes, ids),
            *_edges(topology, routes, ids, first, speeds_m_s or {}),
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
    free: int,
    speeds_m_s: Mapping[str, float],
) -> list[Feature]:
    features: list[Feature] = []
    for edge in routes.edges:
        metadata = {**_place(topology, edge.region), "clearance_m": round(edge.clearance_m, DIGITS)}
        places = [topology.place(routes.nodes[k].region) for k in (edge.first, edge.second)]
        known = [speeds_m_s.get(item.name, speeds_m_s.get(item.label)) for item in places]
        # Floats: Nav2 keeps the type that a number has in the file, and asks for a float only.
        if limits := [float(value) for value in known if value is not None]:
            metadata["abs_speed_limit"] = min(limits)
        for start, end in ((edge.first, edge.second), (edge.second, edge.first)):
            line = [_rounded(routes.nodes[k].point_m) for k in (start, end)]
            properties = {
                "id": free + len(features),
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
        (item.width_m for item in topology.connections if number in (item.first, item.second)),
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
) -> Path:
    """Write the graph for Nav2's Route Server; the path."""
    return write_json(path, route_features(topology, routes, speeds_m_s=speeds_m_s))
