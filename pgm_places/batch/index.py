"""The lists of a folder of results, made anew from what lies in it."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from pgm_places.batch.batch_folder import recorded_root
from pgm_places.batch.lists import Lists
from pgm_places.batch.manifest import MANIFEST_FILE, labelled_row
from pgm_places.batch.outcomes import LabelledRow
from pgm_places.batch.overview import Overview
from pgm_places.batch.place_table import PLACE_TABLE, write_place_table
from pgm_places.errors import InputError
from pgm_places.io.input_file import file_kind, user_path
from pgm_places.io.output_set import claim
from pgm_places.progress import Progress

__all__ = ["Index", "index_folder"]


@dataclass(frozen=True)
class Index:
    """What is in a folder, and the files that list it."""

    overview: Overview
    written: tuple[Path, ...]


def index_folder(
    folder: Path, *, parquet: bool = False, force: bool = False, progress: Progress
) -> Index:
    """List all labelled maps below a folder.

    Raises
    ------
    InputError
        There is no such folder, or no labelled map in it; or Parquet cannot be written here.
    OutputError
        The lists cannot be written, or files of the user's own are in their way.
    """
    out = user_path(folder, InputError)
    if file_kind(out) != "folder":
        raise InputError(f"{folder}: no such folder; expected one that 'label' wrote many maps to")
    if next(_labelled(out), None) is None:
        raise InputError(
            f"{folder}: no labelled map below it (a folder with {MANIFEST_FILE}), as 'label' "
            "writes them for many maps"
        )
    lists = Lists(claim(out, force=True))
    lists.begin(force=force)
    with progress.stage("labelled maps"):
        overview = lists.rebuild(lambda: _labelled(out))
        lists.write_page(overview)
    written = lists.files()
    if parquet:
        with progress.stage("places"):
            names = (row.name for row, _ in _labelled(out))
            written.append(write_place_table(out / PLACE_TABLE, out, names))
    return Index(overview, tuple(written))


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
    from dataclasses import replace

    moved = None if root is None else root / f"{row.name}.yaml"
    return replace(row, map=str(moved)) if moved is not None and moved.exists() else row
