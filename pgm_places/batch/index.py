"""The lists of a folder of results, made anew from what lies in it."""

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from pgm_places.batch.batch_folder import recorded_root
from pgm_places.batch.far_maps import results_of
from pgm_places.batch.lists import LISTS, Lists
from pgm_places.batch.manifest import MANIFEST_FILE, LabelledRow, labelled_row
from pgm_places.batch.overview import Overview
from pgm_places.batch.place_table import PLACE_TABLE, write_place_table
from pgm_places.errors import InputError
from pgm_places.io.far_files import address_of
from pgm_places.io.input_file import file_kind, is_address, user_path
from pgm_places.io.output_set import claim
from pgm_places.io.places.topology_files import TOPOLOGY_FILE
from pgm_places.progress import Progress


@dataclass(frozen=True)
class Index:
    """What is in a folder, and the files that list it."""

    overview: Overview
    written: tuple[str, ...]


def index_folder(
    folder: Path, *, parquet: bool = False, force: bool = False, progress: Progress
) -> Index:
    """List all labelled maps below a folder, or behind an address.

    Raises
    ------
    InputError
        There is no such folder, or no labelled map in it; or Parquet cannot be written here.
    OutputError
        The lists cannot be written, or files of the user's own are in their way.
    """
    if is_address(folder):
        wanted = (MANIFEST_FILE, TOPOLOGY_FILE) if parquet else (MANIFEST_FILE,)
        shown = address_of(folder)
        with results_of(folder, wanted, LISTS) as (here, put):
            _check_holds_results(shown, here)
            lists = Lists(here, put=put)
            index = _listed(lists, shown.rstrip("/"), parquet, force=force, progress=progress)
            put()  # the table of places as well
        return index
    out = user_path(folder, InputError)
    if file_kind(out) != "folder":
        raise InputError(f"{folder}: no such folder; expected one that 'label' wrote many maps to")
    _check_holds_results(str(folder), out)
    lists = Lists(claim(out, force=True))
    return _listed(lists, str(folder), parquet, force=force, progress=progress)


def _check_holds_results(shown: str, out: Path) -> None:
    if next(_labelled(out), None) is None:
        raise InputError(
            f"{shown}: no labelled map below it (a folder with {MANIFEST_FILE}), as 'label' "
            "writes them for many maps"
        )


def _listed(lists: Lists, shown: str, parquet: bool, *, force: bool, progress: Progress) -> Index:
    """Make the lists of a folder on this machine, which is called as shown."""
    lists.begin(force=force)
    with progress.stage("labelled maps"):
        overview = lists.rebuild(lambda: _labelled(lists.out))
        lists.write_page(overview)
    written = [path.name for path in lists.files()]
    if parquet:
        with progress.stage("places"):
            names = (row.name for row, _ in _labelled(lists.out))
            write_place_table(lists.out / PLACE_TABLE, lists.out, names)
            written.append(PLACE_TABLE)
    return Index(overview, tuple(f"{shown}/{name}" for name in written))


def _labelled(out: Path) -> Iterator[tuple[LabelledRow, float]]:
    """The labelled maps below a folder in order, each with the time that it was labelled at."""
    root = recorded_root(out)
    for folder, below, files in os.walk(out):
        below[:] = sorted(name for name in below if not name.startswith("."))
        name = Path(folder).relative_to(out).as_posix()
        if MANIFEST_FILE not in files or name == ".":
            continue
        row = labelled_row(Path(folder), name)
        if row is not None:
            yield _in_root(row, root), (Path(folder) / MANIFEST_FILE).stat().st_mtime


def _in_root(row: LabelledRow, root: Path | None) -> LabelledRow:
    """The row with the path that its map has now, where the whole input was moved."""
    moved = None if root is None else root / f"{row.name}.yaml"
    return replace(row, map=str(moved)) if moved is not None and moved.exists() else row
