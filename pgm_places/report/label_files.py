"""A labelled map and its places as files, known beforehand, some of which may be left out."""

import shlex
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import row_blocks
from pgm_places.errors import InputError, OutputError, nearest_name
from pgm_places.io.atomic import write_bytes, write_json
from pgm_places.io.input_file import read_json
from pgm_places.io.maps.label_image import save_labels
from pgm_places.io.maps.map_server import MapFile
from pgm_places.io.maps.raster_image import raster_png
from pgm_places.io.output_set import OutputSet
from pgm_places.io.places import topology_files
from pgm_places.io.places.place_settings import PlaceSettings, save_settings
from pgm_places.labelers.label_map import LabelledPlaces
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.pictures.drawing import Packing
from pgm_places.pictures.topology_pictures import count_line, marked_checks, topology_drawing
from pgm_places.topology.checks import doubtful_share, places_to_check
from pgm_places.topology.cuts import line_width_m
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.hidden_rooms import HiddenRooms, hidden_rooms
from pgm_places.topology.rules import TopologyOptions
from pgm_places.topology.topological_map import TopologicalMap

_NONE = "none"


@dataclass(frozen=True)
class Outputs:
    """The files that may be left out.

    Parameters
    ----------
    pictures : bool
        ``overview.png``, ``topology.png`` and, in a batch, ``thumbnail.png``: for people.
    probabilities : bool
        ``probability_<label>.png``.
    """

    pictures: bool = True
    probabilities: bool = True

    @classmethod
    def named(cls, text: str) -> Self:
        """Those that a list with commas names; ``none`` names none.

        Raises
        ------
        InputError
            There is no such kind of file.

        Examples
        --------
        >>> Outputs.named("pictures"), Outputs.named("none").probabilities
        (Outputs(pictures=True, probabilities=False), False)
        """
        names = [name.strip() for name in text.split(",")]
        known = [*cls.__dataclass_fields__, _NONE]
        for name in names:
            if name not in known or (name == _NONE and len(names) > 1):
                raise InputError(
                    f"--outputs takes pictures, probabilities, both with a comma between, or none; "
                    f"got {text!r}. {nearest_name(name, known)}"
                )
        return cls(**{name: name in names for name in cls.__dataclass_fields__})


COMPARISON = ("results.json", "report.html")

DEMO = ("map.yaml", "map.png", "labels.png", "labels.yaml", "demo.toml", *COMPARISON)

PLACES = ("topology.json", "regions.png", "regions.geojson", "topology.png")

TRACK = ("beliefs.csv", "path.png", "beliefs.png", "report.html")

LIVE = ("places.jsonl", "check.csv", *PLACES)

_PICTURES = ("overview.png", "topology.png")

SETTINGS = ("places.json", "gate_places.png")


def label_names(labels: Iterable[str], outputs: Outputs | None = None) -> tuple[str, ...]:
    """The files of a labelled map with these labels, its places included."""
    outputs = outputs or Outputs()
    probabilities = map(topology_files.probability_file, labels) if outputs.probabilities else ()
    files = ("labels.png", "labels.yaml", "overview.png", "summary.json", "check.csv")
    names = (*files, *probabilities, *PLACES, *SETTINGS)
    return names if outputs.pictures else tuple(name for name in names if name not in _PICTURES)


SUMMARY_FILE = "summary.json"
MAX_BYTES = 64 << 20


def write_labels(
    result: LabelledPlaces,
    source: MapFile,
    folder: Path,
    *,
    packing: Packing | None = None,
    outputs: Outputs | None = None,
) -> list[Path]:
    """Write everything that ``pgm-places label`` promises; the paths written.

    ``labels.png`` and ``labels.yaml`` on the map image's own raster; ``probability_<label>.png``
    per label (0 to 255 for 0 to 1, 0 outside the free cells); ``overview.png`` to look at;
    ``summary.json`` for programs. ``outputs`` leaves some out.
    """
    outputs = outputs or Outputs()
    for name in result.label_names:
        if "/" in name or "\\" in name or name.startswith("."):
            raise OutputError(f"label {name!r} cannot be part of a file name; rename it")
    labels_path = folder / "labels.png"
    save_labels(labels_path, result.labels, result.label_names)
    written = [labels_path, folder / "labels.yaml"]
    if outputs.probabilities:
        written += _write_probabilities(result, folder)
    if outputs.pictures:
        written.append(_write_overview(result, source, folder, packing or Packing()))
    record = {
        "map": str(source.yaml_path),
        "method": result.method,
        "status": str(result.labeling.status),
        "status_meaning": result.labeling.status.meaning,
        "area_m2": result.shares(),
        "unentered_m2": 0.0 if result.unentered is None else result.unentered.area_m2,
        "score": result.labeling.score,
        "bound": result.labeling.bound,
        "warnings": [*source.warnings, *result.warnings],
    }
    return [*written, write_json(folder / SUMMARY_FILE, record, indent=2, allow_nan=True)]


def _write_overview(
    result: LabelledPlaces, source: MapFile, folder: Path, packing: Packing
) -> Path:
    from pgm_places.pictures.map_pictures import overview

    drawing = overview(
        result.grid,
        result.labels,
        result.label_names,
        beliefs=result.labeling.beliefs,
        layout=result.layout,
        title=f"{source.name}: {result.method}",
    )
    return packing.write(folder / "overview.png", drawing)


def labelled_map(folder: Path) -> Path | None:
    """The map that was labelled into a folder; None where that is unknown or it has gone.

    A relative path is looked up where the command runs, as it was when the map was labelled.
    """
    path = folder / SUMMARY_FILE
    if not path.is_file():
        return None
    record = read_json(path, InputError, "a summary of 'pgm-places label'", max_bytes=MAX_BYTES)
    name = record.get("map") if isinstance(record, dict) else None
    path_of_map = Path(name) if isinstance(name, str) else None
    return path_of_map if path_of_map is not None and path_of_map.is_file() else None


def _write_probabilities(result: LabelledPlaces, folder: Path) -> list[Path]:
    from PIL import Image

    beliefs = result.labeling.beliefs
    if beliefs is None:
        return []
    written = []
    for k, name in enumerate(result.label_names):
        raster = result.on_map(_in_bytes(beliefs[:, k]), 0)
        size = (raster.shape[1], raster.shape[0])
        # Row 0 of an image is its top: -1 reads the raster, which is not copied, from its end.
        picture = Image.frombuffer("L", size, raster, "raw", "L", 0, -1)
        path = folder / topology_files.probability_file(name)
        written.append(write_bytes(path, raster_png(picture)))
    return written


def _in_bytes(shares: NDArray[np.floating[Any]]) -> NDArray[np.uint8]:
    """(N,) shares from 0 to 1 as 0 to 255, piece by piece: temporary copies take four times it."""
    levels = np.empty(len(shares), np.uint8)
    for some in row_blocks(len(shares)):
        levels[some] = np.round(255 * shares[some])
    return levels


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
    settings = PlaceSettings(rules, gates)
    save_settings(files.stage, settings)  # first: a huge map has room for it now
    earlier = (files.folder / topology_files.TOPOLOGY_FILE).exists()
    topology = topological_map(
        rules=rules,
        correct=rules.correct,
        min_width_m=rules.min_width_m,
        known=topology_files.load_topology(files.folder).known_places if earlier else None,
        own_names=topology_files.read_own_names(files.folder),
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
    written += topology_files.save_topology(folder, topology)
    if places_to_check(topology):
        written.append(topology_files.write_checks(folder / topology_files.CHECK_FILE, topology))
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
