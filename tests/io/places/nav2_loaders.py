"""What Nav2's loaders take and refuse, as their sources have it: for files that it is to read.

Written after ``geojson_graph_file_loader.cpp``, ``route_server.cpp``, the scorers and operations of
``nav2_route``, ``map_io.cpp``, ``map_server.cpp``, ``costmap_filter_info_server.cpp``,
``lifecycle_manager.cpp`` and the costmap filters. Nav2 itself does not run here.
"""

import json
from pathlib import Path
from typing import Any

import yaml

STRINGS = "string array"

SERVERS: dict[str, dict[str, Any]] = {
    "map_server": {"yaml_filename": str, "topic_name": str, "frame_id": str},
    "costmap_filter_info_server": {
        "filter_info_topic": str,
        "type": int,
        "mask_topic": str,
        "base": float,
        "multiplier": float,
    },
    "lifecycle_manager": {"autostart": bool, "node_names": STRINGS},
    "route_server": {
        "route_frame": str,
        "base_frame": str,
        "graph_file_loader": str,
        "graph_filepath": str,
        "edge_cost_functions": STRINGS,
        "operations": STRINGS,
    },
    "nav2_route::GeoJsonGraphFileLoader": {"plugin": str},
    "nav2_route::DistanceScorer": {"plugin": str, "speed_tag": str, "weight": float},
    "nav2_route::TimeScorer": {
        "plugin": str,
        "speed_tag": str,
        "time_tag": str,
        "weight": float,
        "max_vel": float,
    },
    "nav2_route::ReroutingService": {"plugin": str},
    "nav2_costmap_2d::KeepoutFilter": {"plugin": str, "enabled": bool, "filter_info_topic": str},
    "nav2_costmap_2d::SpeedFilter": {
        "plugin": str,
        "enabled": bool,
        "filter_info_topic": str,
        "speed_limit_topic": str,
    },
}
"""Parameters with the types that are declared: ROS refuses a whole number where it wants a float,
and passes over names that nobody declares."""


def check_parameters(kind: str, values: dict[str, Any]) -> None:
    """Every parameter is declared, with this type; plugins are looked up by their name."""
    declared = SERVERS[kind]
    for name, value in values.items():
        if isinstance(value, dict):
            check_parameters(value["plugin"], value)
            continue
        wanted = declared[name]
        if wanted == STRINGS:
            assert value, f"{kind}: ROS cannot read the empty list {name}"
            assert all(type(item) is str for item in value)
        else:
            assert type(value) is wanted, f"{kind}: {name} = {value!r} is no {wanted}"
    for name in ("edge_cost_functions", "operations"):
        for plugin in values.get(name, ()):
            assert plugin in values, f"{plugin} has no parameters, not even its plugin"


def graph_of(path: Path) -> tuple[dict[int, Any], list[Any]]:
    """Nodes by id, and edges, as the loader keeps them; raises where it would."""
    record = json.loads(path.read_text())
    nodes: dict[int, Any] = {}
    edges: list[Any] = []
    for feature in record["features"]:
        properties, shape = feature["properties"], feature["geometry"]
        check_metadata(properties["metadata"])
        if shape["type"] == "Point":
            assert type(properties["id"]) is int
            assert properties["id"] not in nodes
            x, y = shape["coordinates"]
            nodes[properties["id"]] = {"x": float(x), "y": float(y), **properties}
        else:
            assert shape["type"] in ("MultiLineString", "LineString")
            edges.append({**properties, "line": shape["coordinates"]})
    for edge in edges:
        assert {edge["startid"], edge["endid"]} <= nodes.keys()
        assert type(edge["cost"]) is float
        assert type(edge["overridable"]) is bool
    numbers = [*nodes, *(edge["id"] for edge in edges)]
    assert len(set(numbers)) == len(numbers)
    assert nodes
    assert edges
    return nodes, edges


def check_metadata(values: dict[str, Any]) -> None:
    """Numbers, strings, truth values, lists of them and mappings: all else is refused."""
    for value in values.values():
        if isinstance(value, dict):
            check_metadata(value)
            continue
        for item in value if isinstance(value, list) else [value]:
            assert isinstance(item, (bool, int, float, str)), f"Failed to convert {item!r}"


def float_of(metadata: dict[str, Any], key: str, default: float) -> float:
    """``getValue<float>``: a whole number in the file is kept as one, and the cast then throws."""
    if key not in metadata:
        return default
    assert type(metadata[key]) is float, f"bad any_cast: {key} = {metadata[key]!r}"
    return float(metadata[key])


def map_of(path: Path) -> dict[str, Any]:
    """The description of a map or mask, with all that ``loadMapYaml`` asks for."""
    found: dict[str, Any] = yaml.safe_load(path.read_text())
    assert (path.parent / found["image"]).is_file()
    assert len([float(value) for value in found["origin"]]) == 3
    assert float(found["resolution"]) > 0
    assert 0 <= found["free_thresh"] < found["occupied_thresh"] <= 1
    assert found["mode"] in ("trinary", "scale", "raw")
    assert found["negate"] in (0, 1)
    return found
