"""Export as Layout Interchange Format (LIF 1.0.0, VDMA): routes and stations for fleets."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pgm_places._version import __version__
from pgm_places.errors import InputError
from pgm_places.io.atomic import write_json
from pgm_places.topology.route_graph import RouteGraph
from pgm_places.topology.topological_map import TopologicalMap

LIF_FILE = "layout.lif.json"
VEHICLE_TYPE = "robot"


def lif_layout(
    topology: TopologicalMap, routes: RouteGraph, *, name: str, exported: datetime | None = None
) -> dict[str, Any]:
    """A LIF with one layout: nodes and edges of the route graph, places as stations.

    Edges go in both directions. A station interacts at the node of its place. Numbers are metres
    of the map frame. Source: *LIF - Layout Interchange Format*, VDMA, version 1.0.0 (2024).

    Parameters
    ----------
    topology : TopologicalMap
    routes : RouteGraph
    name : str
        Name of the project and of the layout.
    exported : datetime, optional
        Now by default.

    Raises
    ------
    InputError
        The route graph has no edge.
    """
    if not routes.edges:
        raise InputError(
            f"a robot with a radius of {routes.robot_radius_m:g} m can go nowhere: a layout needs "
            "at least one edge"
        )
    ids = [f"node-{number}" for number in range(1, len(routes.nodes) + 1)]
    vehicle = [{"vehicleTypeId": VEHICLE_TYPE}]
    nodes: list[dict[str, Any]] = []
    stations = []
    for node_id, node in zip(ids, routes.nodes, strict=True):
        place = topology.place(node.region)
        position = {"x": round(node.point_m[0], 3), "y": round(node.point_m[1], 3)}
        nodes.append(
            {
                "nodeId": node_id,
                "nodeDescription": place.name,
                "mapId": "map",
                "nodePosition": position,
                "vehicleTypeNodeProperties": vehicle,
            }
        )
        if node.is_anchor and place.label != topology.doorway_label:
            stations.append(
                {
                    "stationId": f"place-{place.id}",
                    "interactionNodeIds": [node_id],
                    "stationName": place.name,
                    "stationDescription": place.label,
                    "stationPosition": position,
                }
            )
    edges = [
        {
            "edgeId": f"edge-{number}{way}",
            "startNodeId": ids[start],
            "endNodeId": ids[end],
            "vehicleTypeEdgeProperties": [{"vehicleTypeId": VEHICLE_TYPE, "rotationAllowed": True}],
        }
        for number, edge in enumerate(routes.edges, start=1)
        for way, start, end in (("", edge.first, edge.second), ("-back", edge.second, edge.first))
    ]
    layout = {
        "layoutId": "layout-1",
        "layoutName": name,
        "layoutVersion": "1",
        "nodes": nodes,
        "edges": edges,
        "stations": stations,
    }
    moment = exported or datetime.now(UTC)
    about = {
        "projectIdentification": name,
        "creator": f"pgm-places {__version__}",
        "exportTimestamp": moment.strftime("%Y-%m-%dT%H:%M:%S.000Z"),
        "lifVersion": "1.0.0",
    }
    return {"metaInformation": about, "layouts": [layout]}


def write_lif(folder: Path, topology: TopologicalMap, routes: RouteGraph, *, name: str) -> Path:
    """Write the layout; returns the path."""
    return write_json(folder / LIF_FILE, lif_layout(topology, routes, name=name), indent=1)
