"""Transactional output: files are staged, then moved into place together; others stay."""

import contextlib
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from pgm_places.errors import OutputError
from pgm_places.io import staging
from pgm_places.io.atomic import tidy, write_text
from pgm_places.io.input_file import is_address, sha256_of
from pgm_places.io.staging import NEW, UNFINISHED, stage

RECORD_FILE = ".pgm-places.json"
"""The record of the files of this package in a folder: SHA-256 and command of each."""

_FORMAT, _SCHEMA = "pgm-places output", 1
_MAX_BYTES = 16 << 20


@dataclass
class OutputSet:
    """Files of a run that are written to ``stage`` for a folder; ``written`` after the block."""

    folder: Path
    stage: Path
    written: list[Path]


def _refuse_address(folder: Path) -> None:
    """Refuse addresses such as ``s3://...``, which would become a folder called ``s3:``."""
    if is_address(folder):
        raise OutputError(
            f"{folder}: an address, not a folder on this machine; write to one and copy that"
        )


@contextlib.contextmanager
def output_set(
    folder: Path | str,
    by: str,
    *,
    names: Iterable[str] = (),
    force: bool = False,
    shared: bool = False,
    replaces: Iterable[str] = (),
    keeps_owners: bool = False,
) -> Iterator[OutputSet]:
    """Stage files and move all of them into a folder, created if needed, at the end of the block.

    Until then, and after an error, Ctrl-C or a kill, the folder is unchanged. The new set replaces
    the earlier set of the command ``by``; the user's files stay. A set without files changes
    nothing.

    ``names`` are files that will be written, so that conflicts are refused before the work.
    ``force`` overwrites foreign and changed files. A ``shared`` folder may be the user's own: only
    files in the way are refused. Unchanged files of ``replaces``, of any command, are removed. With
    ``keeps_owners``, files of other commands stay theirs, and the earlier set of this command
    stays.
    """
    shown = Path(folder)
    _refuse_address(shown)
    with staging.as_output_errors(shown):
        _tidy(shown)
        target = shown.resolve()
        _check(shown, set(names), by, force=force, shared=shared)
        inside = shared or (target.is_dir() and not staging.can_be_exchanged(target))
        parent = target if inside else target.parent
        with staging.make_folders(parent), stage(parent, target.name) as aside:
            files = OutputSet(shown, aside / NEW, [])
            files.stage.mkdir()
            with _named(files.stage, shown):
                yield files
            written = staging.file_names(files.stage)
            if not written:
                return
            with staging.locked(target):
                staging.finish(target)
                _check(shown, written, by, force=force, shared=shared or inside)
                old = _record(target) or {}
                gone = {name for name in replaces if is_as_written(target / name)}
                new = {
                    name: entry
                    for name, entry in old.items()
                    if (keeps_owners or entry["by"] != by) and name not in gone
                }
                new |= {
                    name: {
                        "by": old[name]["by"] if keeps_owners and name in old else by,
                        "sha256": sha256_of(files.stage / name),
                    }
                    for name in sorted(written)
                }
                (files.stage / RECORD_FILE).write_text(_record_text(new), encoding="utf-8")
                staging.swap_in(aside, target, old.keys() - new.keys(), in_place=inside)
            files.written = [shown / name for name in sorted(written)]


def claim(folder: Path | str, *, force: bool = False) -> Path:
    """Mark a folder as this package's by a record, empty if new, before results arrive."""
    shown = Path(folder)
    _refuse_address(shown)
    with staging.as_output_errors(shown):
        _tidy(shown)
        _check(shown, set(), "", force=force, shared=False)
        with staging.locked(shown.resolve()):
            if _record(shown) is None:
                write_text(shown / RECORD_FILE, _record_text({}))
    return shown


def _tidy(folder: Path) -> None:
    """Complete or remove leftovers of killed runs, also of a run killed during ``claim``."""
    tidy(folder)
    staging.remove_leftovers(folder.resolve(), RECORD_FILE)


def has_all_files(folder: Path) -> bool:
    """Whether a folder holds every file of its record, and no interrupted move is pending."""
    record = _record(folder)
    return (
        record is not None
        and not (folder / UNFINISHED).exists()
        and all((folder / name).is_file() for name in record)
    )


def is_as_written(path: Path, folder: Path | None = None) -> bool:
    """Whether a file is recorded in a folder (by default its own) and unchanged."""
    home = folder or path.parent
    entry = (_record(home) or {}).get(path.relative_to(home).as_posix())
    return entry is not None and path.is_file() and sha256_of(path) == entry["sha256"]


def written_names(folder: Path) -> set[str]:
    """The recorded files of a folder, including deleted ones."""
    return set(_record(folder) or ())


def _record_text(files: Mapping[str, Mapping[str, str]]) -> str:
    return json.dumps({"format": _FORMAT, "schema": _SCHEMA, "files": files}, indent=1) + "\n"


@contextlib.contextmanager
def _named(staged: Path, shown: Path) -> Iterator[None]:
    """Replace the path of a staged file in errors by its destination."""
    try:
        yield
    except OutputError as error:
        raise OutputError(str(error).replace(str(staged), str(shown))) from error


def _check(folder: Path, names: set[str], by: str, *, force: bool, shared: bool) -> None:
    """Refuse to overwrite or remove files that are not recorded or were changed."""
    if not folder.is_dir():
        return
    # Listed before the record is read: other processes that claim the folder now write files only
    # after their record. Staging folders do not count.
    others = sorted(
        path.name for path in folder.iterdir() if not staging.is_stage_of(path.name, RECORD_FILE)
    )
    record = _record(folder)
    for name in sorted(names):
        if (folder / name).is_dir():
            raise OutputError(
                f"cannot write the file {folder / name}: a folder of that name is in the way; "
                "choose another path or remove it"
            )
    if force:
        return
    if others and record is None and not shared:
        raise OutputError(
            f"cannot write into {folder}: it holds files that pgm-places did not write, such as "
            f"{others[0]}; choose another folder, or pass --force to write there anyway"
        )
    record = record or {}
    mine = {name for name, entry in record.items() if entry["by"] == by}
    for name in sorted(names | mine):
        path = folder / name
        if not path.exists() and not path.is_symlink():
            continue
        if name not in record:
            what = "it exists already, and pgm-places did not write it"
        elif path.is_symlink() or sha256_of(path) != record[name]["sha256"]:
            what = "it was changed since pgm-places wrote it"
        else:
            continue
        raise OutputError(
            f"cannot overwrite {path}: {what}; choose another folder, move the file away, or "
            "pass --force to overwrite it"
        )


def _record(folder: Path) -> dict[str, dict[str, str]] | None:
    """The record of a folder by file; None if it is missing or damaged."""
    path = folder / RECORD_FILE
    try:
        if path.stat().st_size > _MAX_BYTES:
            return None
        content = json.loads(path.read_text(encoding="utf-8"))
        files = content["files"]
        if content["format"] != _FORMAT or any(".." in name or name[:1] == "/" for name in files):
            return None
        return {
            str(name): {"by": str(entry["by"]), "sha256": str(entry["sha256"])}
            for name, entry in files.items()
        }
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return None
