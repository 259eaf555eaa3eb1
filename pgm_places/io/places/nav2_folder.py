"""All that Nav2 takes of a topological map, in one folder: routes, masks, parameters, poses."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from pgm_places.io.atomic import write_text
from pgm_places.io.places.filter_masks import FilterKind, mask_files
from pgm_places.io.places.nav2_route import write_nav2_route
from pgm_places.topology.route_graph import RouteGraph
from pgm_places.topology.topological_map import TopologicalMap

__all__ = ["write_nav2"]

ROUTE, PARAMETERS = "nav2_route.geojson", "nav2_params.yaml"
LAUNCH, POSES = "places.launch.py", "poses.yaml"
SERVERS = ("filter_mask_server", "costmap_filter_info_server")
MANAGER = "lifecycle_manager_places"

_LAUNCH = '''\
"""Starts the servers of the places: routes, masks, and the manager that activates them."""

from launch import LaunchDescription
from launch_ros.actions import Node

PARAMETERS = {parameters!r}
SERVERS = [
{servers}
]


def generate_launch_description():
    return LaunchDescription(
        [
            Node(package=package, executable=executable, name=name, parameters=[PARAMETERS])
            for package, executable, name in SERVERS
        ]
    )
'''


def write_nav2(
    folder: Path,
    topology: TopologicalMap,
    routes: RouteGraph,
    *,
    speeds_m_s: Mapping[str, float] | None = None,
    keep_out: Sequence[str] = (),
    lies_in: Path | None = None,
) -> list[Path]:
    """Write the folder; the paths.

    ``nav2_route.geojson`` is the graph of the Route Server; ``poses.yaml`` holds a pose for every
    place by its name, and the id of its node; masks limit the speed and keep the robot out;
    ``nav2_params.yaml`` has the parameters of all servers, and what the costmaps and the controller
    need of them, in one file; ``places.launch.py`` starts the servers.

    Parameters
    ----------
    folder : Path
    topology : TopologicalMap
    routes : RouteGraph
        Its robot's radius is also that of the areas to keep out of.
    speeds_m_s : mapping of str to float, optional
        The largest speed in metres per second by class or name of place.
    keep_out : sequence of str
        Classes and names of places that the robot keeps out of.
    lies_in : Path, optional
        The folder where the files will lie, if they are moved: Nav2 wants absolute paths.

    Raises
    ------
    InputError
        There is no route, or a name or value that does not fit.
    OutputError
        Where a file cannot be written.
    """
    home = (lies_in or folder).resolve()
    written = [write_nav2_route(folder / ROUTE, topology, routes)]
    servers = [("nav2_route", "route_server", "route_server")]
    merged: dict[str, Any] = {"route_server": {"ros__parameters": _route_server(home / ROUTE)}}
    masks: list[tuple[FilterKind, Mapping[str, float], float]] = []
    if keep_out:
        masks.append(("keepout", dict.fromkeys(keep_out, 100.0), routes.robot_radius_m))
    if speeds_m_s:
        masks.append(("speed-m-s", speeds_m_s, 0.0))
    for kind, values, radius_m in masks:
        name = kind.replace("-", "_")
        paths, text = mask_files(
            folder / name, topology, kind, values=values, robot_radius_m=radius_m, lies_in=home
        )
        written += paths
        parameters = yaml.safe_load(text)
        for server, executable in zip(SERVERS, ("map_server", SERVERS[1]), strict=True):
            own = f"{name}_{server}"
            servers.append(("nav2_map_server", executable, own))
            merged[own] = parameters.pop(server)
        _merge(merged, parameters)
    names = [name for _, _, name in servers]
    merged[MANAGER] = {"ros__parameters": {"autostart": True, "node_names": names}}
    servers.append(("nav2_lifecycle_manager", "lifecycle_manager", MANAGER))
    listed = "\n".join(f"    {server!r}," for server in servers)
    launch = _LAUNCH.format(parameters=str(home / PARAMETERS), servers=listed)
    written.append(write_text(folder / PARAMETERS, yaml.safe_dump(merged, sort_keys=False)))
    written.append(write_text(folder / LAUNCH, launch))
    poses = yaml.safe_dump(_poses(topology, routes, keep_out), sort_keys=False, allow_unicode=True)
    return [*written, write_text(folder / POSES, poses)]


def _route_server(graph: Path) -> dict[str, Any]:
    return {
        "route_frame": "map",
        "graph_file_loader": "GeoJsonGraphFileLoader",
        "GeoJsonGraphFileLoader": {"plugin": "nav2_route::GeoJsonGraphFileLoader"},
        "graph_filepath": str(graph),
        "edge_cost_functions": ["DistanceScorer"],
        "DistanceScorer": {"plugin": "nav2_route::DistanceScorer"},
    }


def _merge(into: dict[str, Any], parameters: Mapping[str, Any]) -> None:
    """Add parameters to others: mappings key by key, lists one after the other."""
    for key, value in parameters.items():
        if isinstance(value, dict):
            _merge(into.setdefault(key, {}), value)
        elif isinstance(value, list):
            into[key] = [*into.get(key, []), *value]
        else:
            into[key] = value


def _poses(topology: TopologicalMap, routes: RouteGraph, keep_out: Sequence[str]) -> dict[str, Any]:
    """A pose for each place that the robot can and may reach, by its name."""
    closed = {region.id for region in topology.regions if {region.name, region.label} & {*keep_out}}
    return {
        topology.place(node.region).name: {
            "frame_id": "map",
            "x": round(node.point_m[0], 3),
            "y": round(node.point_m[1], 3),
            "yaw": 0.0,
            "node": node.region,
        }
        for node in routes.nodes
        if node.is_anchor and node.region not in {*routes.unreachable, *closed}
    }
