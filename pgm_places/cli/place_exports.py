"""Exports of places for the commands ``export`` and ``rename``."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pgm_places as pp
from pgm_places.cli.terminal import complain
from pgm_places.errors import InputError, nearest_name
from pgm_places.io.places.result_folder import ExportRequest

if TYPE_CHECKING:
    from pgm_places.topology.topological_map import TopologicalMap


def write_export(
    request: ExportRequest, stage: Path, folder: Path, lies_in: Path, topology: "TopologicalMap"
) -> str:
    """Write an export to ``stage``, to be moved to ``lies_in``; a summary."""
    from pgm_places.io.places.exports import EXPORTS, OF_RADIUS, export, write_cleaned_map
    from pgm_places.io.places.filter_masks import TYPES

    if request.to not in (known := ["nav2", "map", *OF_RADIUS, *EXPORTS, *TYPES]):
        raise InputError(
            f"there is no export called {request.to!r}. {nearest_name(request.to, known)}; "
            "'pgm-places export --help' describes them"
        )
    values = _values(request.values)
    if request.to == "nav2":
        topology.ids_of(request.keep_out)  # wrong names are reported before anything is read
        grid = _map(request, folder)
        return _routes(request, stage, topology, lies_in, {"speeds_m_s": values, "grid": grid})
    if request.to == "map":
        grid = _map(request, folder)
        if grid is None:
            raise InputError(f"{folder}: the labelled map was moved or deleted; pass --map")
        write_cleaned_map(stage, topology, grid)
    elif request.to == "nav2-route" and not values:
        return _routes(request, stage, topology, lies_in)
    else:
        export(
            topology,
            request.to,
            stage,
            values=values or None,
            robot_radius_m=request.robot_radius_m,
            name=folder.resolve().name,
            lies_in=lies_in,
        )
    return ""


def _routes(
    request: ExportRequest,
    stage: Path,
    topology: "TopologicalMap",
    lies_in: Path,
    for_nav2: dict[str, Any] | None = None,
) -> str:
    """Write the route graph and its picture; a summary with unreachable places."""
    from pgm_places.pictures.route_picture import routes_summary, write_routes
    from pgm_places.topology.route_graph import ROBOT_RADIUS_M

    routes = write_routes(
        stage,
        topology,
        robot_radius_m=ROBOT_RADIUS_M if request.robot_radius_m is None else request.robot_radius_m,
        keep_out=request.keep_out,
        for_nav2=for_nav2,
        lies_in=lies_in,
    )
    return routes_summary(topology, routes)


def _map(request: ExportRequest, folder: Path) -> "pp.OccupancyGrid | None":
    """The labelled map, or the map of ``--map``; prints a warning about problems."""
    from pgm_places.labelling.files import labelled_map

    path = labelled_map(folder) if request.map_yaml is None else Path(request.map_yaml)
    if path is None:
        complain("the map is not copied: it was moved or deleted; pass --map")
        return None
    grid = pp.load_map(path).grid
    if grid.yaw_rad:
        complain(
            f"the map is rotated by {grid.yaw_rad:g} rad, which Nav2's costmaps and filters "
            "ignore: save the map with a yaw of 0"
        )
    return grid


def _values(texts: Sequence[str]) -> dict[str, float]:
    """``["room=100"]`` as ``{"room": 100.0}``."""
    values = {}
    for text in texts:
        name, equals, number = text.rpartition("=")
        if not equals or not name or not re.fullmatch(r"[0-9]{1,9}(\.[0-9]{1,9})?", number.strip()):
            raise InputError(f"--set expects NAME=NUMBER, such as room=100, got {text!r}")
        values[name.strip()] = float(number)
    return values
