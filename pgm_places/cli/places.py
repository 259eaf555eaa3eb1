"""Commands about places: topology, export, where, and changes by hand: rename, merge and split."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import pgm_places as pp
from pgm_places.cli.arguments import Force, Out, Place, Places, Quiet, UnknownValue
from pgm_places.cli.declarations import Argument, GivenOptions, Option, option_flags
from pgm_places.cli.entry import EXIT_NOT_FOUND
from pgm_places.cli.inputs import read_labels, read_map
from pgm_places.cli.terminal import complain, make_progress, say, say_written
from pgm_places.errors import InputError
from pgm_places.options import AtLeastZero, option_values
from pgm_places.topology.rules import TopologyOptions

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pgm_places.graph.layout import GridLayout
    from pgm_places.spaces.doorways import Doorways
    from pgm_places.topology.topological_map import TopologicalMap


@option_flags("given", TopologyOptions, {"doorway_label": "--doorway"}, only_given=True)
def topology(
    labels_png: Annotated[Path, Argument("LABELS.png")],
    map_yaml: Annotated[Path, Argument("MAP.yaml")],
    out: Out,
    names_file: Annotated[Path | None, Option("--names")] = None,
    *,
    given: GivenOptions[TopologyOptions],
    propose_splits_m: AtLeastZero = 0.0,
    unknown_value: UnknownValue = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Find the places in a labelled map and their connections.

    For labels that 'label' wrote, the settings and gates that it left beside them are used instead
    of the defaults. Flags override both.

    Parameters
    ----------
    labels_png
        Label image, with its names file next to it.
    map_yaml
        The map it belongs to.
    names_file
        Names file; LABELS.yaml or labels.yaml by default.
    propose_splits_m
        List where places could be split at openings narrower than this (m), without splitting them.
    """
    from pgm_places.io.output_set import output_set
    from pgm_places.io.places.place_settings import PlaceSettings, load_settings
    from pgm_places.io.places.result_folder import OLD_FILES, SETTINGS_FILE, settings_path
    from pgm_places.labelers.labelled_places import LabelledCells
    from pgm_places.labelling.files import PLACES, SETTINGS, write_places
    from pgm_places.labelling.places import separating_gates
    from pgm_places.report.places_summary import places_summary

    progress = make_progress(quiet=quiet)
    with progress.stage("map and labels"):
        loaded = read_map(map_yaml, unknown_value, progress)
        names, labels = read_labels(labels_png, loaded.grid, names_file)
        settings = load_settings(labels_png.parent) or PlaceSettings(TopologyOptions())
        rules = given.over(settings.rules)
        cells = LabelledCells(
            loaded.grid,
            labels,
            names,
            *_probabilities(labels_png, names, loaded.grid),
            separating_gates(settings.doorways, rules),
        )
    if (path := settings_path(labels_png.parent)).exists():
        say(_settings_line(path, rules, cells.doorways))
    elif given.values.get("doorways") == "gates":
        progress.warn(f"--doorways gates: there is no {SETTINGS_FILE} with gates beside the labels")
    with (
        output_set(
            out, "topology", names=(*PLACES, *SETTINGS), force=force, replaces=OLD_FILES
        ) as files,
        progress.stage("places"),
    ):
        places = write_places(files, loaded.name, cells, rules)
    say(places_summary(places, out))
    if propose_splits_m:
        for line in _proposals(places, propose_splits_m):
            say(line)
    say_written(files)


def _probabilities(
    labels_png: Path, names: Sequence[str], grid: "pp.OccupancyGrid"
) -> "tuple[NDArray[np.float32] | None, GridLayout | None]":
    """The probabilities beside labels, and their cells; of labels changed since, none are known."""
    from pgm_places.graph.layout import GridLayout
    from pgm_places.io.output_set import is_as_written
    from pgm_places.io.places.topology_files import load_probabilities

    if not is_as_written(labels_png):
        return None, None
    layout = GridLayout.of_map(grid)
    return load_probabilities(labels_png.parent, names, layout), layout


def _settings_line(path: Path, rules: TopologyOptions, doorways: "Doorways | None") -> str:
    """Where the settings are from, and which of them depart from the defaults."""
    usual = option_values(TopologyOptions())
    changed = [
        f"{key} = {value}" for key, value in option_values(rules).items() if value != usual[key]
    ]
    gates = f"; {len(doorways)} gates" if doorways else ""
    return f"settings of {path}: {', '.join(changed) or 'the defaults'}{gates}"


def _proposals(topology: "TopologicalMap", narrower_than_m: float) -> list[str]:
    """A line per possible split."""
    from pgm_places.topology.cuts import line_width_m
    from pgm_places.topology.hidden_rooms import propose_splits

    lines = []
    for split in propose_splits(topology, narrower_than_m):
        openings = [
            f"({(x0 + x1) / 2:.2f}, {(y0 + y1) / 2:.2f}), "
            f"{line_width_m(((x0, y0), (x1, y1))):.2f} m wide"
            for (x0, y0), (x1, y1) in split.lines_m
        ]
        larger, smaller = split.areas_m2
        lines.append(
            f"possible split: {split.place.name} ({larger:.1f} and {smaller:.1f} m²) at "
            + "; and at ".join(openings)
        )
    return lines or [
        f"no split proposed: no place is divided by constrictions under {narrower_than_m:g} m, "
        "alone or two or three together"
    ]


def export(
    folder: Places,
    to: str,
    out: Annotated[Path | None, Option("--out", "-o")] = None,
    values: Annotated[list[str] | None, Option("--set")] = None,
    robot_radius_m: AtLeastZero | None = None,
    keep_out: list[str] | None = None,
    map_yaml: Annotated[Path | None, Option("--map")] = None,
    force: Force = False,
) -> None:
    """Write the places for Nav2, QGIS, Foxglove and other tools.

    Parameters
    ----------
    to
        nav2 (everything Nav2 needs), nav2-route, coverage, lif, map, regions, zones, keepout,
        speed-percent, speed-m-s, binary, graphml, node-link, dot, geotiff or mcap.
    out
        Folder for the files; DIR by default.
    values
        Mask value of a class or a place: room=100, or with speed-m-s and nav2 corridor=0.8 (m/s).
        Repeatable.
    robot_radius_m
        The robot's radius (m), 0.2 by default. For nav2, nav2-route and lif: passages too narrow
        for it are omitted; unreachable places are listed. For coverage: polygons keep it from
        obstacles. For keepout: areas grow by it (0 by default).
    keep_out
        For nav2 and nav2-route: a class or a place to keep out of. Repeatable.
    map_yaml : MAP.yaml
        For nav2 and map: the map; by default the one that was labelled.
    """
    from pgm_places.io.output_set import output_set
    from pgm_places.io.places.exports import export as write_export
    from pgm_places.io.places.exports import write_cleaned_map
    from pgm_places.io.places.topology_files import load_named_topology

    topology = load_named_topology(folder)
    with output_set(out or folder, f"export {to}", force=force, shared=True) as files:
        if keep_out and to not in ("nav2", "nav2-route"):
            raise InputError(f"the export {to!r} takes no --keep-out; nav2 and nav2-route do")
        if map_yaml and to not in ("nav2", "map"):
            raise InputError(f"the export {to!r} takes no --map; nav2 and map do")
        if to == "nav2":
            topology.ids_of(keep_out or ())  # a slip is said before anything is read
            for_nav2 = {
                "speeds_m_s": _values(values or ()),
                "grid": _map_for_nav2(folder, map_yaml),
            }
            _write_routes(
                files.stage, topology, robot_radius_m, out or folder, keep_out or (), for_nav2
            )
        elif to == "map":
            grid = _map_for_nav2(folder, map_yaml)
            if grid is None:
                raise InputError(f"{folder}: the map is not where it was labelled; pass --map")
            write_cleaned_map(files.stage, topology, grid)
        elif to == "nav2-route" and not values:
            _write_routes(files.stage, topology, robot_radius_m, out or folder, keep_out or ())
        else:
            write_export(
                topology,
                to,
                files.stage,
                values=_values(values or ()) or None,
                robot_radius_m=robot_radius_m,
                name=folder.resolve().name,
                lies_in=out or folder,
            )
    say_written(files)


def _write_routes(
    folder: Path,
    topology: "TopologicalMap",
    robot_radius_m: float | None,
    lies_in: Path,
    keep_out: Sequence[str],
    for_nav2: dict[str, Any] | None = None,
) -> None:
    """The route graph and its picture; says what the robot cannot reach."""
    from pgm_places.pictures.route_picture import routes_summary, write_routes
    from pgm_places.topology.route_graph import ROBOT_RADIUS_M

    radius = ROBOT_RADIUS_M if robot_radius_m is None else robot_radius_m
    routes = write_routes(
        folder,
        topology,
        robot_radius_m=radius,
        keep_out=keep_out,
        for_nav2=for_nav2,
        lies_in=lies_in,
    )
    say(routes_summary(topology, routes))


def _map_for_nav2(folder: Path, given: Path | None) -> "pp.OccupancyGrid | None":
    """The map that was labelled, or the one that was given instead; says what is amiss."""
    from pgm_places.labelling.files import labelled_map

    path = given or labelled_map(folder)
    if path is None:
        complain("the map is not copied, because it is not where it was labelled; pass --map")
        return None
    grid = pp.load_map(path).grid
    if grid.yaw_rad:
        complain(
            f"the origin of the map is turned by {grid.yaw_rad:g} rad, which Nav2's costmaps and "
            "filters ignore: save the map with a yaw of 0"
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


def where(
    folder: Places, x: Annotated[float, Argument("X")], y: Annotated[float, Argument("Y")]
) -> None:
    """Show the place at a position. The exit code is 1 if there is none.

    Parameters
    ----------
    x, y
        Position in the map frame (m).
    """
    from pgm_places.io.places.topology_files import load_named_topology

    topology = load_named_topology(folder)
    region = topology.region_at(x, y)
    if region is None:
        say("no place at this position")
        raise SystemExit(EXIT_NOT_FOUND)
    near = ", ".join(other.name for other in topology.neighbours(region.id)) or "nothing"
    confidence = "" if region.confidence is None else f", confidence {region.confidence:.2f}"
    numbered = f"{region.label} {region.id}"
    own = "" if region.name == numbered else f"{region.name}: "
    say(f"{own}{numbered} ({region.area_m2:.1f} m²{confidence})")
    say(f"next to: {near}")


def rename(folder: Places, place: Place, name: Annotated[str, Argument("NAME")]) -> None:
    """Give a place a name of your own, in place_names.yaml.

    Parameters
    ----------
    name
        Its new name.
    """
    from pgm_places.io.places.topology_files import load_named_topology, write_own_name
    from pgm_places.topology.place_edits import renamed

    topology = load_named_topology(folder)
    number = topology.place(_key(place)).id
    renamed(topology, {number: name})  # a name that another place has is refused here
    path = write_own_name(folder, number, name)
    say(f"place {number} is called {name!r} (in {path})")


def merge(folder: Places, first: Place, second: Annotated[str, Argument("OTHER")]) -> None:
    """Merge two places into one. It keeps the id and the name of the first.

    Parameters
    ----------
    second
        The place to merge into the first.
    """
    from pgm_places.io.places.topology_files import load_named_topology
    from pgm_places.topology.place_edits import merged

    _write(folder, merged(load_named_topology(folder), _key(first), _key(second)), "merge")


def split(
    folder: Places,
    place: Annotated[str | None, Argument("PLACE")] = None,
    points: Annotated[list[float] | None, Argument("[X Y [X2 Y2]]")] = None,
) -> None:
    """Split a place: along a line, at a point, or into its rooms. Without a place, split all.

    A line is a plain cut: the parts touch, without a doorway between. A point splits the place
    where it is narrowest. The rooms are those that 'label' and check.csv propose.

    Parameters
    ----------
    place
        Its id or name; none to split every place that could be several rooms.
    points
        A point, or the ends of a line (m); none to split it into the rooms that it looks like.
    """
    from pgm_places.io.places.topology_files import load_named_topology
    from pgm_places.topology import place_edits

    topology = load_named_topology(folder)
    if place is None:
        edited = place_edits.split_all_apart(topology)
    elif not points:
        edited = place_edits.split_apart(topology, _key(place))
    elif len(points) == 2:
        edited = place_edits.split_at(topology, _key(place), points)
    elif len(points) == 4:
        edited = place_edits.split_across(topology, _key(place), points[:2], points[2:])
    else:
        raise InputError(
            f"split takes a point X Y, a line X1 Y1 X2 Y2 or nothing, got {len(points)} numbers"
        )
    _write(folder, edited, "split")


def _key(text: str) -> int | str:
    """A place by its id or name."""
    return int(text) if text.isdecimal() else text


def _write(folder: Path, topology: "TopologicalMap", by: str) -> None:
    from pgm_places.io.output_set import output_set
    from pgm_places.io.places.place_settings import PlaceSettings, load_settings, save_settings
    from pgm_places.io.places.result_folder import (
        OLD_FILES,
        OLD_PLACES_FILE,
        PLACES_FILE,
        settings_path,
    )
    from pgm_places.io.staging import file_names
    from pgm_places.labelling.files import PLACES, write_topology
    from pgm_places.report.places_summary import places_summary

    # The command that wrote the folder goes on owning its other files.
    with output_set(folder, by, force=True, shared=True, replaces=OLD_FILES) as files:
        if settings_path(folder).name == PLACES_FILE:  # of an earlier version: its name is taken
            save_settings(files.stage, load_settings(folder) or PlaceSettings(TopologyOptions()))
        names = {*file_names(folder.resolve()), *PLACES} - {OLD_PLACES_FILE}
        write_topology(
            files.stage, topology.grid, topology, title=folder.name, page={"names": names}
        )
    say(places_summary(topology, folder))
    say_written(files)
