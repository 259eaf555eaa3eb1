"""Files of a topological map: places.json with its images, outlines, names, and the check table."""

import dataclasses
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from pgm_places._arguments import public
from pgm_places._checks import plain_names
from pgm_places.errors import InputError, LabelError, OutputError, quoted
from pgm_places.graph.layout import GridLayout
from pgm_places.io.atomic import write_bytes, write_json, write_text
from pgm_places.io.csv_table import csv_text
from pgm_places.io.input_file import read_record, user_path
from pgm_places.io.maps.raster_image import MAX_PIXELS, open_image, raster_png
from pgm_places.io.maps.regions import read_regions
from pgm_places.io.places.result_folder import (
    FEATURES_FILE,
    NAMES_FILE,
    PLACES_FILE,
    REGION_FILE,
    detail_path,
    places_path,
    probability_file,
)
from pgm_places.io.strict_yaml import read_yaml
from pgm_places.maps.occupancy_grid import FREE, UNKNOWN, OccupancyGrid
from pgm_places.options import check_option, from_mapping, option_hints, plain_values
from pgm_places.options.marks import Ge
from pgm_places.spaces.gates import Gate
from pgm_places.topology.checks import places_to_check, split_candidates
from pgm_places.topology.corrections import Correction
from pgm_places.topology.place_edits import renamed
from pgm_places.topology.regions import HALL, Connection, Polygon, Region
from pgm_places.topology.topological_map import SIZES, TopologicalMap, gate_record

MOST = 65535
"""The largest number in an image of numbers."""


@dataclass(frozen=True)
class Raster:
    """Shape and frame of a map's raster in a record."""

    rows: Annotated[int, Ge(1)]
    columns: Annotated[int, Ge(1)]
    resolution_m: float
    origin_xy_m: tuple[float, float]
    yaw_rad: float

    @classmethod
    def of(cls, grid: OccupancyGrid) -> Self:
        """The raster of a map."""
        return cls(*grid.shape, grid.resolution_m, grid.origin_xy_m, grid.yaw_rad)

    def grid(self, free: NDArray[np.bool_]) -> OccupancyGrid:
        """A map of this raster with free cells; all others are unknown."""
        cells = np.where(free, FREE, UNKNOWN).astype(np.int8)
        return OccupancyGrid(cells, self.resolution_m, self.origin_xy_m, self.yaw_rad)

    def read_numbers(self, path: Path, *, max_pixels: int = MAX_PIXELS) -> NDArray[np.int32]:
        """(H, W) the numbers in a 16-bit image of this raster, row 0 at the bottom."""
        shape = (self.rows, self.columns)
        with open_image(path, InputError, max_pixels=max_pixels) as image:
            if image.shape != shape or not image.is_deep:
                raise InputError(
                    f"{path}: expected 16-bit numbers of shape {shape}, got {image.shape}"
                )
            return image.stored()[::-1].astype(np.int32)


def write_numbers(path: Path, numbers: NDArray[np.integer]) -> Path:
    """Write numbers (H, W) from 0 to 65535, row 0 at the bottom; returns the path."""
    from PIL import Image

    return write_bytes(path, raster_png(Image.fromarray(numbers[::-1].astype(np.uint16))))


def read_shares(path: Path, shape: tuple[int, ...], error: type[InputError]) -> NDArray[np.integer]:
    """(H, W) the greys of an image of probabilities of the map's shape, row 0 at the bottom."""
    with open_image(path, error) as image:
        shares = image.stored()
        if shares.shape != shape or image.is_indexed or image.is_deep:
            raise error(
                f"{path}: expected 8-bit grey values in {shape[0]} rows x {shape[1]} columns, as "
                "the map has; label the map again"
            )
        return shares[::-1]


def load_probabilities(
    folder: Path, label_names: Sequence[str], layout: GridLayout
) -> NDArray[np.float32] | None:
    """(N, K) probability of each label at the nodes of a map; None if a label has no image.

    The images hold multiples of 1/255, which are normalised to sum to one.
    """
    columns = [_share_of(folder, name, layout) for name in label_names]
    if any(column is None for column in columns):
        return None
    beliefs = np.stack([column for column in columns if column is not None], axis=1)
    beliefs /= np.maximum(beliefs.sum(axis=1, keepdims=True), 1.0)
    return beliefs


def load_hall(
    folder: Path, label_names: Sequence[str], layout: GridLayout
) -> NDArray[np.float32] | None:
    """(N,) the probability of a hall if it is an extra image; see `load_probabilities`."""
    share = None if HALL in label_names else _share_of(folder, HALL, layout)
    return None if share is None else share / np.float32(255)


def _share_of(folder: Path, name: str, layout: GridLayout) -> NDArray[np.float32] | None:
    """(N,) the greys of a label's image at the nodes; None without an image."""
    path = detail_path(folder, probability_file(name))
    if not path.exists():
        return None
    shares = layout.from_raster(read_shares(path, layout.shape, InputError))
    return np.asarray(shares, np.float32)


T = TypeVar("T")
FORMAT, SCHEMA = "pgm-places-topology", 1
MAX_BYTES = 64 << 20
_WANTED = "a topological map, as 'pgm-places label' and 'pgm-places topology' write it"


@public
def save_topology(folder: Path | str, topology: TopologicalMap) -> list[Path]:
    """Write a topological map into a folder; returns the paths.

    ``places.json`` holds regions, connections, corrections and the map's frame;
    ``regions.png`` the id of the region at each cell (16 bits, 0 for none, the top row first);
    ``regions.geojson`` the outlines. ``places.json`` is written last.

    Raises
    ------
    OutputError
        A file cannot be written, or there are more than 65535 ids.
    """
    target = Path(folder)
    if topology.next_id - 1 > MOST:
        raise OutputError(
            f"{target}: {topology.next_id - 1} ids have been assigned, but regions.png holds "
            f"only {MOST}; raise the minimum areas, or start over in an empty folder"
        )
    written = [
        write_numbers(target / REGION_FILE, topology.region),
        write_json(target / FEATURES_FILE, topology.to_geojson()),
    ]
    return [write_json(target / PLACES_FILE, _record(topology), indent=1), *written]


def _record(topology: TopologicalMap) -> dict[str, object]:
    return {
        "format": FORMAT,
        "schema": SCHEMA,
        "map": plain_values(Raster.of(topology.grid)),
        "label_names": list(topology.label_names),
        "doorway_label": topology.doorway_label,
        "next_id": topology.next_id,
        "regions": [_region_record(region) for region in topology.regions],
        "connections": [dataclasses.asdict(item) for item in topology.connections],
        "corrections": [dataclasses.asdict(item) for item in topology.corrections],
        "removed_openings": topology.removed_openings,
    }


def _region_record(region: Region) -> dict[str, object]:
    names = [field.name for field in dataclasses.fields(region)]
    record = {name: getattr(region, name) for name in names if name not in ("polygons", "gate")}
    return record if region.gate is None else {**record, "gate": gate_record(region.gate)}


@public
def load_topology(folder: Path | str, *, max_pixels: int = MAX_PIXELS) -> TopologicalMap:
    """The topological map that ``save_topology`` wrote into a folder.

    Its grid has the map's frame; cells of regions are free, all others unknown. ``max_pixels``
    limits the map's size. Folders of earlier versions, with places in ``topology.json``, can be
    read.

    Raises
    ------
    InputError
        A file is missing, damaged, or does not fit the others.
    """
    source = user_path(folder, InputError)
    path, again = places_path(source), "write it again"
    with read_record(path, _WANTED, FORMAT, SCHEMA, max_bytes=MAX_BYTES, remedy=again) as record:
        return _topology(source, record, max_pixels)


def load_named_topology(folder: Path | str) -> TopologicalMap:
    """The map of :func:`load_topology`, with the current names in ``place_names.yaml``."""
    return renamed(load_topology(folder), read_own_names(folder))


def _topology(source: Path, record: dict[str, Any], max_pixels: int) -> TopologicalMap:
    raster = from_mapping(Raster, record["map"], path="map")
    region = raster.read_numbers(source / REGION_FILE, max_pixels=max_pixels)
    grid = raster.grid(region > 0)
    features = read_regions(source / FEATURES_FILE, "id")
    outlines = {feature.code: feature.polygons for feature in features}
    names = plain_names("label_names", record["label_names"], InputError)
    regions = tuple(
        _region(item, f"regions[{k}]", outlines, names) for k, item in enumerate(record["regions"])
    )
    plain_names("names of places", [item.name for item in regions], InputError)
    ids = {item.id for item in regions}
    present = {*np.flatnonzero(np.bincount(region.ravel())).tolist()} - {0}
    if present != ids:
        raise InputError(
            f"{REGION_FILE} and {places_path(source).name} hold other regions "
            f"({sorted(present ^ ids)[:5]}); they come from different runs; write them again"
        )
    connections = items_of(Connection, record, "connections")
    for item in connections:
        if not {item.first, item.second} <= ids:
            raise InputError(
                f"a connection joins {item.first} and {item.second}, but not both are regions"
            )
    corrections = items_of(Correction, record, "corrections")
    (doorway,) = plain_names("doorway_label", [record["doorway_label"]], InputError)
    next_id = check_option("next_id", int, record["next_id"])
    if next_id <= max(ids, default=0):
        raise InputError(f"next_id is {next_id}, but there is a region {max(ids)}")
    removed = check_option(  # absent in files of earlier versions
        "removed_openings",
        tuple[tuple[tuple[float, float], tuple[float, float]], ...],
        record.get("removed_openings", ()),
    )
    return TopologicalMap(
        grid, region, regions, connections, names, doorway, corrections, next_id, removed
    )


def items_of(cls: type[T], record: dict[str, Any], key: str) -> tuple[T, ...]:
    """The records in a list, as instances of a class."""
    items = enumerate(record[key])
    return tuple(from_mapping(cls, item, path=f"{key}[{k}]") for k, item in items)


def _region(
    item: dict[str, Any],
    path: str,
    outlines: dict[str, tuple[Polygon, ...]],
    label_names: tuple[str, ...],
) -> Region:
    hints = {**option_hints(Region)}
    del hints["polygons"], hints["gate"]
    unknown = sorted(set(item) - {*hints, "gate"})
    if unknown:
        raise InputError(f"{path} has the unknown key {quoted(unknown[0])}")
    item = {"hall": None, **item}  # absent in files of earlier versions
    values = {key: check_option(f"{path}.{key}", hint, item[key]) for key, hint in hints.items()}
    if values["label"] not in label_names:
        raise InputError(f"{path}.label {quoted(values['label'])} is not among label_names")
    gate = item.get("gate")
    polygons = outlines[str(values["id"])]
    return Region(**values, polygons=polygons, gate=None if gate is None else _gate(gate))


def _gate(record: Mapping[str, Any]) -> Gate:
    """The gate of a record; its corners are computed."""
    x, y = (float(value) for value in record["centre_m"])
    return Gate((x, y), *(float(record[name]) for name in SIZES))


def write_own_name(folder: Path | str, number: int, name: str, *, into: Path | None = None) -> Path:
    """Write a user's name for an id into ``place_names.yaml``; other lines stay as they are.

    The file is in ``folder``; with ``into``, a changed copy is written to that folder instead.
    """
    path = Path(folder) / NAMES_FILE
    (name,) = plain_names(f"{path}: names of places", [name])
    read_own_names(folder)  # refuses a damaged file
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    own = f"{number}: {json.dumps(name, ensure_ascii=False)}"  # a JSON string is a YAML string
    at = [k for k, line in enumerate(lines) if line.split(":")[0].strip() == str(number)]
    if at:
        lines[at[0]] = own
    else:
        lines.append(own)
    return write_text((into or path.parent) / NAMES_FILE, "\n".join(lines) + "\n")


def read_own_names(folder: Path | str) -> dict[int, str]:
    """The user's names in ``place_names.yaml``, lines such as ``3: kitchen``; may be missing."""
    path = Path(folder) / NAMES_FILE
    if not path.exists():
        return {}
    file = read_yaml(path, LabelError, "names of places")
    names = {}
    for key in file.values:
        number = file.as_integer(key, "an id", low=1, high=MOST)
        (names[number],) = plain_names(f"{path}: names of places", [file.text(key)])
    return names


_PLACE = ("id", "name", "label", "second_label", "probability", "second_probability", "area_m2")
_DOUBT = ("doubt", "doubtful_m2", "x_m", "y_m")
_COLUMNS = (*_PLACE, *_DOUBT, "rooms", "to_split", "finer_label", "hall")


def check_table(topology: TopologicalMap) -> str:
    """Comma-separated values: a row per place, largest uncertain area first.

    Columns: ``id``, ``name``, ``label``, ``second_label``, ``probability`` of the label,
    ``second_probability``, ``area_m2``, ``doubt`` (1 - probability), ``doubtful_m2`` (doubt times
    area), ``x_m``, ``y_m``: the place's anchor in the map frame, ``rooms``: the number of rooms
    that the place looks like, if more than one, ``to_split``: the command that splits it, to be run
    in the table's folder, ``finer_label``: ``hall`` if a corridor is more likely a hall, else the
    label, and ``hall``: the probability of a hall, if halls are shown as corridors.
    """
    count = {candidate.place.id: candidate.count for candidate in split_candidates(topology)}
    rows: list[Iterable[object]] = [_COLUMNS]
    for check in places_to_check(topology):
        place, second = check.place, check.second_probability
        row: list[object] = [place.id, place.name, place.label, check.second_label or ""]
        row += [f"{check.probability:.4f}", "" if second is None else f"{second:.4f}"]
        row += [f"{place.area_m2:.3f}", f"{check.doubt:.4f}", f"{check.doubtful_m2:.3f}"]
        row += [f"{value:.3f}" for value in place.anchor_m]
        split = place.id in count
        row += [count[place.id], f"pgm-places split . {place.id}"] if split else ["", ""]
        row += [HALL if place.is_likely_hall else place.label]
        row += ["" if place.hall is None else f"{place.hall:.4f}"]
        rows.append(row)
    return csv_text(rows)


def write_checks(path: Path | str, topology: TopologicalMap) -> Path:
    """Write the check table; returns the path."""
    return write_text(path, check_table(topology))
