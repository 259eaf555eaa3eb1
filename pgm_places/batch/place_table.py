"""All places of many maps as one Parquet file, for pandas, DuckDB and the like."""

from collections.abc import Iterable
from itertools import islice
from pathlib import Path
from typing import Any

from pgm_places._extras import needed
from pgm_places.errors import InputError
from pgm_places.io.atomic import atomic_file
from pgm_places.io.input_file import read_json
from pgm_places.io.places.topology_files import MAX_BYTES, TOPOLOGY_FILE

PLACE_TABLE = "places.parquet"

_MAPS_AT_ONCE = 1000
"""Maps whose places are held in memory, and make a group of rows of the file."""


def write_place_table(path: Path, out: Path, names: Iterable[str]) -> Path:
    """Write the places of maps; the path.

    Columns: ``map`` (its name), ``place`` (its id), ``name``, ``label``, ``area_m2``,
    ``confidence`` (null where unknown), ``doubtful_m2``, ``x_m`` and ``y_m`` (the anchor in the
    map's frame), and ``connected_to`` (the ids of its neighbours).

    Parameters
    ----------
    path : Path
    out : Path
        The folder of the results.
    names : iterable of str
        The maps, each with a folder below it.

    Raises
    ------
    InputError
        The extra ``tables`` is not installed.
    OutputError
        The file cannot be written.
    """
    arrow = needed("pyarrow", extra="tables", purpose="--parquet")
    parquet = needed("pyarrow.parquet", extra="tables", purpose="--parquet")
    schema = arrow.schema(
        {
            "map": arrow.string(),
            "place": arrow.int32(),
            "name": arrow.string(),
            "label": arrow.string(),
            "area_m2": arrow.float64(),
            "confidence": arrow.float64(),
            "doubtful_m2": arrow.float64(),
            "x_m": arrow.float64(),
            "y_m": arrow.float64(),
            "connected_to": arrow.list_(arrow.int32()),
        }
    )
    waiting = iter(names)
    with atomic_file(path) as temporary, parquet.ParquetWriter(temporary, schema) as writer:
        while some := list(islice(waiting, _MAPS_AT_ONCE)):
            rows = [row for name in some for row in _places(out / name, name)]
            writer.write_table(arrow.Table.from_pylist(rows, schema))
    return path


def _places(folder: Path, name: str) -> list[dict[str, Any]]:
    """The places of one map; none where its file is damaged or gone."""
    try:
        wanted = "a topological map"
        record = read_json(folder / TOPOLOGY_FILE, InputError, wanted, max_bytes=MAX_BYTES)
        near: dict[int, set[int]] = {}
        for item in record["connections"]:
            near.setdefault(int(item["first"]), set()).add(int(item["second"]))
            near.setdefault(int(item["second"]), set()).add(int(item["first"]))
        return [_place(region, name, near) for region in record["regions"]]
    except (InputError, LookupError, TypeError, ValueError):
        return []


def _place(region: dict[str, Any], name: str, near: dict[int, set[int]]) -> dict[str, Any]:
    confidence, area_m2 = region["confidence"], float(region["area_m2"])
    x_m, y_m = region["anchor_m"]
    return {
        "map": name,
        "place": int(region["id"]),
        "name": str(region["name"]),
        "label": str(region["label"]),
        "area_m2": area_m2,
        "confidence": confidence,
        "doubtful_m2": None if confidence is None else (1.0 - confidence) * area_m2,
        "x_m": float(x_m),
        "y_m": float(y_m),
        "connected_to": sorted(near.get(int(region["id"]), ())),
    }
