"""Atomic output: files and folders are staged, then moved into place."""

import contextlib
import errno
import json
import os
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from pgm_places.errors import OutputError
from pgm_places.io import staging
from pgm_places.io.staging import NEW, can_be_exchanged, file_names, finish, swap_in

HEAD = 64 << 10
"""Bytes that are read to determine the kind."""

_MAGIC = {
    b"\x89PNG\r\n\x1a\n": "a PNG",
    b"P5": "a PGM",
    b"P2": "a PGM",
    b"II*\0": "a TIFF",
    b"MM\0*": "a TIFF",
    b"\xff\xd8": "a JPEG",
    b"BM": "a BMP",
    b"PK\x03\x04": "an archive",
    b"%PDF": "a PDF",
}
_PNG_COLOURS = {0: "grey", 2: "colour", 3: "indexed", 4: "grey", 6: "colour"}
_KEY = re.compile(r"^(\w+)[ \t]*:", re.MULTILINE)
_FORMAT = re.compile(r'"(?:format|type)"\s*:\s*("(?:[^"\\]|\\.)*")')


def kind_of(head: bytes) -> str:
    r"""The kind of a file by its first bytes.

    Examples
    --------
    >>> kind_of(b"image: map.pgm\nresolution: 0.05\n"), kind_of(b"values:\n  room: 77\n")
    ('the description of a map', 'a file of label names')
    """
    for magic, name in _MAGIC.items():
        if head.startswith(magic):
            kind = _PNG_COLOURS.get(head[25]) if name == "a PNG" and len(head) > 25 else None
            return f"{name} ({kind})" if kind else name
    if b"\0" in head:
        return "a binary file"
    text = head.decode("utf-8", "replace").lstrip("\ufeff \t\r\n")
    if text.startswith("{"):
        if len(head) < HEAD and not _is_json(text):
            return ""  # damaged
        match = _FORMAT.search(text)
        return f"JSON ({json.loads(match[1], strict=False)})" if match else "JSON"
    keys = set(_KEY.findall(text))
    if {"image", "resolution"} <= keys:
        return "the description of a map"
    return "a file of label names" if "values" in keys else "text"


def _is_json(text: str) -> bool:
    try:
        json.loads(text)
    except (ValueError, RecursionError):
        return False
    return True


def refuse_another_kind(path: Path, new: bytes) -> None:
    """Refuse to overwrite a file of another kind; an empty or damaged file may be overwritten."""
    try:
        with path.open("rb") as file:
            old = file.read(HEAD)
    except OSError:  # no file, or an unreadable one, which the writer will report
        return
    there, coming = kind_of(old), kind_of(new[:HEAD])
    if old and there and there != coming:
        raise OutputError(
            f"cannot overwrite {path}: it is {there}, and {coming} would take its place; choose "
            "another name, or move the file away"
        )


def write_bytes(path: Path | str, data: bytes) -> Path:
    """Write a file atomically, with its parent folders; returns its path.

    Raises
    ------
    OutputError
        The file cannot be written, or a file of another kind exists there, such as an image.
    """
    refuse_another_kind(Path(path), data)
    with atomic_file(path) as temporary:
        temporary.write_bytes(data)
    return Path(path)


def write_text(path: Path | str, text: str) -> Path:
    """Write text as :func:`write_bytes` does, in UTF-8 with Unix line ends; returns the path."""
    return write_bytes(path, text.encode("utf-8"))


def write_json(path: Path | str, value: Any, **options: Any) -> Path:
    """Write JSON as :func:`write_bytes` does, with options of ``json.dumps``; returns the path."""
    return write_text(path, json.dumps(value, **{"allow_nan": False, **options}) + "\n")


@contextlib.contextmanager
def atomic_file(path: Path | str) -> Iterator[Path]:
    """A temporary path to write to, renamed to ``path`` at the end of the block.

    After an exception, Ctrl-C included, it is removed and ``path`` is unchanged; every ``OSError``
    becomes an OutputError.
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
    """A new temporary folder that replaces ``path`` at the end of the block.

    A folder at ``path`` that is neither empty nor replaceable (``replaces(path)``) is refused
    before anything is written. After an exception, Ctrl-C included, ``path`` is unchanged.
    """
    target = Path(path)
    with staging.as_output_errors(target):
        check_folder_target(target, replaces=replaces)
        target = target.resolve()
        inside = target.is_dir() and not can_be_exchanged(target)
        parent = target if inside else target.parent
        with staging.make_folders(parent):
            old = file_names(target)  # before the stage is created in it
            with staging.stage(parent, target.name) as folder:
                (folder / NEW).mkdir()
                yield folder / NEW
                with staging.locked(target):
                    finish(target)
                    if not inside:
                        _refuse_others(target, replaces)  # checked again: hours may have passed
                        old = file_names(target)
                    swap_in(folder, target, old, in_place=inside)


def check_folder_target(
    path: Path | str, *, replaces: Callable[[Path], bool] | None = None
) -> None:
    """Refuse a path at which ``atomic_folder`` would fail; leftovers of killed runs are removed."""
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
    """Complete or remove leftovers of a killed run in a folder; refuse an unwritable one."""
    target = Path(path)
    with staging.as_output_errors(target):
        # In this order: another process may create the folder between the two checks.
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
