"""Atomic output: files are written under another name, then renamed."""

import contextlib
import os
import secrets
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

from pgm_places.errors import OutputError

__all__ = [
    "atomic_file",
    "atomic_folder",
    "check_folder_target",
    "check_writable_folder",
    "write_bytes",
    "write_text",
]


def write_bytes(path: Path | str, data: bytes) -> Path:
    """The path, once the file holds exactly ``data``; parent folders are made.

    Raises
    ------
    OutputError
        Where the file cannot be written. What stood there before is then untouched.
    """
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


@contextlib.contextmanager
def atomic_file(path: Path | str) -> Iterator[Path]:
    """A temporary path beside ``path`` to write to; renamed to ``path`` when the block ends well.

    After an exception, Ctrl-C included, the temporary file is gone and ``path`` is as before.

    Raises
    ------
    OutputError
        For every ``OSError`` on the way: a folder that cannot be written, a full disk, a folder
        that stands where the file should go.
    """
    target = Path(path)
    with _as_output_errors(target):
        _make_parent(target)
        if target.is_dir():
            raise OutputError(
                f"cannot write the file {target}: a folder of that name is in the way; choose "
                "another path or remove it"
            )
        temporary = _sibling(target, "tmp")
        try:
            yield temporary
            _flush_to_disk(temporary)
            temporary.replace(target)
        finally:
            temporary.unlink(missing_ok=True)


@contextlib.contextmanager
def atomic_folder(
    path: Path | str, *, replaces: Callable[[Path], bool] | None = None
) -> Iterator[Path]:
    """A new empty folder beside ``path``; renamed to ``path`` when the block ends well.

    A folder that already stands at ``path`` is replaced where it is empty or where
    ``replaces(path)`` is true, and refused otherwise, before anything is written.
    After an exception, Ctrl-C included, the new folder is gone and ``path`` is as before.

    Raises
    ------
    OutputError
        Where the folder cannot be written or another one is in the way.
    """
    target = Path(path)
    with _as_output_errors(target):
        _make_parent(target)
        check_folder_target(target, replaces=replaces)
        temporary = _sibling(target, "tmp")
        temporary.mkdir()
        try:
            yield temporary
            for file in temporary.rglob("*"):
                if file.is_file():
                    _flush_to_disk(file)
            _swap_in(temporary, target)
        finally:
            if temporary.exists():
                shutil.rmtree(temporary, ignore_errors=True)


def check_folder_target(
    path: Path | str, *, replaces: Callable[[Path], bool] | None = None
) -> None:
    """Refuse a path where ``atomic_folder`` would find something in the way.

    Raises
    ------
    OutputError
        Where a file stands there, or a folder that is neither empty nor to be replaced.
    """
    target = Path(path)
    with _as_output_errors(target):
        if not target.exists() and not target.is_symlink():
            return
        if target.is_symlink() or not target.is_dir():
            raise OutputError(
                f"cannot write the folder {target}: a file of that name is in the way; choose "
                "another path or remove it"
            )
        if any(target.iterdir()) and not (replaces is not None and replaces(target)):
            raise OutputError(
                f"cannot write the folder {target}: it exists and holds other files; choose "
                "another path or empty it"
            )


def check_writable_folder(path: Path | str) -> Path:
    """The folder, made where it was missing, after a file was written there and removed again.

    For commands that compute for minutes before they write: an unwritable folder is known at once.

    Raises
    ------
    OutputError
        Where the folder cannot be made or written to.
    """
    folder = Path(path)
    with _as_output_errors(folder):
        _make_parent(folder / "file")
        probe = _sibling(folder / "probe", "tmp")
        try:
            probe.write_bytes(b"")
        finally:
            probe.unlink(missing_ok=True)
    return folder


@contextlib.contextmanager
def _as_output_errors(target: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise OutputError(
            f"cannot write {target}: {reason}; check the permissions and the free space, or choose "
            "another path"
        ) from error


def _make_parent(target: Path) -> None:
    for parent in reversed(target.parents):
        if parent.exists() and not parent.is_dir():
            raise OutputError(
                f"cannot write {target}: {parent} is a file, not a folder; choose another path or "
                "remove it"
            )
    target.parent.mkdir(parents=True, exist_ok=True)


def _swap_in(new: Path, target: Path) -> None:
    """Rename ``new`` to ``target``; a folder that stands there survives until that succeeded."""
    if not target.exists():
        new.rename(target)
        return
    old = _sibling(target, "old")
    target.rename(old)
    try:
        new.rename(target)
    except BaseException:
        old.rename(target)
        raise
    shutil.rmtree(old, ignore_errors=True)


def _sibling(target: Path, suffix: str) -> Path:
    if target.name in ("", ".."):  # "." and the like: the folder's real name is wanted
        target = target.resolve()
    return target.with_name(f".{target.name}.{secrets.token_hex(6)}.{suffix}")


def _flush_to_disk(path: Path) -> None:
    with path.open("rb+") as file:
        os.fsync(file.fileno())
