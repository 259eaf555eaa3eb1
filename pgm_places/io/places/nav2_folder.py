"""Export for Nav2: a folder with map, route graph, masks, parameters and poses."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from pgm_places.errors import InputError
from pgm_places.io.atomic import write_json, write_text
from pgm_places.io.maps.map_server import save_map
from pgm_places.io.places.filter_masks import FilterKind, write_filter_mask
from pgm_places.io.places.nav2_scripts import (
    BRINGUP,
    BRINGUP_TEXT,
    EXAMPLE,
    EXAMPLE_TEXT,
    LAUNCH,
    LAUNCH_TEXT,
)
from pgm_places.io.places.route_ids import EarlierIds, edge_ids, node_ids
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.topology.geojson import DIGITS, LOCAL_METRES
from pgm_places.topology.route_graph import RouteGraph, standing_points
from pgm_places.topology.topological_map import TopologicalMap

__all__ = ["route_features", "write_nav2", "write_nav2_route"]

Feature = dict[str, Any]


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
    """Write the graph for Nav2's Route Server; returns the path.

    Nodes and edges keep the ids of an existing file.
    """
    known = EarlierIds.read(earlier)
    return write_json(path, route_features(topology, routes, speeds_m_s=speeds_m_s, earlier=known))


MAP, ROUTE, PARAMETERS = "map", "nav2_route.geojson", "nav2_params.yaml"
POSES = "poses.yaml"
SERVERS = ("filter_mask_server", "costmap_filter_info_server")
MANAGER = "lifecycle_manager_places"

PLAIN_SPEED_M_S = 0.5
"""The speed that Nav2's TimeScorer assumes without a limit."""


def write_nav2(
    folder: Path,
    topology: TopologicalMap,
    routes: RouteGraph,
    *,
    speeds_m_s: Mapping[str, float] | None = None,
    grid: OccupancyGrid | None = None,
    lies_in: Path | None = None,
) -> list[Path]:
    """Write the folder; returns the paths.

    ``map.yaml`` and ``map.png`` are the map; ``nav2_route.geojson`` is the graph of the Route
    Server; ``poses.yaml`` holds a pose for every place by its name, and the id of its node; masks
    limit the speed and keep the robot out; ``nav2_params.yaml`` has the parameters of all servers,
    the costmaps and the controller. ``bringup.launch.py`` starts Nav2 with these files, from Kilted
    on; ``places.launch.py`` starts the servers in addition to an earlier Nav2; ``go_to_place.py``
    drives to a place by its name. A graph without edges is omitted, and the Route Server with it.

    Parameters
    ----------
    folder : Path
    topology : TopologicalMap
    routes : RouteGraph
        Its closed places become the keep-out mask, grown by its radius.
    speeds_m_s : mapping of str to float, optional
        The speed limit in metres per second by class or name of place.
    grid : OccupancyGrid, optional
        The map; None writes no map.
    lies_in : Path, optional
        The final folder of the files, if they are moved: Nav2 needs absolute paths.

    Raises
    ------
    InputError
        The robot fits into no place, a name or value is invalid, or the map's frame is not that of
        the places.
    OutputError
        Where a file cannot be written.
    """
    home = (lies_in or folder).resolve()
    speeds = speeds_m_s or {}
    poses = _poses(topology, routes)
    if not poses:
        raise InputError(
            f"a robot with a radius of {routes.robot_radius_m:g} m fits into no place of the map; "
            "pass its own radius, or let it into more places"
        )
    files: dict[str, str] = {}  # arguments of nav2_bringup's launch file
    written: list[Path] = []
    servers: list[tuple[str, str, str]] = []
    merged: dict[str, Any] = {}
    if routes.edges:
        graph = folder / ROUTE
        written = [
            write_nav2_route(graph, topology, routes, speeds_m_s=speeds, earlier=home / ROUTE)
        ]
        files["graph"] = ROUTE
        servers = [("nav2_route", "route_server", "route_server")]
        merged = {"route_server": {"ros__parameters": _route_server(home / ROUTE, speeds)}}
    if grid is not None:
        check_frame(grid, topology)
        path = save_map(grid, folder / MAP)
        written += [path, path.with_suffix(".png")]
        files["map"] = path.name
        merged["map_server"] = {"ros__parameters": {"yaml_filename": str(home / path.name)}}
    masks: list[tuple[FilterKind, Mapping[str, float], float]] = []
    if routes.closed:
        names = [topology.place(number).name for number in routes.closed]
        masks.append(("keepout", dict.fromkeys(names, 100.0), routes.robot_radius_m))
    if speeds:
        masks.append(("speed-m-s", speeds, 0.0))
    for kind, values, radius_m in masks:
        name = kind.replace("-", "_")
        server_name = kind.partition("-")[0]  # of the nodes of nav2_bringup
        files[f"{server_name}_mask"] = f"{name}.yaml"
        parameters: dict[str, Any] = {}
        options: dict[str, Any] = {"robot_radius_m": radius_m, "parameters": parameters}
        stem = folder / name
        written += write_filter_mask(stem, topology, kind, values=values, lies_in=home, **options)
        for server, executable in zip(SERVERS, ("map_server", SERVERS[1]), strict=True):
            own = f"{server_name}_{server}"
            servers.append(("nav2_map_server", executable, own))
            merged[own] = parameters.pop(server)
        _merge(merged, parameters)
    if servers:
        names = [name for _, _, name in servers]
        merged[MANAGER] = {"ros__parameters": {"autostart": True, "node_names": names}}
        servers.append(("nav2_lifecycle_manager", "lifecycle_manager", MANAGER))
        listed = "\n".join(f"    {server!r}," for server in servers)
        launch = LAUNCH_TEXT.format(parameters=str(home / PARAMETERS), servers=listed)
        written.append(write_text(folder / LAUNCH, launch))
    if merged:
        written.append(write_text(folder / PARAMETERS, yaml.safe_dump(merged, sort_keys=False)))
        bringup = BRINGUP_TEXT.format(files=files, parameters=PARAMETERS)
        written.append(write_text(folder / BRINGUP, bringup))
    written.append(write_text(folder / EXAMPLE, EXAMPLE_TEXT))
    text = yaml.safe_dump(poses, sort_keys=False, allow_unicode=True)
    return [*written, write_text(folder / POSES, text)]


def check_frame(grid: OccupancyGrid, topology: TopologicalMap) -> None:
    places = topology.grid
    mine, theirs = (
        (*item.shape, item.resolution_m, *item.origin_xy_m, item.yaw_rad) for item in (grid, places)
    )
    if mine != theirs:
        listed = [
            f"{rows} x {columns} cells of {side_m:g} m from ({x:g}, {y:g}), yaw {yaw:g}"
            for rows, columns, side_m, x, y, yaw in (mine, theirs)
        ]
        raise InputError(
            f"the map has {listed[0]}, but the places have {listed[1]}: give the map that was "
            "labelled, or label this one"
        )


def _route_server(graph: Path, speeds_m_s: Mapping[str, float]) -> dict[str, Any]:
    """Parameters of the Route Server: routes are compared by time if there are speed limits.

    The operation AdjustSpeedLimit is left out: at every edge without its own percentage it lifts
    the limit, on the topic of the speed filter.
    """
    scorer = "TimeScorer" if speeds_m_s else "DistanceScorer"
    values: dict[str, Any] = {"plugin": f"nav2_route::{scorer}"}
    if speeds_m_s:
        values["max_vel"] = float(max(PLAIN_SPEED_M_S, *speeds_m_s.values()))
    return {
        "route_frame": "map",
        "graph_file_loader": "GeoJsonGraphFileLoader",
        "GeoJsonGraphFileLoader": {"plugin": "nav2_route::GeoJsonGraphFileLoader"},
        "graph_filepath": str(graph),
        "edge_cost_functions": [scorer],
        scorer: values,
        "operations": ["ReroutingService"],
        "ReroutingService": {"plugin": "nav2_route::ReroutingService"},
    }


def _merge(into: dict[str, Any], parameters: Mapping[str, Any]) -> None:
    """Merge parameters into others: mappings by key, lists by concatenation."""
    for key, value in parameters.items():
        if isinstance(value, dict):
            _merge(into.setdefault(key, {}), value)
        elif isinstance(value, list):
            into[key] = [*into.get(key, []), *value]
        else:
            into[key] = value


def _poses(topology: TopologicalMap, routes: RouteGraph) -> dict[str, Any]:
    """A pose for each place that the robot can and may reach, by name.

    For a graph without edges: a pose for each place that it fits into, without node ids.
    """
    points = {
        node.region: node.point_m
        for node in routes.nodes
        if node.is_anchor and node.region not in routes.unreachable
    }
    if not routes.edges:
        points = standing_points(
            topology, robot_radius_m=routes.robot_radius_m, closed=routes.closed
        )
    return {
        topology.place(number).name: {
            "frame_id": "map",
            "x": round(x, 3),
            "y": round(y, 3),
            "yaw": 0.0,
            **({"node": number} if routes.edges else {}),
        }
        for number, (x, y) in points.items()
    }
