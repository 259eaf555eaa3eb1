"""The commands topology, export, where, rename, merge and split."""

import shlex
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import pgm_places as pp
from pgm_places.cli.arguments import (
    Force,
    Out,
    Place,
    Places,
    Quiet,
    UnknownValue,
    metres,
    place_key,
    read_labels,
    read_map,
)
from pgm_places.cli.declarations import Argument, GivenOptions, Option, option_flags
from pgm_places.cli.entry import EXIT_NOT_FOUND
from pgm_places.cli.terminal import complain, make_progress, say, say_next, say_written
from pgm_places.errors import InputError, OutputError
from pgm_places.io.places.result_folder import MANIFEST_FILE, NAMES_FILE
from pgm_places.options import AtLeastZero, option_values
from pgm_places.topology.rules import TopologyOptions

if TYPE_CHECKING:
    from pgm_places.io.output_set import OutputSet
    from pgm_places.labelling.files import PageFacts
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

    For labels written by 'label', its settings and gates are used instead of the defaults. Flags
    override both.

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
        rules = given.applied_to(settings.rules)
        cells = LabelledCells(
            loaded.grid,
            labels,
            names,
            **_probabilities(labels_png, names, loaded.grid),
            doorways=separating_gates(settings.doorways, rules),
        )
    if (path := settings_path(labels_png.parent)).exists():
        say(_settings_line(path, rules, cells.doorways))
    elif given.values.get("doorways") == "gates":
        progress.warn(f"--doorways gates: no {SETTINGS_FILE} with gates next to the labels")
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
) -> dict[str, Any]:
    """The probabilities in the folder of the labels; none if the labels were changed since."""
    from pgm_places.graph.layout import GridLayout
    from pgm_places.io.output_set import is_as_written
    from pgm_places.io.places.topology_files import load_hall, load_probabilities

    if not is_as_written(labels_png):
        return {}
    folder, layout = labels_png.parent, GridLayout.of_map(grid)
    beliefs = load_probabilities(folder, names, layout)
    hall = None if beliefs is None else load_hall(folder, names, layout)
    return {"beliefs": beliefs, "layout": layout, "hall": hall}


def _settings_line(path: Path, rules: TopologyOptions, doorways: "Doorways | None") -> str:
    """The file of the settings, and the settings that differ from the defaults."""
    usual = option_values(TopologyOptions())
    changed = [
        f"{key} = {value}" for key, value in option_values(rules).items() if value != usual[key]
    ]
    gates = f"; {len(doorways)} gates" if doorways else ""
    return f"settings of {path}: {', '.join(changed) or 'the defaults'}{gates}"


def _proposals(topology: "TopologicalMap", narrower_than_m: float) -> list[str]:
    """A line per possible split."""
    from pgm_places.topology.checks import propose_splits
    from pgm_places.topology.cuts import line_width_m

    lines = []
    for split in propose_splits(topology, narrower_than_m):
        openings = [
            f"({(x0 + x1) / 2:.2f}, {(y0 + y1) / 2:.2f}), "
            f"{line_width_m(((x0, y0), (x1, y1))):.2f} m wide"
            for (x0, y0), (x1, y1) in split.lines_m
        ]
        larger, smaller = split.areas_m2
        areas, where = f"{larger:.1f} and {smaller:.1f} m²", "; and at ".join(openings)
        lines.append(f"possible split: {split.place.name} ({areas}) at {where}")
    none = "no split proposed: no place is divided by up to three constrictions under"
    return lines or [f"{none} {narrower_than_m:g} m"]


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
        nav2 (everything Nav2 needs: route graph, masks, waypoints), nav2-route, coverage,
        lif (VDA 5050 layout), map, regions, zones, keepout, speed-percent, speed-m-s, binary,
        graphml, node-link, dot, geotiff or mcap.
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
        For nav2 and map: the map; by default the labelled one.
    """
    from pgm_places.cli.place_exports import write_export
    from pgm_places.io.output_set import output_set
    from pgm_places.io.places.result_folder import ExportRequest, record_exports
    from pgm_places.io.places.topology_files import load_named_topology

    topology, target = load_named_topology(folder), out or folder
    inside = target.resolve() == folder.resolve()
    request = ExportRequest(
        to,
        tuple(values or ()),
        robot_radius_m,
        tuple(keep_out or ()),
        None if map_yaml is None else str(map_yaml),
        None if inside else str(target.resolve()),
    )
    with output_set(target, f"export {to}", force=force, shared=True) as files:
        summary = write_export(request, files.stage, folder, target, topology)
        if inside:
            record_exports(files.stage, folder, [request])
    if not inside:
        try:
            with output_set(folder, "export", shared=True, force=True, keeps_owners=True) as record:
                record_exports(record.stage, folder, [request])
        except (InputError, OutputError) as error:
            complain(f"{error}; 'rename' will not know of the export in {target}")
    if summary:
        say(summary)
    say_written(files)
    if to == "nav2":
        launch = shlex.join(["ros2", "launch", str(target / "bringup.launch.py")])
        servers = shlex.join(["ros2", "launch", str(target / "places.launch.py")])
        say_next(
            f"{launch} params_file:=my_nav2_params.yaml  # Kilted and later: Nav2 with all of it",
            f"{servers}  # Humble, Jazzy: beside a running Nav2 with nav2_params.yaml merged in",
        )


def where(
    folder: Places,
    place: Annotated[str, Argument("PLACE|X")],
    y: Annotated[float | None, Argument("Y")] = None,
) -> None:
    """Show the place at a position, or where a place is. The exit code is 1 if there is none.

    Parameters
    ----------
    place
        Name or id of a place; or a position in the map frame (m), with Y.
    y
        Position in the map frame (m).
    """
    from pgm_places.io.places.topology_files import load_named_topology
    from pgm_places.topology.regions import extent

    topology = load_named_topology(folder)
    region = topology.place(place_key(place)) if y is None else topology.region_at(metres(place), y)
    if region is None:
        say("no place at this position")
        raise SystemExit(EXIT_NOT_FOUND)
    near = ", ".join(other.name for other in topology.neighbours(region.id)) or "nothing"
    confidence = "" if region.confidence is None else f", confidence {region.confidence:.2f}"
    numbered = f"{region.label} {region.id}"
    own = "" if region.name == numbered else f"{region.name}: "
    say(f"{own}{numbered} ({region.area_m2:.1f} m²{confidence})")
    say(f"next to: {near}")
    x_m, y_m = region.anchor_m
    say(f"anchor: {x_m:.2f} {y_m:.2f} (clearance {region.clearance_m:.2f} m)")
    say(f"extent: {extent(region)}")


def rename(folder: Places, place: Place, name: Annotated[str, Argument("NAME")]) -> None:
    """Rename a place in all files of its folder.

    Either all files change or none. Exports in the folder are updated.

    Parameters
    ----------
    name
        Its new name.
    """
    from pgm_places.batch.batch_folder import rewrite_row, write_check_first
    from pgm_places.cli.place_exports import write_export
    from pgm_places.io.output_set import is_as_written
    from pgm_places.io.places.result_folder import record_exports, recorded_exports
    from pgm_places.io.places.topology_files import load_named_topology, write_own_name
    from pgm_places.io.staging import file_names
    from pgm_places.topology.place_edits import renamed

    topology = load_named_topology(folder)
    region = topology.place(place_key(place))
    edited = renamed(topology, {region.id: name})  # fails if another place has this name
    exports = [request.renamed(region.name, name) for request in recorded_exports(folder)]
    changed = []
    with _edited(folder, edited, "rename") as files:
        own = {*file_names(files.stage)}
        for request in exports:
            if request.out is None and (
                summary := write_export(request, files.stage, folder, folder, edited)
            ):
                say(summary)
        if exports:
            record_exports(files.stage, folder, exports)
        is_first = write_check_first(folder, files.stage, region.name, name)
        write_own_name(folder, region.id, name, into=files.stage)
        for file in sorted({*file_names(files.stage)} - own - {NAMES_FILE, MANIFEST_FILE}):
            if (folder / file).is_file() and not is_as_written(folder / file, folder):
                (files.stage / file).unlink()
                changed.append(file)
    if is_first:
        try:
            rewrite_row(folder)
        except OutputError as error:
            complain(f"{error}; the index of all maps still has the old name")
    say(f"renamed place {region.id} to {name!r} in {folder}")
    away = [
        f"{request.to} in {request.out}"
        for request in exports
        if request.out and Path(request.out).is_dir()
    ]
    if away:
        complain(f"exports in other folders still have the old name: {', '.join(away)}")
    for file in changed:
        complain(f"{folder / file} was changed since it was exported and still has the old name")


def merge(folder: Places, first: Place, second: Annotated[str, Argument("OTHER")]) -> None:
    """Merge two places into one. The first keeps its id and name.

    Parameters
    ----------
    second
        The place to merge into the first.
    """
    from pgm_places.io.places.topology_files import load_named_topology
    from pgm_places.topology.place_edits import merged

    topology = load_named_topology(folder)
    _write(folder, topology, merged(topology, place_key(first), place_key(second)), "merge")


def split(
    folder: Places,
    place: Annotated[str | None, Argument("PLACE")] = None,
    points: Annotated[list[float] | None, Argument("[X Y [X2 Y2]]")] = None,
) -> None:
    """Split a place: along a line, at a point, or into its rooms. Without a place, split all.

    A line is a plain cut, without a doorway. A point splits the place at the narrowest opening
    nearby. Without points, the place is split into the rooms suggested by 'label' (see check.csv).

    Parameters
    ----------
    place
        Its id or name; without it, every place with suggested rooms is split.
    points
        A point, or the ends of a line (m).
    """
    from pgm_places.io.places.topology_files import load_named_topology
    from pgm_places.topology import place_edits

    topology = load_named_topology(folder)
    if place is None:
        edited = place_edits.split_all_apart(topology)
    elif not points:
        edited = place_edits.split_apart(topology, place_key(place))
    elif len(points) == 2:
        edited = place_edits.split_at(topology, place_key(place), points)
    elif len(points) == 4:
        edited = place_edits.split_across(topology, place_key(place), points[:2], points[2:])
    else:
        raise InputError(
            f"split expects a point X Y, a line X1 Y1 X2 Y2 or nothing, got {len(points)} numbers"
        )
    _write(folder, topology, edited, "split")


def _write(folder: Path, before: "TopologicalMap", after: "TopologicalMap", by: str) -> None:
    from pgm_places.report.places_summary import edit_summary, places_summary

    with _edited(folder, after, by) as files:
        pass
    say(f"{edit_summary(before, after)}\n{places_summary(after, folder)}")
    say_written(files)


@contextmanager
def _edited(folder: Path, topology: "TopologicalMap", by: str) -> "Iterator[OutputSet]":
    """The output files of edited places; the caller may add others."""
    from pgm_places.io.output_set import output_set
    from pgm_places.io.places.place_settings import PlaceSettings, load_settings, save_settings
    from pgm_places.io.places.result_folder import (
        OLD_FILES,
        OLD_PLACES_FILE,
        PLACES_FILE,
        settings_path,
    )
    from pgm_places.io.staging import file_names
    from pgm_places.labelling.files import PLACES, label_record, labelled_map, write_topology
    from pgm_places.pictures.map_page import earlier_title

    # A file stays owned by the command that wrote it first.
    with output_set(
        folder, by, force=True, shared=True, replaces=OLD_FILES, keeps_owners=True
    ) as files:
        if settings_path(folder).name == PLACES_FILE:  # of an earlier version, with another meaning
            save_settings(files.stage, load_settings(folder) or PlaceSettings(TopologyOptions()))
        names = {*file_names(folder.resolve()), *PLACES} - {OLD_PLACES_FILE}
        page: PageFacts = {"names": names, "warnings": label_record(folder).get("warnings", ())}
        title = earlier_title(folder) or folder.resolve().name
        grid, path = topology.grid, labelled_map(folder)
        if path is not None:
            page["map_name"], source = path.name, pp.load_map(path)
            if source.grid.frame == grid.frame and source.grid.shape == grid.shape:
                grid = source.grid  # includes the walls, for the pictures
        write_topology(files.stage, grid, topology, title=title, page=page)
        yield files
