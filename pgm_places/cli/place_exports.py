"""Exports of places as the command line asks for them."""

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
    asked: ExportRequest, stage: Path, folder: Path, lies_in: Path, topology: "TopologicalMap"
) -> str:
    """Write the files of places in a folder, which will lie in ``lies_in``; a summary.

    Raises
    ------
    InputError
        A format, name or value that does not fit.
    OutputError
        A file cannot be written.
    """
    from pgm_places.io.places.exports import EXPORTS, OF_RADIUS, export, write_cleaned_map
    from pgm_places.io.places.filter_masks import TYPES

    if asked.to not in (known := ["nav2", "map", *OF_RADIUS, *EXPORTS, *TYPES]):
        raise InputError(f"there is no export called {asked.to!r}. {nearest_name(asked.to, known)}")
    values = _values(asked.values)
    if asked.to == "nav2":
        topology.ids_of(asked.keep_out)  # a wrong name is refused before anything is read
        grid = _map(asked, folder)
        return _routes(asked, stage, topology, lies_in, {"speeds_m_s": values, "grid": grid})
    if asked.to == "map":
        grid = _map(asked, folder)
        if grid is None:
            raise InputError(f"{folder}: the map is not where it was labelled; pass --map")
        write_cleaned_map(stage, topology, grid)
    elif asked.to == "nav2-route" and not values:
        return _routes(asked, stage, topology, lies_in)
    else:
        export(
            topology,
            asked.to,
            stage,
            values=values or None,
            robot_radius_m=asked.robot_radius_m,
            name=folder.resolve().name,
            lies_in=lies_in,
        )
    return ""


def _routes(
    asked: ExportRequest,
    stage: Path,
    topology: "TopologicalMap",
    lies_in: Path,
    for_nav2: dict[str, Any] | None = None,
) -> str:
    """Write the route graph and its picture; its size, and what the robot cannot reach."""
    from pgm_places.pictures.route_picture import routes_summary, write_routes
    from pgm_places.topology.route_graph import ROBOT_RADIUS_M

    routes = write_routes(
        stage,
        topology,
        robot_radius_m=ROBOT_RADIUS_M if asked.robot_radius_m is None else asked.robot_radius_m,
        keep_out=asked.keep_out,
        for_nav2=for_nav2,
        lies_in=lies_in,
    )
    return routes_summary(topology, routes)


def _map(asked: ExportRequest, folder: Path) -> "pp.OccupancyGrid | None":
    """The map that was labelled, or the one that was given instead; says what is amiss."""
    from pgm_places.labelling.files import labelled_map

    path = labelled_map(folder) if asked.map_yaml is None else Path(asked.map_yaml)
    if path is None:
        complain("the map is not copied, because it is not where it was labelled; pass --map")
        return None
    grid = pp.load_map(path).grid
    if grid.yaw_rad:
        complain(
            f"the origin of the map is turned by {grid.yaw_rad:g} rad, which Nav2's costmaps "
            "and filters ignore: save the map with a yaw of 0"
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
