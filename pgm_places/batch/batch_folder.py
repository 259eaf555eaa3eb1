"""The folder that the results of many maps are written to: its names, its root, its claims."""

import hashlib
import os
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path, PurePosixPath

from pgm_places.batch.found_maps import FoundMap
from pgm_places.batch.lists import LISTS
from pgm_places.batch.manifest import Failure
from pgm_places.errors import InputError
from pgm_places.io.atomic import write_json
from pgm_places.io.input_file import is_address, read_json
from pgm_places.io.staging import claimed, remove_leftovers

_RECORD = ".pgm-places-batch.json"
_CLAIMS = ".pgm-places-claims"
_FORMAT, _SCHEMA = "pgm-places batch", 1
_MAX_BYTES = 1 << 16


def recorded_root(out: Path) -> Path | None:
    """The folder that the names in ``out`` start from; None where it is unknown, or has moved."""
    try:
        record = read_json(out / _RECORD, InputError, "a batch's record", max_bytes=_MAX_BYTES)
        root = Path(record["root"])
    except (InputError, LookupError, TypeError):
        return None
    return root if is_address(root) or root.is_dir() else None


def write_root(out: Path, root: Path) -> None:
    """Keep the root for later runs."""
    if recorded_root(out) != root:
        record = {"format": _FORMAT, "schema": _SCHEMA, "root": str(root)}
        write_json(out / _RECORD, record, indent=1)


def claim_of(out: Path, name: str) -> Path:
    """The file that stands for the right to label a map."""
    digest = hashlib.sha256(name.encode("utf-8", "surrogateescape")).hexdigest()
    return out / _CLAIMS / digest[:32]


def tidy_after_the_dead(out: Path) -> None:
    """Remove what workers left that died on a map: their claims, and files that nobody completes.

    A worker that dies when it has just completed a map leaves an empty folder beside it, which no
    later run would find, because the map is done.
    """
    claims = out / _CLAIMS
    for path in list(claims.iterdir()) if claims.is_dir() else ():
        with claimed(path) as is_free:
            if is_free and path.stat().st_size <= _MAX_BYTES:
                name = PurePosixPath(os.fsdecode(path.read_bytes()))
                if name.name and not name.is_absolute() and ".." not in name.parts:
                    remove_leftovers((out / name.parent).resolve(), name.name)
    with suppress(OSError):  # another batch holds claims
        claims.rmdir()


def names_in_the_way(maps: Iterable[FoundMap]) -> Iterator[Failure]:
    """The maps whose folders would hold those of others, or be called like the lists of all."""
    reserved = {name.casefold() for name in LISTS}
    by_name = {item.name.casefold(): item for item in maps}
    found: dict[str, str] = {}
    for name, item in by_name.items():
        parts = name.split("/")
        if parts[0] in reserved:
            found[item.name] = "its folder would be called like a list of all maps"
        for n in range(1, len(parts)):
            holder = by_name.get("/".join(parts[:n]))
            if holder is not None:
                found[holder.name] = f"its folder would hold that of {item.path}"
    for item in maps:
        if by_name[item.name.casefold()] is not item:
            other = by_name[item.name.casefold()].path
            found[item.name] = f"its name differs from that of {other} by capital letters alone"
        if item.name in found:
            message = f"{item.path}: {found[item.name]}; rename the map or its folder"
            yield Failure(item.name, str(item.path), "MapError", message)
