"""Route picture: the route graph of a topological map drawn, written to files, and summarised."""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.io.atomic import write_bytes
from pgm_places.io.places.exports import ROUTE_FILE
from pgm_places.io.places.nav2_folder import write_nav2
from pgm_places.io.places.nav2_route import write_nav2_route
from pgm_places.palette import ERROR, IGNORED, Swatch, label_colours, label_swatches
from pgm_places.pictures.canvas import view_of
from pgm_places.pictures.drawing import INK, Drawing
from pgm_places.pictures.figure_grid import Panel, figure_grid
from pgm_places.pictures.topology_pictures import name_spots, paled_canvas
from pgm_places.topology.route_graph import ROBOT_RADIUS_M, RouteGraph, route_graph
from pgm_places.topology.topological_map import TopologicalMap

ROUTE_PICTURE = "nav2_route.png"


def write_routes(
    folder: Path,
    topology: TopologicalMap,
    *,
    robot_radius_m: float = ROBOT_RADIUS_M,
    keep_out: Iterable[str] = (),
    for_nav2: Mapping[str, Any] | None = None,
    lies_in: Path | None = None,
) -> RouteGraph:
    """Write the route graph for Nav2 and ``nav2_route.png``, its picture; the graph.

    Routes avoid the places of ``keep_out``, classes or names. ``for_nav2``, the options of
    :func:`~pgm_places.io.places.nav2_folder.write_nav2`, adds the other files for Nav2. Nodes and
    edges of an earlier graph in ``lies_in``, the final folder, keep their ids.
    """
    closed = topology.ids_of(keep_out)
    routes = route_graph(topology, robot_radius_m=robot_radius_m, closed=closed)
    if for_nav2 is None:
        earlier = (lies_in or folder) / ROUTE_FILE
        write_nav2_route(folder / ROUTE_FILE, topology, routes, earlier=earlier)
    else:
        write_nav2(folder, topology, routes, lies_in=lies_in, **for_nav2)
    if routes.edges:
        write_bytes(folder / ROUTE_PICTURE, route_drawing(topology, routes).png())
    return routes


def routes_summary(topology: TopologicalMap, routes: RouteGraph) -> str:
    """A line with the size and the narrowest clearance of a graph, and its unreachable places."""
    if not routes.edges:
        why = (
            "the map has one place, and all of it is near one point"
            if len(topology.regions) == 1
            else "no two places are connected by a passage wide enough for a radius of "
            f"{routes.robot_radius_m:g} m"
        )
        return f"no route graph: {why}; Nav2's planner finds the ways to the poses without one"
    least_m = min(edge.clearance_m for edge in routes.edges)
    line = (
        f"routes: {len(routes.nodes)} nodes, {len(routes.edges)} edges, all at least "
        f"{least_m:.2f} m from obstacles"
    )
    if routes.closed:
        line += " and places to keep out of"
    if not routes.unreachable:
        return f"{line}; every {'other ' if routes.closed else ''}place can be reached"
    names = ", ".join(topology.place(number).name for number in routes.unreachable)
    return f"{line}\nnot reachable with a radius of {routes.robot_radius_m:g} m: {names}"


_MOST_PIXELS = 1_000_000

_LINE, _DISC, _DOOR, _DOT, _NAME = 2.0, 13.0, 9.0, 4.0, 13


def route_drawing(topology: TopologicalMap, routes: RouteGraph) -> Drawing:
    """Nodes and edges over the places; unreachable ones are named in red, forbidden ones hatched.

    Examples
    --------
    >>> from pgm_places.maps.occupancy_grid import OccupancyGrid
    >>> from pgm_places.topology.from_labels import topological_map
    >>> from pgm_places.topology.route_graph import route_graph
    >>> grid = OccupancyGrid([[0, 0, 0, 0]], resolution_m=1.0)
    >>> found = topological_map(grid, [[0, 0, 1, 1]], ["room", "corridor"])
    >>> route_drawing(found, route_graph(found)).image.mode
    'RGB'
    """
    view = view_of(topology.grid, topology.region > 0, most_pixels=_MOST_PIXELS)
    open_to_it = ~np.isin(topology.region, routes.closed)
    labels = np.where(open_to_it, topology.labels, np.int16(-1))
    canvas = paled_canvas(topology.grid, labels, topology.label_names, view)

    def draw(panel: Drawing, scale: int) -> None:
        def pixels(points_m: ArrayLike) -> NDArray[np.float64]:
            return scale * view.pixels_at_m(topology.grid, points_m)

        at = pixels([node.point_m for node in routes.nodes])
        for edge in routes.edges:
            panel.line(at[[edge.first, edge.second]], colour=INK, width=_LINE)
        _draw_nodes(panel, topology, routes, at)
        for x, y in pixels([topology.place(n).anchor_m for n in routes.unreachable]).tolist():
            for slope in (-1, 1):
                ends = [[x - 6, y - 6 * slope], [x + 6, y + 6 * slope]]
                panel.line(ends, colour=ERROR, width=3)
        _draw_names(panel, topology, routes, at, pixels)

    line = (
        f"{len(routes.nodes)} nodes, {len(routes.edges)} edges, for a robot with a radius of "
        f"{routes.robot_radius_m:g} m"
    )
    entries = [*label_swatches(topology.label_names)]
    if routes.unreachable:
        entries.append(Swatch("cannot be reached", ERROR))
    if routes.closed:
        entries.append(Swatch("to keep out of", IGNORED, hatched=True))
    return figure_grid([Panel(canvas, line, draw)], legend=entries, long_side=1800)


def _draw_nodes(
    panel: Drawing, topology: TopologicalMap, routes: RouteGraph, at: NDArray[np.float64]
) -> None:
    colours = dict(zip(topology.label_names, label_colours(topology.label_names), strict=True))
    for node, (x, y) in zip(routes.nodes, at.tolist(), strict=True):
        label = topology.place(node.region).label
        if not node.is_anchor:
            panel.disc((x, y), diameter=_DOT, fill=INK, edge=INK)
        elif label == topology.doorway_label:
            panel.square((x, y), side=_DOOR, fill=colours[label], edge=INK)
        else:
            panel.disc((x, y), diameter=_DISC, fill=colours[label], edge=INK)


def _draw_names(
    panel: Drawing,
    topology: TopologicalMap,
    routes: RouteGraph,
    at: NDArray[np.float64],
    pixels: Callable[[ArrayLike], NDArray[np.float64]],
) -> None:
    """The names of places, of doorways only if the robot cannot or must not reach them."""
    doors, named = [], []
    for node, point in zip(routes.nodes, at, strict=True):
        region = topology.place(node.region)
        if not node.is_anchor or region.id in routes.unreachable:
            continue
        if region.label == topology.doorway_label:
            doors.append(point)
        else:
            named.append((region.name, point, INK))
    for numbers, colour in ((routes.unreachable, ERROR), (routes.closed, INK)):
        places = map(topology.place, numbers)
        named += [(item.name, pixels(item.anchor_m)[0], colour) for item in places]
    if not named:
        return
    names, discs, colours = zip(*named, strict=True)
    spots = name_spots(names, discs, doors, size=_NAME, radius=_DISC / 2)
    for name, colour, (x, y) in zip(names, colours, spots.tolist(), strict=True):
        panel.text(x, y, name, size=_NAME, centred=True, halo=2, colour=colour)
