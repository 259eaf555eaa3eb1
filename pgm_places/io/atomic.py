"""Atomic output: files and folders are written to a stage, then moved into place as a whole."""

import contextlib
import errno
import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from pgm_places.errors import OutputError
from pgm_places.io import staging
from pgm_places.io.file_kind import refuse_another_kind
from pgm_places.io.staging import NEW, can_be_exchanged, file_names, finish, swap_in


def write_bytes(path: Path | str, data: bytes) -> Path:
    """The path, once the file holds exactly ``data``; parent folders are made.

    Raises
    ------
    OutputError
        Where the file cannot be written, or one of another kind stands there: a map's description,
        an image, a model. What stood there before is then untouched.
    """
    refuse_another_kind(Path(path), data)
    with atomic_file(path) as temporary:
        temporary.write_bytes(data)
    return Path(path)


def write_text(path: Path | str, text: str) -> Path:
    """The path, once the file holds exactly ``text`` in UTF-8 with Unix line ends.

    Raises
    ------
    OutputError
        Where the file cannot be written. What stood there before is then untouched.
    """
    return write_bytes(path, text.encode("utf-8"))


def write_json(path: Path | str, value: Any, **options: Any) -> Path:
    """The path, once the file holds a value as JSON; options are those of ``json.dumps``.

    Raises
    ------
    OutputError
        Where the file cannot be written. What stood there before is then untouched.
    """
    return write_text(path, json.dumps(value, **{"allow_nan": False, **options}) + "\n")


@contextlib.contextmanager
def atomic_file(path: Path | str) -> Iterator[Path]:
    """A path on a stage to write to; renamed to ``path`` when the block ends well.

    After an exception, Ctrl-C included, the stage is gone and ``path`` is as before.

    Raises
    ------
    OutputError
        For every ``OSError`` on the way: a folder that cannot be written, a full disk, a folder
        that stands where the file should go.
    """
    target = Path(path)
    with staging.as_output_errors(target), staging.make_folders(target.parent):
        if target.is_dir():
            raise OutputError(
                f"cannot write the file {target}: a folder of that name is in the way; choose "
                "another path or remove it"
            )
        with staging.stage(target.parent, target.name) as folder:
            temporary = folder / target.name
            yield temporary
            if not staging.is_staged(target):
                staging.flush(temporary)
            temporary.replace(target)
        if not staging.is_staged(target):
            staging.flush(target.parent)


@contextlib.contextmanager
def atomic_folder(
    path: Path | str, *, replaces: Callable[[Path], bool] | None = None
) -> Iterator[Path]:
    """A new empty folder on a stage; it takes the place of ``path`` when the block ends well.

    A folder that already stands at ``path`` is replaced, with all it holds, where it is empty or
    where ``replaces(path)`` is true, and refused otherwise, before anything is written.
    After an exception, Ctrl-C included, the new folder is gone and ``path`` is as before.

    Raises
    ------
    OutputError
        Where the folder cannot be written or another one is in the way.
    """
    target = Path(path)
    with staging.as_output_errors(target):
        check_folder_target(target, replaces=replaces)
        target = target.resolve()
        inside = target.is_dir() and not can_be_exchanged(target)
        parent = target if inside else target.parent
        with staging.make_folders(parent):
            old = file_names(target)  # before there is a stage in it
            with staging.stage(parent, target.name) as folder:
                (folder / NEW).mkdir()
                yield folder / NEW
                with staging.locked(target):
                    finish(target)
                    if not inside:
                        _refuse_others(target, replaces)  # once more: hours may have passed
                        old = file_names(target)
                    swap_in(folder, target, old, in_place=inside)


def check_folder_target(
    path: Path | str, *, replaces: Callable[[Path], bool] | None = None
) -> None:
    """Refuse a path where ``atomic_folder`` would find something in the way, or could not write.

    What a killed run left there is put right first.

    Raises
    ------
    OutputError
        Where a file stands there, or a folder that is neither empty nor to be replaced, or a folder
        without permission to write.
    """
    target = Path(path)
    with staging.as_output_errors(target):
        tidy(target)
        _refuse_others(target, replaces)


def _refuse_others(target: Path, replaces: Callable[[Path], bool] | None) -> None:
    if not target.is_dir() or not any(target.iterdir()):
        return
    if replaces is None or not replaces(target):
        raise OutputError(
            f"cannot write the folder {target}: it exists and holds other files; choose another "
            "path or empty it"
        )


def tidy(path: Path | str) -> None:
    """Finish or clear away what a killed run left of a folder; refuse one that cannot be written.

    Raises
    ------
    OutputError
        Where a file stands in the way, or without permission to write.
    """
    target = Path(path)
    with staging.as_output_errors(target):
        # In this order: another process may make the folder between the two questions.
        if (target.exists() or target.is_symlink()) and not target.is_dir():
            raise OutputError(
                f"cannot write the folder {target}: a file of that name is in the way; choose "
                "another path or remove it"
            )
        target = target.resolve()
        writable = next(parent for parent in (target, *target.parents) if parent.exists())
        if not writable.is_dir():
            raise OutputError(
                f"cannot write {path}: {writable} is a file, not a folder; choose another path or "
                "remove it"
            )
        if not os.access(writable, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        for parent in (target.parent, target):
            staging.remove_leftovers(parent, target.name)
        with staging.locked(target):
            finish(target)
