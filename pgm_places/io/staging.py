"""Staging folders for incomplete output, locks, and the exchange of a folder's content."""

import contextlib
import ctypes
import errno
import json
import os
import re
import shutil
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path, PurePosixPath

from pgm_places.errors import OutputError

try:
    import fcntl
except ImportError:  # Windows: no locks, and leftovers are not removed
    fcntl = None  # type: ignore[assignment]

_NO_LINKS = getattr(os, "O_NOFOLLOW", 0)
_IN_USE: set[Path] = set()
"""The staging folders in use by this process."""


@contextlib.contextmanager
def stage(parent: Path, name: str) -> Iterator[Path]:
    """A new folder ``.NAME.<12 digits>.tmp`` in ``parent``, removed at the end of the block.

    Its lock distinguishes an active run from a killed one, whose folder a later call removes.
    """
    remove_leftovers(parent, name)
    while True:
        folder = parent / f".{name}.{os.urandom(6).hex()}.tmp"
        folder.mkdir(parents=True)  # a failed neighbour may just have removed the parent
        lock = _lock(folder)
        if lock is not None:
            break  # otherwise another process removed it as a leftover before it was locked
    _IN_USE.add(folder.absolute())
    try:
        yield folder
    finally:
        _IN_USE.discard(folder.absolute())
        shutil.rmtree(folder, ignore_errors=True)
        os.close(lock)


def is_staged(path: Path) -> bool:
    """Whether a path is in a staging folder, which is flushed to disk before it is moved."""
    return not _IN_USE.isdisjoint(path.absolute().parents)


def is_stage_of(entry: str, name: str) -> bool:
    """Whether a folder's name is that of a staging folder for ``name``."""
    return (
        entry.startswith(f".{name}.")
        and re.fullmatch(r"[0-9a-f]{12}\.(tmp|old)", entry.removeprefix(f".{name}.")) is not None
    )


def remove_leftovers(parent: Path, name: str) -> None:
    """Remove the staging folders for ``name`` that killed runs left in ``parent``."""
    if fcntl is None or not parent.is_dir():
        return
    with contextlib.suppress(OSError):  # a folder that cannot be listed has no staging folders
        for path in [entry for entry in parent.iterdir() if is_stage_of(entry.name, name)]:
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
    """Hold an exclusive lock on ``folder``, or on its parent if it does not exist."""
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
    """Try to hold the lock file for the duration of the block; yields whether we got it.

    The file contains the note. Without locks in the file system, every caller gets True.
    """
    if path is None or fcntl is None:
        yield True
        return
    lock = None
    while lock is None:
        with as_output_errors(path):
            _refuse_link(path.parent)
            path.parent.mkdir(parents=True, exist_ok=True)
            try:
                os.close(open_own(path, os.O_WRONLY | os.O_CREAT))
            except FileNotFoundError:  # another process has just removed the empty folder
                continue
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
            number = open_own(path, os.O_WRONLY | os.O_TRUNC)
            with as_output_errors(path), os.fdopen(number, "wb") as file:
                file.write(os.fsencode(note))
        yield True
    finally:
        path.unlink(missing_ok=True)
        os.close(lock)


def open_own(path: Path, flags: int) -> int:
    """Open a lock or record file, refusing symbolic links; returns the file descriptor."""
    _refuse_link(path)
    return os.open(path, flags | _NO_LINKS, 0o666)


def _refuse_link(path: Path) -> None:
    """Refuse a symbolic link, which may lead to another user's file."""
    if path.is_symlink():
        raise OutputError(f"cannot write {path}: it is a symbolic link; remove it")


def _lock(path: Path, *, wait: bool = True) -> int | None:
    """A file descriptor that holds the lock; None if it is taken or the path has moved."""
    flags = os.O_RDONLY | _NO_LINKS | getattr(os, "O_NONBLOCK", 0)
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
    """Turn an operating system's errors into one line that names the target."""
    try:
        yield
    except BrokenPipeError:  # standard output was closed by its reader
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
        if parent.exists():  # checked first: another process may create it now
            if parent.is_dir():
                break
            raise OutputError(
                f"cannot write {folder}: {parent} is a file, not a folder; choose another path or "
                "remove it"
            )
        missing.append(parent)
    folder.mkdir(parents=True, exist_ok=True)
    try:
        yield
    except BaseException:
        with contextlib.suppress(OSError):  # another process has begun to use it
            for parent in missing:
                parent.rmdir()
        raise


def flush_tree(folder: Path) -> None:
    """Flush all files of a folder to disk, so that a crash after the move loses nothing."""
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


NEW = "new"
"""The subfolder of a staging folder that holds the new files."""

UNFINISHED = ".pgm-places.swap"
"""The name of a staging folder while its files are moved one by one."""

_REMOVED = "removed.json"
_MAX_BYTES = 16 << 20


def swap_in(stage: Path, target: Path, removed: Iterable[str] = (), *, in_place: bool) -> None:
    """Move the files in ``stage/new`` into ``target`` and remove ``removed``; all others stay.

    A new target is renamed into place. An existing one, locked by the caller, is exchanged in a
    single system call for a folder with the new files and hard links to all others. If that is
    impossible (see ``can_be_exchanged``) or unwanted (``in_place``), the stage is renamed into the
    folder and its files are moved one by one; ``finish`` completes an interrupted move.
    """
    new, names = stage / NEW, file_names(stage / NEW)
    if is_staged(target) and not target.exists():
        new.rename(target)
        return
    flush_tree(new)
    if not target.exists():
        new.rename(target)
        flush(target.parent)
        return
    gone = {*names, *removed}
    if not in_place and can_be_exchanged(target) and _exchanged(new, target, gone):
        return
    (stage / _REMOVED).write_text(json.dumps(sorted(set(removed) - names)), encoding="utf-8")
    flush_tree(stage)
    stage.rename(target / UNFINISHED)
    flush(target)
    finish(target)


def finish(target: Path) -> None:
    """Complete an interrupted ``swap_in`` in a folder; the caller holds its lock."""
    stage = target / UNFINISHED
    if not stage.is_dir() or stage.is_symlink():
        return
    _refuse_link(stage / NEW)
    # All names are checked before anything is moved or removed: the folder may be another user's.
    removed = [_inside(target, name) for name in _removed(stage)]
    moved = [(stage / NEW / name, _inside(target, name)) for name in file_names(stage / NEW)]
    for new, path in sorted(moved):
        path.parent.mkdir(parents=True, exist_ok=True)
        new.replace(path)
    for path in removed:
        path.unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # not empty
            if path.parent != target:
                path.parent.rmdir()
    _flush_folders(target, [path.relative_to(target).as_posix() for _, path in moved])
    shutil.rmtree(stage)


def can_be_exchanged(target: Path) -> bool:
    """Whether a folder can be exchanged for another one.

    It must be no mount point, not contain this process's current folder, and its parent be
    writable.
    """
    with contextlib.suppress(FileNotFoundError):  # the current folder may be deleted
        if Path.cwd().is_relative_to(target):
            return False
    return not target.is_mount() and os.access(target.parent, os.W_OK | os.X_OK)


def file_names(folder: Path) -> set[str]:
    """The files in a folder and its subfolders, as relative names with slashes."""
    return {
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.is_symlink() or not path.is_dir()
    }


def _flush_folders(folder: Path, names: Iterable[str]) -> None:
    """Flush a folder and the subfolders of the named files, but not the files."""
    below = {parent for name in names for parent in PurePosixPath(name).parents}
    for path in {folder, *(folder / parent for parent in below)}:
        flush(path)


def _removed(stage: Path) -> list[str]:
    """The names that an interrupted swap must still remove."""
    path = stage / _REMOVED
    try:
        is_small = path.stat().st_size <= _MAX_BYTES
        names = json.loads(path.read_text(encoding="utf-8")) if is_small else None
    except FileNotFoundError:
        return []
    except (ValueError, RecursionError):
        names = None
    if not (isinstance(names, list) and all(map(_can_be_a_file, names))):
        raise OSError(f"{path} is damaged; remove {stage} to continue without it")
    return names


def _can_be_a_file(name: object) -> bool:
    try:
        return isinstance(name, str) and b"\0" not in os.fsencode(name)
    except UnicodeEncodeError:  # a surrogate
        return False


def _inside(target: Path, name: str) -> Path:
    """The path of a name in the folder; refuses names that lead outside."""
    path = target.joinpath(*PurePosixPath(name).parts)
    if ".." in path.parts or not path.parent.resolve().is_relative_to(target.resolve()):
        raise OSError(
            f"{name!r} in {target / UNFINISHED} points outside the folder; remove that entry"
        )
    return path


def _exchanged(new: Path, target: Path, gone: set[str]) -> bool:
    """Exchange ``new`` and ``target`` after linking all files but ``gone``; whether it worked."""

    def left_out(folder: str, names: list[str]) -> set[str]:
        base = Path(folder).relative_to(target)
        return {name for name in names if (base / name).as_posix() in gone}

    try:
        shutil.copytree(
            target, new, symlinks=True, dirs_exist_ok=True, copy_function=os.link, ignore=left_out
        )
        was, now = target.stat(), new.stat()
        if (was.st_uid, was.st_gid) != (now.st_uid, now.st_gid):
            os.chown(new, was.st_uid, was.st_gid)
        _flush_folders(new, file_names(new))
        _exchange(new, target)
    except OSError:  # the file system cannot link, change the owner or exchange
        for name in file_names(new) - gone:
            (new / name).unlink()
        return False
    flush(target.parent)
    for name in file_names(new) - gone - file_names(target):  # created during the linking
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        (new / name).rename(target / name)
    return True


def _exchange(one: Path, other: Path) -> None:
    """Exchange two paths in one step."""
    swap = 2  # RENAME_EXCHANGE of Linux, RENAME_SWAP of macOS
    names = os.fsencode(one), os.fsencode(other)
    if sys.platform == "win32":
        raise OSError("Windows has no call for it")
    library = ctypes.CDLL(None, use_errno=True)
    try:
        if sys.platform == "darwin":
            failed = library.renamex_np(*names, swap)
        else:
            here = -100  # AT_FDCWD: paths as anywhere else
            failed = library.renameat2(here, names[0], here, names[1], swap)
    except AttributeError:
        raise OSError("this C library has no call for it") from None
    if failed:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
