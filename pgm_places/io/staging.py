"""Stages: hidden folders for output that is not complete yet, removed whatever happens."""

import contextlib
import errno
import os
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

from pgm_places.errors import OutputError

try:
    import fcntl
except ImportError:  # Windows: leftovers stay, and writers do not wait for each other
    fcntl = None  # type: ignore[assignment]

_IN_USE: set[Path] = set()
"""The stages of this process that are being filled."""


@contextlib.contextmanager
def stage(parent: Path, name: str) -> Iterator[Path]:
    """A new folder ``.NAME.<12 digits>.tmp`` in ``parent``, gone when the block ends.

    It stays locked for as long as the process lives, so that a later call can tell the leftovers of
    a killed run, which it removes, from the folder of a run that is still busy.
    """
    remove_leftovers(parent, name)
    while True:
        folder = parent / f".{name}.{os.urandom(6).hex()}.tmp"
        folder.mkdir(parents=True)  # a neighbour that failed may just have removed its own
        lock = _lock(folder)
        if lock is not None:
            break  # otherwise somebody took the new folder for a leftover before it was locked
    _IN_USE.add(folder.absolute())
    try:
        yield folder
    finally:
        _IN_USE.discard(folder.absolute())
        shutil.rmtree(folder, ignore_errors=True)
        os.close(lock)


def is_staged(path: Path) -> bool:
    """Whether a path is on a stage, all of which is flushed to disk before it is moved."""
    return not _IN_USE.isdisjoint(path.absolute().parents)


def remove_leftovers(parent: Path, name: str) -> None:
    """Remove what killed runs left in ``parent`` of their stages for ``name``."""
    if fcntl is None or not parent.is_dir():
        return
    pattern = re.compile(rf"\.{re.escape(name)}\.[0-9a-f]{{12}}\.(tmp|old)")
    with contextlib.suppress(OSError):  # a folder that cannot be listed hides nothing of ours
        for path in [entry for entry in parent.iterdir() if pattern.fullmatch(entry.name)]:
            lock = _lock(path, wait=False)
            if lock is None:
                continue
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink(missing_ok=True)
            os.close(lock)


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """A lock: nobody else changes the folder, or creates one at this path."""
    lock = None
    while folder.parent.is_dir():
        held = folder if folder.is_dir() else folder.parent
        lock = _lock(held)
        if lock is not None and (held == folder) is folder.is_dir():
            break
        if lock is not None:
            os.close(lock)
    try:
        yield
    finally:
        if lock is not None:
            os.close(lock)


@contextlib.contextmanager
def claimed(path: Path | None, note: str | None = None) -> Iterator[bool]:
    """Whether nobody else holds the claim that a file stands for; it is held during the block.

    The claim ends with the process, whatever ends that, and the file with the block; until then it
    holds the note. Where a file system knows no locks, nothing is held, and everybody gets it.
    """
    if path is None or fcntl is None:
        yield True
        return
    lock = None
    while lock is None:
        with as_output_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.touch()
        try:
            lock = _lock(path, wait=False)
        except OSError as error:
            if error.errno not in (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS):
                raise
            yield True
            return
        if lock is None and path.exists():  # else the last holder has just removed it
            yield False
            return
    try:
        if note is not None:
            with as_output_errors(path):
                path.write_bytes(os.fsencode(note))
        yield True
    finally:
        path.unlink(missing_ok=True)
        os.close(lock)


def _lock(path: Path, *, wait: bool = True) -> int | None:
    """An open file that holds the lock; None if another process holds it or the path has moved."""
    flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    if fcntl is None:
        return os.open(os.devnull, os.O_RDONLY)
    try:
        number = os.open(path, flags)
    except OSError:
        if not path.exists() or not wait:
            return None
        raise
    try:
        fcntl.flock(number, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        if os.path.samestat(os.fstat(number), path.stat()):
            return number
    except (BlockingIOError, FileNotFoundError):
        pass
    except OSError:
        os.close(number)
        raise
    os.close(number)
    return None


@contextlib.contextmanager
def as_output_errors(target: Path) -> Iterator[None]:
    """What the operating system refuses, as one line that names the target."""
    try:
        yield
    except BrokenPipeError:  # of standard output: nobody reads on
        raise
    except OSError as error:
        reason = error.strerror or str(error)
        raise OutputError(
            f"cannot write {target}: {reason}; check the permissions and the free space, or choose "
            "another path"
        ) from error


@contextlib.contextmanager
def make_folders(folder: Path) -> Iterator[None]:
    """The folder and its parents, created if needed; new ones are removed after an error."""
    missing = []
    for parent in (folder, *folder.parents):
        if parent.is_dir():
            break
        if parent.exists():
            raise OutputError(
                f"cannot write {folder}: {parent} is a file, not a folder; choose another path or "
                "remove it"
            )
        missing.append(parent)
    folder.mkdir(parents=True, exist_ok=True)
    try:
        yield
    except BaseException:
        with contextlib.suppress(OSError):  # somebody else has begun to use it
            for parent in missing:
                parent.rmdir()
        raise


def flush_tree(folder: Path) -> None:
    """Flush everything in a folder to disk before it is moved into place: a crash may follow."""
    for path in folder.rglob("*"):
        if not path.is_symlink():
            flush(path)
    flush(folder)


def flush(path: Path) -> None:
    """Flush a file, or the names in a folder, to disk."""
    if path.is_dir():
        if os.name != "posix":
            return
        number = os.open(path, os.O_RDONLY)
    else:
        number = os.open(path, os.O_RDWR)
    try:
        os.fsync(number)
    finally:
        os.close(number)
