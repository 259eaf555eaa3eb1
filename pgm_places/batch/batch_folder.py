"""The output folder of a batch: root of the names, claims of workers, and index."""

import hashlib
import json
import os
import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import islice
from pathlib import Path, PurePosixPath
from typing import Any

from pgm_places.batch.batch_index import LISTS, BatchIndex, index_of
from pgm_places.batch.found_maps import FoundMap
from pgm_places.batch.map_task import Failure, LabelledRow, labelled_row, manifest_record
from pgm_places.batch.overview import Overview
from pgm_places.batch.remote_maps import fetch_results
from pgm_places.errors import InputError, OutputError
from pgm_places.io.atomic import atomic_file, write_json, write_text
from pgm_places.io.input_file import file_kind, is_address, read_json, user_path
from pgm_places.io.output_set import claim
from pgm_places.io.places.result_folder import (
    DETAILS,
    MANIFEST_FILE,
    OLD_PLACES_FILE,
    PLACES_FILE,
    detail_path,
    places_path,
)
from pgm_places.io.places.topology_files import MAX_BYTES
from pgm_places.io.remote_files import RemoteFolder, address_of, temporary_folder
from pgm_places.io.staging import claimed, remove_leftovers
from pgm_places.plugins import needed
from pgm_places.progress import Progress

_RECORD = ".pgm-places-batch.json"
_CLAIMS = ".pgm-places-claims"
_CLAIM = re.compile("[0-9a-f]{32}")
_FORMAT, _SCHEMA = "pgm-places batch", 1
_MAX_BYTES = 1 << 16


def recorded_root(out: Path) -> Path | None:
    """The root of the map names in ``out``; None if it is unknown or was moved."""
    if not is_address(out):
        return _root_in(out)
    with temporary_folder() as here:
        RemoteFolder.at(out).fetch(_RECORD, here / _RECORD)
        return _root_in(here)


def _root_in(folder: Path) -> Path | None:
    try:
        record = read_json(folder / _RECORD, InputError, "a batch's record", max_bytes=_MAX_BYTES)
        root = Path(record["root"])
    except (InputError, LookupError, TypeError):
        return None
    return root if is_address(root) or root.is_dir() else None


def batch_of(folder: Path) -> Path | None:
    """The folder of the batch that ``folder`` belongs to, or None."""
    return next((path for path in folder.resolve().parents if is_of_batch(path)), None)


def is_of_batch(folder: Path) -> bool:
    """Whether a folder is the output folder of a batch."""
    return (folder / _RECORD).is_file()


def write_root(out: Path, root: Path) -> None:
    """Record the root for later runs."""
    record = {"format": _FORMAT, "schema": _SCHEMA, "root": str(root)}
    if recorded_root(out) == root:
        return
    if not is_address(out):
        write_json(out / _RECORD, record, indent=1)
        return
    with temporary_folder() as here:
        write_json(here / _RECORD, record, indent=1)
        RemoteFolder.at(out, OutputError).put(here, [_RECORD], OutputError)


def claim_of(out: Path, name: str) -> Path:
    """The lock file of a map."""
    digest = hashlib.sha256(name.encode("utf-8", "surrogateescape")).hexdigest()
    return out / _CLAIMS / digest[:32]


def remove_crash_leftovers(out: Path) -> None:
    """Remove lock files and partial output of crashed workers, also of maps that are labelled."""
    claims = out / _CLAIMS
    if claims.is_symlink():
        raise OutputError(f"cannot write {claims}: it is a symbolic link; remove it")
    lock_files: list[Path] = []
    with suppress(FileNotFoundError):  # no run holds claims
        lock_files += claims.iterdir()
    for path in lock_files:
        if not _CLAIM.fullmatch(path.name) or path.is_symlink() or not path.is_file():
            continue
        with claimed(path) as is_free:
            if is_free and path.stat().st_size <= _MAX_BYTES:
                name = PurePosixPath(os.fsdecode(path.read_bytes()))
                folder = (out / name.parent).resolve()
                if name.name and folder.is_relative_to(out.resolve()):
                    remove_leftovers(folder, name.name)
    with suppress(OSError):  # another batch holds claims
        claims.rmdir()


def names_in_the_way(maps: Iterable[FoundMap]) -> Iterator[Failure]:
    """Failures of maps whose output folder would collide with another map's or with the index."""
    reserved = {name.casefold() for name in LISTS}
    by_name = {map_.name.casefold(): map_ for map_ in maps}
    reasons: dict[str, str] = {}
    for name, map_ in by_name.items():
        parts = name.split("/")
        if parts[0] in reserved:
            reasons[map_.name] = "its folder would have the name of an index file"
        for n in range(1, len(parts)):
            holder = by_name.get("/".join(parts[:n]))
            if holder is not None:
                reasons[holder.name] = f"its folder would contain the folder of {map_.path}"
    for map_ in maps:
        if by_name[map_.name.casefold()] is not map_:
            other = by_name[map_.name.casefold()].path
            reasons[map_.name] = (
                f"its name differs from the name of {other} only in capital letters"
            )
        if map_.name in reasons:
            message = f"{map_.path}: {reasons[map_.name]}; rename the map or its folder"
            yield Failure(map_.name, str(map_.path), "MapError", message)


def index_folder(
    folder: Path, *, parquet: bool = False, force: bool = False, progress: Progress
) -> tuple[Overview, list[str]]:
    """Rebuild the index of all labelled maps below a folder or address; counts and file names."""
    if is_address(folder):
        places = (PLACES_FILE, OLD_PLACES_FILE) if parquet else ()
        wanted = (Path(MANIFEST_FILE).name, *places)
        shown = address_of(folder)
        with index_of(folder) as lists:
            fetch_results(folder, wanted, lists.out)
            _check_holds_results(shown, lists.out)
            return _listed(lists, shown.rstrip("/"), parquet, force=force, progress=progress)
    out = user_path(folder, InputError)
    if file_kind(out) != "folder":
        raise InputError(f"{folder}: no such folder; expected the folder of a batch of 'label'")
    _check_holds_results(str(folder), out)
    lists = BatchIndex(claim(out, force=True))
    return _listed(lists, str(folder), parquet, force=force, progress=progress)


def _check_holds_results(shown: str, out: Path) -> None:
    if next(_labelled(out), None) is None:
        raise InputError(
            f"{shown}: no labelled map (a folder with {MANIFEST_FILE}) below it; expected the "
            "folder of a batch of 'label'"
        )


def _listed(
    lists: BatchIndex, shown: str, parquet: bool, *, force: bool, progress: Progress
) -> tuple[Overview, list[str]]:
    """Rebuild the index in a local folder; ``shown`` is its name in messages."""
    lists.begin(force=force)
    if parquet:
        with progress.stage("places"):
            names = (row.name for row, _ in _labelled(lists.out))
            write_place_table(lists.out / PLACE_TABLE, lists.out, names)
    with progress.stage("labelled maps"):
        overview = lists.end(lambda: lists.rebuild(lambda: _labelled(lists.out)))
    written = [path.name for path in lists.files()] + [PLACE_TABLE] * parquet
    return overview, [f"{shown}/{name}" for name in written]


def _labelled(out: Path) -> Iterator[tuple[LabelledRow, float]]:
    """The labelled maps below a folder, sorted, each with its time stamp."""
    root = recorded_root(out)
    for folder, below, _ in os.walk(out):
        below[:] = sorted(name for name in below if not name.startswith("."))
        manifest = detail_path(Path(folder), MANIFEST_FILE)
        if not manifest.exists():
            continue
        below[:] = [name for name in below if name != DETAILS]
        name = Path(folder).relative_to(out).as_posix()
        row = None if name == "." else labelled_row(Path(folder), name)
        if row is not None:
            yield _in_root(row, root), manifest.stat().st_mtime


def _in_root(row: LabelledRow, root: Path | None) -> LabelledRow:
    """The row with the current path of its map, if the input was moved."""
    moved = None if root is None else root / f"{row.name}.yaml"
    return replace(row, map=str(moved)) if moved is not None and moved.exists() else row


PLACE_TABLE = "places.parquet"

_MAPS_AT_ONCE = 1000
"""Maps per row group of the file, whose places are in memory at once."""


def write_place_table(path: Path, out: Path, names: Iterable[str]) -> Path:
    """Write the places of all maps as Parquet; the path.

    Columns: ``map`` (its name), ``place`` (its id), ``name``, ``label``, ``area_m2``,
    ``confidence`` (null where unknown), ``doubtful_m2``, ``x_m`` and ``y_m`` (the anchor in the
    map's frame), and ``connected_to`` (the ids of its neighbours).
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
    remaining = iter(names)
    with atomic_file(path) as temporary, parquet.ParquetWriter(temporary, schema) as writer:
        while group := list(islice(remaining, _MAPS_AT_ONCE)):
            rows = [row for name in group for row in _places(out / name, name)]
            writer.write_table(arrow.Table.from_pylist(rows, schema))
    return path


def _places(folder: Path, name: str) -> list[dict[str, Any]]:
    """The places of one map; none if its file is damaged or missing."""
    try:
        wanted = "a topological map"
        record = read_json(places_path(folder), InputError, wanted, max_bytes=MAX_BYTES)
        near: dict[int, set[int]] = {}
        for connection in record["connections"]:
            near.setdefault(int(connection["first"]), set()).add(int(connection["second"]))
            near.setdefault(int(connection["second"]), set()).add(int(connection["first"]))
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


def write_check_first(folder: Path, stage: Path, old: str, new: str) -> bool:
    """Write a map's manifest with the new name, if the renamed place is the one to check first."""
    record = manifest_record(folder)
    if record is None or record.get("figures", {}).get("check_first") != old:
        return False
    record["figures"]["check_first"] = new
    path = stage / MANIFEST_FILE
    path.parent.mkdir(exist_ok=True)
    write_text(path, json.dumps(record, indent=1, allow_nan=False) + "\n")
    return True


def rewrite_row(folder: Path) -> None:
    """Rewrite a map's row and the page of its batch, if it belongs to a batch."""
    out = batch_of(folder)
    if out is None:
        return
    row = labelled_row(folder, folder.resolve().relative_to(out).as_posix())
    if row is not None:
        lists = BatchIndex(out)
        lists.begin()
        lists.add(row)
        lists.end(lists.settle)
