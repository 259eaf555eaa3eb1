"""The export formats of a topological map, by name."""

import io
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
import yaml
from numpy.typing import NDArray

from pgm_places._version import __version__
from pgm_places.errors import InputError, escape_control, nearest_name
from pgm_places.io.atomic import write_bytes, write_json, write_text
from pgm_places.io.maps.map_server import save_map
from pgm_places.io.maps.raster_image import encoded
from pgm_places.io.places.filter_masks import TYPES, write_filter_mask
from pgm_places.io.places.nav2_folder import check_frame
from pgm_places.io.places.nav2_route import write_nav2_route
from pgm_places.io.places.place_bag import write_place_bag
from pgm_places.maps.components import connected_components, squared_clearance
from pgm_places.maps.occupancy_grid import UNKNOWN, OccupancyGrid
from pgm_places.options import check_option
from pgm_places.topology.outlines import outlines
from pgm_places.topology.route_graph import ROBOT_RADIUS_M, RouteGraph, route_graph
from pgm_places.topology.topological_map import TopologicalMap

GOALS, SCRIPT = "coverage.yaml", "cover_place.py"

_CELLS_OF_MARGIN = np.sqrt(2)
"""Half the diagonal of a free cell plus half that of an obstacle's cell, in cells."""

_SCRIPT = '''\
#!/usr/bin/env python3
"""Sends a place of coverage.yaml to Nav2's coverage navigator: cover_place.py "room 3"."""

import sys
from pathlib import Path

import rclpy
import yaml
from geometry_msgs.msg import Point32, Polygon
from opennav_coverage_msgs.action import NavigateCompleteCoverage
from rclpy.action import ActionClient


def main():
    places = yaml.safe_load((Path(__file__).parent / "coverage.yaml").read_text())["places"]
    if len(sys.argv) != 2 or sys.argv[1] not in places:
        sys.exit("usage: cover_place.py PLACE, one of: " + ", ".join(places))
    place = places[sys.argv[1]]
    rclpy.init()
    node = rclpy.create_node("cover_place")
    client = ActionClient(node, NavigateCompleteCoverage, "navigate_complete_coverage")
    client.wait_for_server()
    goal = NavigateCompleteCoverage.Goal(frame_id=place["frame_id"])
    for ring in place["polygons"]:
        goal.polygons.append(Polygon(points=[Point32(x=x, y=y, z=0.0) for x, y in ring]))
    accepted = client.send_goal_async(goal)
    rclpy.spin_until_future_complete(node, accepted)
    if not accepted.result().accepted:
        sys.exit("the coverage navigator rejected the goal")
    result = accepted.result().get_result_async()
    rclpy.spin_until_future_complete(node, result)
    sys.exit(result.result().result.error_code)


if __name__ == "__main__":
    main()
'''


def coverage_goals(topology: TopologicalMap, robot_radius_m: float) -> dict[str, Any]:
    """The goal of opennav_coverage's ``NavigateCompleteCoverage`` for each place.

    ``places`` by name: ``frame_id`` and ``polygons``, lists of [x, y] in metres. The first polygon
    is the outline of the largest part of the place in which a disc of the robot's radius touches
    nothing but other places; the others are obstacles in it. Rings are closed, as Fields2Cover
    wants them. ``left_out``: names of places too small for the robot; doorways are in neither.
    """
    grid = topology.grid
    clear = squared_clearance(topology.region == 0)
    free = clear >= (robot_radius_m / grid.resolution_m + _CELLS_OF_MARGIN) ** 2
    places: dict[str, Any] = {}
    left_out = []
    for region in topology.regions:
        if region.label == topology.doorway_label:
            continue
        window = topology.window(region.id)
        inside = free[window] & (topology.region[window] == region.id)
        if not inside.any():
            left_out.append(region.name)
            continue
        largest = connected_components(inside, connectivity=4).largest
        piece = np.where(largest, 0, -1).astype(np.int32)
        [outline] = outlines(piece, 1, tolerance=0)
        corner = np.array([window[0].start, window[1].start])
        rings = [grid.cell_centres_m(ring + corner - 0.5) for ring in outline.polygons[0]]
        polygons = [ring.round(3).tolist() for ring in rings]
        places[region.name] = {"frame_id": "map", "polygons": polygons}
    if not places:
        raise InputError(
            f"a robot with a radius of {robot_radius_m:g} m fits into no place; pass a smaller "
            "--robot-radius"
        )
    return {"places": places, "left_out": left_out}


def write_coverage(folder: Path, topology: TopologicalMap, robot_radius_m: float) -> list[Path]:
    """Write the goals of all places and a script that sends one of them; returns the paths."""
    goals = coverage_goals(topology, robot_radius_m)
    text = yaml.safe_dump(goals, sort_keys=False, allow_unicode=True, default_flow_style=None)
    return [write_text(folder / GOALS, text), write_text(folder / SCRIPT, _SCRIPT)]


LIF_FILE = "layout.lif.json"
VEHICLE_TYPE = "robot"


def lif_layout(
    topology: TopologicalMap, routes: RouteGraph, *, name: str, exported: datetime | None = None
) -> dict[str, Any]:
    """A LIF with one layout: nodes and edges of the route graph, places as stations.

    Edges go in both directions. A station interacts at the node of its place. Numbers are metres of
    the map frame. Source: *LIF - Layout Interchange Format*, VDMA, version 1.0.0 (2024).
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


_TRANSFORMATION, _GEO_KEYS, _NO_DATA = 34264, 34735, 42113
# Key directory 1.1.0: a plane (1024: 1), pixels are areas (1025: 1), EPSG 3857, metres (3072).
_KEYS = (1, 1, 0, 3, 1024, 0, 1, 1, 1025, 0, 1, 1, 3072, 0, 1, 3857)
_DOUBLE, _SHORT, _ASCII = 12, 3, 2


def pixel_to_map(grid: OccupancyGrid) -> NDArray[np.float64]:
    """(4, 4) matrix from (column, row, 0, 1) of an image to x, y of the map frame.

    Rows count from the top; whole numbers are corners of pixels, (0, 0) the upper left one of the
    image.
    """
    cos, sin = np.cos(grid.yaw_rad), np.sin(grid.yaw_rad)
    right = grid.resolution_m * np.array([cos, sin])
    down = grid.resolution_m * np.array([sin, -cos])
    corner = np.asarray(grid.origin_xy_m) - grid.shape[0] * down
    matrix = np.eye(4)
    matrix[2, 2] = 0.0
    matrix[:2, 0], matrix[:2, 1], matrix[:2, 3] = right, down, corner
    return matrix


def write_geotiff(
    path: Path | str, topology: TopologicalMap, *, what: Literal["regions", "labels"] = "regions"
) -> Path:
    """Write a GeoTIFF of region ids, or labels from 1; 0 is "no data". Returns the path.

    Metres of the map frame become metres of EPSG 3857, as in the GeoJSON files: a plane near (0,
    0), not a location on Earth. Ids have at most 16 bits.
    """
    from PIL import Image
    from PIL.TiffImagePlugin import ImageFileDirectory_v2

    check_option("what", Literal["regions", "labels"], what)
    highest = max((region.id for region in topology.regions), default=0)
    if highest > 65535:
        raise InputError(f"a GeoTIFF of regions holds ids up to 65535, got {highest}")
    values = topology.region if what == "regions" else topology.labels + 1
    tags = ImageFileDirectory_v2()
    for tag, kind, content in (
        (_TRANSFORMATION, _DOUBLE, tuple(pixel_to_map(topology.grid).ravel().tolist())),
        (_GEO_KEYS, _SHORT, _KEYS),
        (_NO_DATA, _ASCII, "0"),
    ):
        tags.tagtype[tag] = kind
        tags[tag] = content
    image = Image.fromarray(values[::-1].astype(np.uint16))
    return write_bytes(path, encoded(image, "TIFF", tiffinfo=tags))


def write_cleaned_map(folder: Path, topology: TopologicalMap, grid: OccupancyGrid) -> list[Path]:
    """Write the map with free space outside places made unknown; returns the paths.

    Rays through windows, the outside and unreachable space become unknown, so that planners do not
    send robots there. The map must have the frame of the places.
    """
    check_frame(grid, topology)
    stray = grid.free & (topology.region == 0)
    path = save_map(grid.with_cells(np.where(stray, np.int8(UNKNOWN), grid.cells)), folder / "map")
    return [path, path.with_suffix(".png")]


def write_graphml(path: Path | str, topology: TopologicalMap) -> Path:
    """Write ``topology.graph`` as GraphML, for yEd, Gephi and networkx; returns the path."""
    import networkx as nx

    graph = topology.graph.copy()
    for values in graph.nodes.values():  # XML has no control characters, not even escaped
        values.update({key: escape_control(values[key]) for key in ("name", "label")})
    buffer = io.BytesIO()
    nx.write_graphml_xml(graph, buffer, named_key_ids=True)
    return write_bytes(path, buffer.getvalue())


def write_node_link(path: Path | str, topology: TopologicalMap) -> Path:
    """Write ``topology.graph`` as node-link JSON, for networkx and d3; returns the path."""
    graph = topology.graph
    content = {
        "directed": False,
        "multigraph": False,
        "graph": {},
        "nodes": [{**values, "id": number} for number, values in graph.nodes.items()],
        "edges": [{**v, "source": a, "target": b} for a, b, v in graph.edges(data=True)],
    }
    return write_json(path, content, indent=1)


def write_dot(path: Path | str, topology: TopologicalMap) -> Path:
    """Write ``topology.graph`` for Graphviz; positions are metres, for ``neato -n2``."""
    lines = ["graph places {"]
    for region in topology.regions:
        shape = "box" if region.label == topology.doorway_label else "ellipse"
        x, y = region.anchor_m
        lines.append(
            f'  {region.id} [label="{_quoted(region.name)}", class="{_quoted(region.label)}", '
            f'shape={shape}, pos="{72 * x:.2f},{72 * y:.2f}"];'
        )
    lines += [
        f'  {item.first} -- {item.second} [label="{item.width_m:.2f} m"];'
        for item in topology.connections
    ]
    return write_text(path, "\n".join([*lines, "}"]) + "\n")


def _quoted(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", " ")


OF_RADIUS = ("nav2-route", "lif", "coverage")
"""Formats that depend on the robot's radius."""

Writer: TypeAlias = Callable[[Path, TopologicalMap], list[Path]]

ROUTE_FILE = "nav2_route.geojson"

EXPORTS: dict[str, Writer] = {
    "regions": lambda folder, t: [write_json(folder / "regions.geojson", t.to_geojson())],
    "graphml": lambda folder, t: [write_graphml(folder / "places.graphml", t)],
    "node-link": lambda folder, t: [write_node_link(folder / "place_graph.json", t)],
    "dot": lambda folder, t: [write_dot(folder / "places.dot", t)],
    "geotiff": lambda folder, t: [
        write_geotiff(folder / "regions.tif", t, what="regions"),
        write_geotiff(folder / "labels.tif", t, what="labels"),
    ],
    "mcap": lambda folder, t: write_place_bag(folder / "places", t),
}
"""Formats that need only the map; the masks are in ``filter_masks.TYPES``."""


def export(
    topology: TopologicalMap,
    to: str,
    folder: Path,
    *,
    values: Mapping[str, float] | None = None,
    robot_radius_m: float | None = None,
    name: str = "places",
    lies_in: Path | None = None,
) -> list[Path]:
    """Write a topological map in the format ``to``; returns the paths.

    Parameters
    ----------
    topology : TopologicalMap
    to : str
    folder : Path
    values : mapping of str to float, optional
        Values of a filter mask, by class or name of place.
    robot_radius_m : float, optional
        For ``nav2-route`` and ``lif``: routes have room for a disc of this radius. For
        ``coverage``: distance of the polygons from obstacles. For ``keepout``: areas grow by it.
    name : str
        For ``lif``: the name of the project.
    lies_in : Path, optional
        The final folder of the files, if they are moved.

    Raises
    ------
    InputError
        The format is unknown, or does not accept the values.
    OutputError
        Where a file cannot be written.
    """
    known = [*OF_RADIUS, *EXPORTS, *TYPES]
    if to not in known:
        raise InputError(f"there is no export called {to!r}. {nearest_name(to, known)}")
    if values and to not in TYPES:
        raise InputError(f"the export {to!r} accepts no values; masks that do: {', '.join(TYPES)}")
    if robot_radius_m is not None and to not in (*OF_RADIUS, "keepout"):
        raise InputError(
            f"the export {to!r} accepts no robot radius; {', '.join(OF_RADIUS)} and keepout do"
        )
    if to in EXPORTS:
        return EXPORTS[to](folder, topology)
    if to in OF_RADIUS:
        radius = ROBOT_RADIUS_M if robot_radius_m is None else robot_radius_m
        if to == "coverage":
            return write_coverage(folder, topology, radius)
        routes = route_graph(topology, robot_radius_m=radius)
        if to == "lif":
            layout = lif_layout(topology, routes, name=name)
            return [write_json(folder / LIF_FILE, layout, indent=1)]
        earlier = (lies_in or folder) / ROUTE_FILE
        return [write_nav2_route(folder / ROUTE_FILE, topology, routes, earlier=earlier)]
    return write_filter_mask(
        folder / to.replace("-", "_"),
        topology,
        to,  # type: ignore[arg-type]  # TYPES holds exactly its kinds
        values=values,
        robot_radius_m=robot_radius_m or 0.0,
        lies_in=lies_in,
    )
