"""Place ids in a file, so that they stay the same when live labelling is restarted."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.io.atomic import write_json
from pgm_places.io.input_file import read_record, user_path
from pgm_places.maps.occupancy_grid import UNKNOWN, OccupancyGrid
from pgm_places.options import check_option
from pgm_places.options.marks import Ge
from pgm_places.topology.place_ids import PlaceIds, RememberedPlace

__all__ = ["read_session", "write_session"]

FORMAT, SCHEMA = "pgm-places-session", 1
MAX_BYTES = 256 << 20
FARTHEST = 1 << 24
"""Larger row or column numbers are damage."""
MOST_CELLS = 100_000_000

_count = partial(check_option, "a count", Annotated[int, Ge(0)])
_text = partial(check_option, "a name", str)


def write_session(path: Path | str, memory: PlaceIds) -> Path:
    """Write a table of place ids, replacing an existing file atomically; returns the path."""
    raster = memory.raster
    record = {
        "format": FORMAT,
        "schema": SCHEMA,
        "n_maps": memory.n_maps,
        "next_id": memory.next_id,
        "last": sorted(memory.last),
        "raster": None
        if raster is None
        else {
            "resolution_m": raster.resolution_m,
            "origin_xy_m": list(raster.origin_xy_m),
            "yaw_rad": raster.yaw_rad,
        },
        "places": [
            {
                "id": number,
                "label": place.label,
                "name": place.name,
                "anchor_m": list(place.anchor_m),
                "n_maps": place.n_maps,
                "runs": _runs(place.cells).tolist(),
            }
            for number, place in memory.places.items()
        ],
    }
    return write_json(path, record, ensure_ascii=False)


def read_session(path: Path | str) -> PlaceIds:
    """Read the table of :func:`write_session`; an empty one if the file does not exist."""
    source, memory = user_path(path, InputError), PlaceIds()
    if not source.exists():
        return memory
    what, remedy = (
        "a session of 'pgm-places live'",
        "name another file, or delete it to restart the numbering of places",
    )
    with read_record(source, what, FORMAT, SCHEMA, max_bytes=MAX_BYTES, remedy=remedy) as record:
        _fill(memory, record)
    return memory


def _fill(memory: PlaceIds, record: Mapping[str, Any]) -> None:
    raster, left = record["raster"], MOST_CELLS
    if raster is not None:
        x, y = map(float, raster["origin_xy_m"])
        cell = np.full((1, 1), UNKNOWN, np.int8)
        side_m, yaw_rad = float(raster["resolution_m"]), float(raster["yaw_rad"])
        memory.raster = OccupancyGrid(cell, side_m, (x, y), yaw_rad)
    memory.n_maps, memory.next_id = _count(record["n_maps"]), _count(record["next_id"])
    for item in record["places"]:
        number = _count(item["id"])
        if not 0 < number < memory.next_id or number in memory.places:
            raise ValueError(f"the id {number}")
        cells = _cells(item["runs"], left)
        left -= len(cells)
        x, y = map(float, item["anchor_m"])
        memory.places[number] = RememberedPlace(
            _text(item["label"]), _text(item["name"]), cells, (x, y), _count(item["n_maps"])
        )
    memory.last = frozenset(map(_count, record["last"]))
    if memory.last - memory.places.keys() or (memory.places and raster is None):
        raise ValueError("places without a record")


def _runs(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """(n, 3) row, first and last column of the runs of cells in row-major order."""
    if not len(cells):
        return np.empty((0, 3), np.int64)
    row, column = cells.T
    begins = np.ones(len(cells), np.bool_)
    begins[1:] = (np.diff(row) != 0) | (np.diff(column) != 1)
    first = np.flatnonzero(begins)
    last = np.append(first[1:], len(cells)) - 1
    return np.column_stack([row[first], column[first], column[last]])


def _cells(runs: object, most: int) -> NDArray[np.int64]:
    """(n, 2) the cells of runs; refuses damaged runs."""
    checked = np.array(runs, np.int64).reshape(-1, 3)
    length = checked[:, 2] - checked[:, 1] + 1
    if (np.abs(checked) > FARTHEST).any() or (length < 1).any() or length.sum() > most:
        raise ValueError("cells of a place")
    start = np.repeat(np.cumsum(length) - length, length)
    column = np.arange(length.sum()) - start + np.repeat(checked[:, 1], length)
    return np.column_stack([np.repeat(checked[:, 0], length), column])
