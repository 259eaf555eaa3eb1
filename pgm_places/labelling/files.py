"""Writing the files of a labelled map: labels, places, pictures and record."""

from collections.abc import Collection, Iterable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import row_blocks
from pgm_places.errors import InputError, OutputError
from pgm_places.io.atomic import write_bytes, write_json
from pgm_places.io.input_file import read_json
from pgm_places.io.maps.label_image import save_labels
from pgm_places.io.maps.map_server import MapFile
from pgm_places.io.maps.raster_image import raster_png
from pgm_places.io.output_set import OutputSet, output_set
from pgm_places.io.places import topology_files
from pgm_places.io.places.place_settings import PlaceSettings, save_settings
from pgm_places.io.places.result_folder import (
    CHECK_FILE,
    GATES_FILE,
    SETTINGS_FILE,
    SUMMARY_FILE,
    detail_path,
    places_path,
    probability_file,
)
from pgm_places.io.remote_files import shown_path
from pgm_places.kernels.lazy_memory import set_aside, trim_heap
from pgm_places.labelers.labelled_places import LabelledCells, LabelledPlaces
from pgm_places.labelling.options import Outputs
from pgm_places.labelling.places import places_of, separating_gates
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.pictures.drawing import Packing
from pgm_places.pictures.map_page import PAGE_FILE, MapPage
from pgm_places.pictures.map_pictures import overview
from pgm_places.pictures.topology_pictures import topology_drawing
from pgm_places.progress import Progress, report_stage, reporting_to, warn, warnings_noted
from pgm_places.spaces.unentered import Unentered
from pgm_places.topology.checks import places_to_check
from pgm_places.topology.place_ids import PlaceIds
from pgm_places.topology.rules import TopologyOptions
from pgm_places.topology.topological_map import TopologicalMap
from pgm_places.unary.halls import HALL


class PageFacts(TypedDict, total=False):
    """Contents of ``index.html`` besides the places: file names, map name, warnings."""

    names: Collection[str]
    map_name: str
    warnings: Sequence[str]


COMPARISON = ("results.json", "report.html")

DEMO = ("map.yaml", "map.png", "labels.png", "labels.yaml", "demo.toml", *COMPARISON)

PLACES = (PAGE_FILE, "places.json", "regions.png", "regions.geojson", "topology.png")

TRACK = ("beliefs.csv", "path.png", "beliefs.png", "report.html")

LIVE = ("places.jsonl", "check.csv", *PLACES)

_PICTURES = ("overview.png", "topology.png")

SETTINGS = (SETTINGS_FILE, GATES_FILE)


def output_file_names(labels: Iterable[str], outputs: Outputs | None = None) -> tuple[str, ...]:
    """The names of all output files of a labelled map."""
    outputs = outputs or Outputs()
    probabilities = map(probability_file, labels) if outputs.probabilities else ()
    files = ("labels.png", "labels.yaml", "overview.png", SUMMARY_FILE, "check.csv")
    names = (*files, *probabilities, *PLACES, *SETTINGS)
    return names if outputs.pictures else tuple(name for name in names if name not in _PICTURES)


def label_files(
    folder: Path,
    labels: Iterable[str],
    outputs: Outputs,
    *,
    more: Sequence[str] = (),
    force: bool,
) -> AbstractContextManager[OutputSet]:
    """The output files of ``pgm-places label`` for a map, and ``more``.

    InputError if the user's names of places in the folder cannot be read.
    """
    topology_files.read_own_names(folder)
    names = (*output_file_names(labels, outputs), *more)
    return output_set(folder, "label", names=names, force=force)


MAX_BYTES = 64 << 20


@dataclass(frozen=True, eq=False)
class WrittenMap:
    """A labelled map after its files were written.

    ``summary`` is one line with method, area of each label and status. ``labels`` (H, W) are -1
    where a cell has none.
    """

    summary: str
    labels: NDArray[np.int16]
    area_m2: dict[str, float]
    warnings: tuple[str, ...]
    topology: TopologicalMap
    unentered: Unentered | None = None


def write_labelled(
    result: LabelledPlaces,
    source: MapFile,
    files: OutputSet,
    rules: TopologyOptions,
    progress: Progress | None = None,
    *,
    outputs: Outputs | None = None,
    n_threads: int | None = None,
) -> WrittenMap:
    """Write a labelled map and its places; ``outputs`` leaves some files out."""
    outputs = outputs or Outputs()
    with reporting_to(progress), Packing(n_threads) as packing:
        with report_stage("writing files"):
            write_labels(result, source, files.stage, packing=packing, outputs=outputs)
        record, unentered = _record_of(result, source), result.unentered
        ending = result.labeling.status.note
        warnings, cells = (*source.warnings, *result.warnings), result.cells
        # Arrays of a huge map are moved to a file until its places are known.
        if cells.beliefs is not None:
            cells = replace(cells, beliefs=set_aside(cells.beliefs, files.stage))
        if cells.hall is not None:
            cells = replace(cells, hall=set_aside(cells.hall, files.stage))
        names = output_file_names(result.label_names, outputs)
        del result  # frees the labels of a huge map's nodes
        trim_heap()
        with report_stage("places"), warnings_noted() as of_places:
            topology = write_places(
                files,
                source.name,
                cells,
                rules,
                packing=packing,
                picture=outputs.pictures,
                page={"names": names, "map_name": source.yaml_path.name, "warnings": warnings},
            )
            if not topology.regions and (least := rules.min_clearance_m):
                warn(
                    f"no place is left: a disc with a radius of {least:g} m fits into none; give "
                    "the robot's radius in metres (--robot-radius)"
                )
        record["area_m2"] = topology.area_m2
        warnings = (*warnings, *of_places)
        record["warnings"] = [*warnings]
        write_json(files.stage / SUMMARY_FILE, record, indent=2, allow_nan=True)
    areas = ", ".join(f"{name} {area:.1f} m²" for name, area in topology.area_m2.items())
    summary = f"{record['method']}: {areas}{ending}"
    return WrittenMap(summary, cells.labels, topology.area_m2, warnings, topology, unentered)


def write_places(
    files: OutputSet,
    title: str,
    cells: LabelledCells,
    rules: TopologyOptions,
    *,
    packing: Packing | None = None,
    picture: bool = True,
    page: PageFacts | None = None,
) -> TopologicalMap:
    """Find and write the topological map, with the ids of an earlier one in the folder.

    ``picture`` draws it, ``page`` has further contents of index.html. Rules and gates are written,
    too, so that the places can be reproduced from the labels.
    """
    settings = PlaceSettings(rules, separating_gates(cells.doorways, rules))
    save_settings(files.stage, settings)  # before the places of a huge map take memory
    topology = places_of(
        cells,
        rules,
        ids=earlier_places(files.folder),
        own_names=topology_files.read_own_names(files.folder),
    )
    write_topology(
        files.stage,
        cells.grid,
        topology,
        title=title,
        packing=packing,
        picture=picture,
        page=page or {"names": (*PLACES, *SETTINGS)},
    )
    return topology


def earlier_places(folder: Path) -> PlaceIds | None:
    """The ids of the places in a folder, or None; a warning if they cannot be read."""
    if not places_path(folder).exists():
        return None
    try:
        return topology_files.load_topology(folder).known_places
    except InputError as error:
        warn(f"{error}; places get new ids")
        return None


def write_labels(
    result: LabelledPlaces,
    source: MapFile,
    folder: Path,
    *,
    packing: Packing | None = None,
    outputs: Outputs | None = None,
) -> list[Path]:
    """Write labels, overview picture and probabilities; the paths.

    ``labels.png`` and ``labels.yaml`` have the size of the map image. ``details`` has a
    ``probability_<label>.png`` per label (0 to 255 for 0 to 1, 0 outside the free cells), and one
    for halls that are shown as corridors.
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
        drawing = overview(
            result.grid,
            result.labels,
            result.label_names,
            beliefs=result.labeling.beliefs,
            layout=result.layout,
            title=source.name,
        )
        written.append((packing or Packing()).write(folder / "overview.png", drawing))
    return written


def _record_of(result: LabelledPlaces, source: MapFile) -> dict[str, object]:
    """The content of ``summary.json``; the areas are added later."""
    status = result.labeling.status
    return {
        "map": shown_path(source.yaml_path),
        "method": result.method,
        "status": str(status),
        "status_meaning": status.meaning,
        "area_m2": {},
        "unentered_m2": 0.0 if result.unentered is None else result.unentered.area_m2,
        "score": result.labeling.score,
        "bound": result.labeling.bound,
        "warnings": [],
    }


def label_record(folder: Path) -> dict[str, Any]:
    """The content of a folder's ``summary.json``; empty without the file."""
    path = detail_path(folder, SUMMARY_FILE)
    if not path.is_file():
        return {}
    record = read_json(path, InputError, "a summary of 'pgm-places label'", max_bytes=MAX_BYTES)
    return record if isinstance(record, dict) else {}


def labelled_map(folder: Path) -> Path | None:
    """The labelled map of a result folder; None if it is unknown or does not exist.

    A relative path is relative to the current folder.
    """
    name = label_record(folder).get("map")
    path = Path(name) if isinstance(name, str) else None
    return path if path is not None and path.is_file() else None


def _write_probabilities(result: LabelledPlaces, folder: Path) -> list[Path]:
    from PIL import Image

    beliefs = result.labeling.beliefs
    if beliefs is None:
        return []
    written = []
    shares = {name: beliefs[:, k] for k, name in enumerate(result.label_names)}
    if result.hall is not None:
        shares[HALL] = result.hall
    for name, share in shares.items():
        raster = result.on_map(_in_bytes(share), 0)
        size = (raster.shape[1], raster.shape[0])
        # Row 0 of an image is its top: -1 reads the raster from its end, without a copy.
        picture = Image.frombuffer("L", size, raster, "raw", "L", 0, -1)
        path = folder / probability_file(name)
        written.append(write_bytes(path, raster_png(picture)))
    return written


def _in_bytes(shares: NDArray[np.floating]) -> NDArray[np.uint8]:
    """(N,) shares from 0 to 1 as 0 to 255, block by block, to bound the size of temporaries."""
    levels = np.empty(len(shares), np.uint8)
    for block in row_blocks(len(shares)):
        levels[block] = np.round(255 * shares[block])
    return levels


def write_topology(
    folder: Path,
    grid: OccupancyGrid,
    topology: TopologicalMap,
    *,
    title: str | None = None,
    packing: Packing | None = None,
    picture: bool = True,
    page: PageFacts | None = None,
) -> list[Path]:
    """Write the topological map's files, with ``picture`` also ``topology.png``; the paths.

    ``index.html`` shows the places and lists the files of the folder. If there are probabilities,
    ``check.csv`` lists the places to check first.
    """
    written, packing = [], packing or Packing()
    if picture:  # first: this largest picture is compressed in the background
        drawing = topology_drawing(grid, topology, title=title)
        written.append(packing.write(folder / "topology.png", drawing))
    facts, checks = page or {}, places_to_check(topology)
    names = {*facts.get("names", PLACES)} - {CHECK_FILE} | ({CHECK_FILE} if checks else set())
    shown = MapPage(
        grid,
        topology,
        title=title or "Places",
        picture=picture,
        names=names,
        map_name=facts.get("map_name", "MAP.yaml"),
        warnings=facts.get("warnings", ()),
    )
    written.append(packing.write_made(folder / PAGE_FILE, shown.content))
    written += topology_files.save_topology(folder, topology)
    if checks:
        written.append(topology_files.write_checks(folder / CHECK_FILE, topology))
    return written
