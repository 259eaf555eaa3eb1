"""The output of commands about places: the topological map's files and its picture."""

import shlex
from pathlib import Path
from typing import Any

from pgm_places.io.output_set import OutputSet
from pgm_places.io.places.topology_files import (
    CHECK_FILE,
    TOPOLOGY_FILE,
    PlaceSettings,
    load_topology,
    read_own_names,
    save_settings,
    save_topology,
    write_checks,
)
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.report.drawing import Packing
from pgm_places.report.topology_pictures import count_line, marked_checks, topology_drawing
from pgm_places.topology.checks import doubtful_share, places_to_check
from pgm_places.topology.cuts import line_width_m
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.hidden_rooms import HiddenRooms, hidden_rooms
from pgm_places.topology.rules import TopologyOptions
from pgm_places.topology.topological_map import TopologicalMap

_MOST_SPLITS = 5


def write_places(
    files: OutputSet,
    title: str,
    rules: TopologyOptions,
    *,
    packing: Packing | None = None,
    picture: bool = True,
    **inputs: Any,
) -> TopologicalMap:
    """A topological map, written into the set, that keeps the ids of an earlier one in its folder.

    ``picture`` says whether it is drawn. ``inputs`` are those of ``topological_map``, the grid
    among them. The rules and the gates are written as well, so that the same places can be found
    from the labels again.
    """
    doorways = inputs.get("doorways")
    gates = doorways if doorways is not None and len(doorways) else None
    save_settings(files.stage, PlaceSettings(rules, gates))  # first: a huge map has room for it now
    earlier = (files.folder / TOPOLOGY_FILE).exists()
    topology = topological_map(
        rules=rules,
        correct=rules.correct,
        min_width_m=rules.min_width_m,
        known=load_topology(files.folder).known_places if earlier else None,
        own_names=read_own_names(files.folder),
        **inputs,
    )
    write_topology(
        files.stage, inputs["grid"], topology, title=title, packing=packing, picture=picture
    )
    return topology


def write_topology(
    folder: Path,
    grid: OccupancyGrid,
    topology: TopologicalMap,
    *,
    title: str | None = None,
    packing: Packing | None = None,
    picture: bool = True,
) -> list[Path]:
    """Write the topological map's files and, as its ``picture``, ``topology.png``; the paths.

    Where probabilities are known, ``check.csv`` lists the places to check first.

    Raises
    ------
    OutputError
        Where a file cannot be written.
    """
    written = []
    if picture:  # first: the largest is packed beside what follows
        drawing = topology_drawing(grid, topology, title=title)
        written.append((packing or Packing()).write(folder / "topology.png", drawing))
    written += save_topology(folder, topology)
    if places_to_check(topology):
        written.append(write_checks(folder / CHECK_FILE, topology))
    return written


def places_summary(topology: TopologicalMap, folder: Path | None = None) -> str:
    """How many places of each class, connections and corrections; what is in doubt, if known.

    With the ``folder`` that they lie in, also the places that look like several rooms.
    """
    n = len(topology.corrections)
    lines = [f"places: {count_line(topology)}; {n} correction{'' if n == 1 else 's'}"]
    doubt = doubt_summary(topology)
    lines += [] if doubt is None else [doubt]
    if folder is not None and (found := hidden_rooms(topology)):
        lines += [hidden_line(item) for item in found[:_MOST_SPLITS]]
        more = len(found) - _MOST_SPLITS
        lines += [f"and {more} more place{'' if more == 1 else 's'}"] if more > 0 else []
        example = shlex.join(["pgm-places", "split", str(folder), str(found[0].place.id)])
        lines.append(f"to split one along the lines in topology.png: {example}")
    return "\n".join(lines)


def hidden_line(item: HiddenRooms) -> str:
    """How many rooms a place looks like, how large they are, and how wide its openings."""
    sizes = ", ".join(f"{area_m2:.1f}" for area_m2 in item.areas_m2)
    widths = ", ".join(f"{line_width_m(line):.2f}" for line in item.lines_m)
    return (
        f"{item.place.name} looks like {item.count} rooms ({sizes} m²), with openings of {widths} m"
    )


def doubt_summary(topology: TopologicalMap) -> str | None:
    """One line: how much of the area is in doubt and where most of it lies; None if unknown."""
    share = doubtful_share(topology)
    if share is None:
        return None
    first = "; ".join(
        f"{check.place.name} ({check.doubtful_m2:.1f} m²"
        + (f" perhaps {check.second_label})" if check.second_label else ")")
        for check in marked_checks(topology)
    )
    return f"in doubt: {100 * share:.1f} % of the area" + (
        f"; check first: {first}" if first else ""
    )
