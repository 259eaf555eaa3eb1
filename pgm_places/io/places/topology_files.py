"""A topological map as files: topology.json, regions.png, regions.geojson, and the user's names."""

import dataclasses
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError, LabelError, OutputError, shown
from pgm_places.io.atomic import write_bytes, write_text
from pgm_places.io.geojson import read_regions
from pgm_places.io.input_file import user_path
from pgm_places.io.json_file import read_json
from pgm_places.io.maps.raster_image import MAX_PIXELS, open_image
from pgm_places.io.places.gate_record import gate_record, read_gate
from pgm_places.io.places.region_features import write_region_features
from pgm_places.io.strict_yaml import read_yaml
from pgm_places.maps.occupancy_grid import FREE, UNKNOWN, OccupancyGrid
from pgm_places.topology.corrections import Correction
from pgm_places.topology.regions import Polygon, Region
from pgm_places.topology.topological_map import Connection, TopologicalMap

__all__ = ["NAMES_FILE", "TOPOLOGY_FILE", "load_topology", "read_own_names", "save_topology"]

TOPOLOGY_FILE, REGION_FILE, FEATURES_FILE = "topology.json", "regions.png", "regions.geojson"
NAMES_FILE = "place_names.yaml"
FORMAT, SCHEMA = "pgm-places-topology", 1
MAX_REGIONS = 65535
MAX_BYTES = 64 << 20
_WANTED = "a topological map, as 'pgm-places label' and 'pgm-places topology' write it"


def save_topology(folder: Path | str, topology: TopologicalMap) -> list[Path]:
    """Write a topological map into a folder; the paths written.

    ``topology.json`` holds regions, connections, corrections and the map's frame;
    ``regions.png`` the id of the region at each cell (16 bits, 0 for none, the top row first);
    ``regions.geojson`` the outlines. ``topology.json`` is written last.

    Raises
    ------
    OutputError
        Where a file cannot be written, or there are more than 65535 ids.
    """
    target = Path(folder)
    if topology.next_id - 1 > MAX_REGIONS:
        raise OutputError(
            f"{target}: {topology.next_id - 1} ids have been given, regions.png holds {MAX_REGIONS}"
            "; correct the labels (larger least areas), or start again in an empty folder"
        )
    written = [
        write_bytes(target / REGION_FILE, _png(topology.region)),
        write_region_features(target / FEATURES_FILE, topology),
    ]
    record = json.dumps(_record(topology), indent=1, allow_nan=False)
    return [write_text(target / TOPOLOGY_FILE, record + "\n"), *written]


def _png(region: NDArray[np.int32]) -> bytes:
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(region[::-1].astype(np.uint16)).save(buffer, "PNG")
    return buffer.getvalue()


def _record(topology: TopologicalMap) -> dict[str, Any]:
    grid = topology.grid
    return {
        "format": FORMAT,
        "schema": SCHEMA,
        "map": {
            "rows": grid.shape[0],
            "columns": grid.shape[1],
            "resolution_m": grid.resolution_m,
            "origin_xy_m": list(grid.origin_xy_m),
            "yaw_rad": grid.yaw_rad,
        },
        "label_names": list(topology.label_names),
        "doorway_label": topology.doorway_label,
        "next_id": topology.next_id,
        "regions": [_region_record(region) for region in topology.regions],
        "connections": [dataclasses.asdict(item) for item in topology.connections],
        "corrections": [dataclasses.asdict(item) for item in topology.corrections],
    }


def _region_record(region: Region) -> dict[str, Any]:
    names = [field.name for field in dataclasses.fields(region)]
    record = {name: getattr(region, name) for name in names if name not in ("polygons", "gate")}
    return record if region.gate is None else {**record, "gate": gate_record(region.gate)}


def load_topology(folder: Path | str) -> TopologicalMap:
    """The topological map that ``save_topology`` wrote into a folder.

    Its grid has the map's frame; cells of regions are free, all others unknown.

    Raises
    ------
    InputError
        Where a file is missing, damaged, or does not fit the others.
    """
    source = user_path(folder, InputError)
    path = source / TOPOLOGY_FILE
    record = read_json(path, InputError, _WANTED, max_bytes=MAX_BYTES)
    if not isinstance(record, dict) or record.get("format") != FORMAT:
        raise InputError(f"{path} is not a topological map of this package; write it again")
    if record.get("schema") != SCHEMA:
        raise InputError(
            f"{path} has schema {shown(record.get('schema'))}, but only {SCHEMA} can be read; "
            "write it again"
        )
    try:
        return _topology(source, record)
    except (KeyError, TypeError, ValueError, IndexError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path} is damaged ({error!r}); write it again") from None


def _topology(source: Path, record: dict[str, Any]) -> TopologicalMap:
    frame = record["map"]
    shape = (int(frame["rows"]), int(frame["columns"]))
    region = _read_ids(source / REGION_FILE, shape)
    x, y = frame["origin_xy_m"]
    cells = np.where(region > 0, FREE, UNKNOWN).astype(np.int8)
    grid = OccupancyGrid(cells, frame["resolution_m"], (x, y), frame["yaw_rad"])
    features = read_regions(source / FEATURES_FILE, "id")
    outlines = {int(feature.code): feature.polygons for feature in features}
    regions = tuple(_region(item, outlines[item["id"]]) for item in record["regions"])
    ids = {item.id for item in regions}
    seen = {int(number) for number in np.unique(region)} - {0}
    if seen != ids:
        raise InputError(
            f"{source / REGION_FILE} and {TOPOLOGY_FILE} hold other regions "
            f"({sorted(seen ^ ids)[:5]}); they come from different runs; write them again"
        )
    return TopologicalMap(
        grid,
        region,
        regions,
        tuple(Connection(**_tuples(item)) for item in record["connections"]),
        tuple(record["label_names"]),
        record["doorway_label"],
        tuple(Correction(**_tuples(item)) for item in record["corrections"]),
        int(record["next_id"]),
    )


def _region(item: dict[str, Any], polygons: tuple[Polygon, ...]) -> Region:
    gate = item.get("gate")
    given = {key: value for key, value in _tuples(item).items() if key != "gate"}
    return Region(**given, polygons=polygons, gate=None if gate is None else read_gate(gate))


def _tuples(item: dict[str, Any]) -> dict[str, Any]:
    return {key: tuple(value) if isinstance(value, list) else value for key, value in item.items()}


def _read_ids(path: Path, shape: tuple[int, int]) -> NDArray[np.int32]:
    from PIL.PngImagePlugin import PngImageFile  # not Image.open, which distrusts large images

    n_cells = shape[0] * shape[1]
    with open_image(path, InputError, max_pixels=max(MAX_PIXELS, n_cells)) as image:
        if image.shape != shape or not image.is_deep:
            raise InputError(f"{path}: {shape} ids of 16 bits were expected, got {image.shape}")
    try:
        with path.open("rb") as file, PngImageFile(file) as picture:
            ids = np.asarray(picture)
    except (OSError, ValueError, SyntaxError) as error:
        raise InputError(f"{path}: damaged: {error}; write it again") from None
    return ids[::-1].astype(np.int32)


def read_own_names(folder: Path | str) -> dict[int, str]:
    """The user's names in ``place_names.yaml``: lines such as ``3: kitchen``; none without a file.

    Raises
    ------
    LabelError
        A key is not an id, or a name is not text.
    """
    path = Path(folder) / NAMES_FILE
    if not path.exists():
        return {}
    file = read_yaml(path, LabelError, "names of places")
    names = {}
    for key in file.values:
        number = file.as_integer(key, "an id", low=1, high=MAX_REGIONS)
        names[number] = file.text(key)
    return names
