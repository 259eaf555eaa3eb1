"""Swapping a finished set of files in for an older one, at once."""

import contextlib
import ctypes
import json
import os
import shutil
import sys
from collections.abc import Iterable
from pathlib import Path, PurePosixPath

from pgm_places.io.staging import flush, flush_tree, is_staged

NEW = "new"
"""The folder of a stage that holds the new files."""

UNFINISHED = ".pgm-places.swap"
"""What a stage is called from the moment on when its files are being moved one by one."""

_REMOVED = "removed.json"
_MAX_BYTES = 16 << 20


def swap_in(stage: Path, target: Path, removed: Iterable[str] = (), *, in_place: bool) -> None:
    """Make the files in ``stage/new`` those of ``target``, less ``removed``; all others stay.

    A folder that is not there yet is renamed into place. One that stands there is exchanged for
    one with the new files and links to all others, by a single call of the operating system, so
    that it is the old or the new one whenever the run ends. Where that is impossible (see
    ``can_be_exchanged``) or unwanted (``in_place``), the stage is renamed into the folder, from
    where its files are moved one by one; should that be interrupted, ``finish`` does the rest.

    The caller holds the lock of a target that exists.
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
    # All names are checked before anything is moved or removed: the folder may be somebody else's.
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
    """Whether another folder may take a folder's place.

    Not where a file system is mounted or this process stands in it, which would be left standing
    in the old one, nor where the folder beside it could not be made.
    """
    with contextlib.suppress(FileNotFoundError):  # the current folder may be gone
        if Path.cwd().is_relative_to(target):
            return False
    return not target.is_mount() and os.access(target.parent, os.W_OK | os.X_OK)


def file_names(folder: Path) -> set[str]:
    """The files in a folder and those below it, by their relative names with slashes."""
    return {
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.is_symlink() or not path.is_dir()
    }


def _flush_folders(folder: Path, names: Iterable[str]) -> None:
    """Flush a folder and those in it that hold the files of these names, but not the files."""
    below = {parent for name in names for parent in PurePosixPath(name).parents}
    for path in {folder, *(folder / parent for parent in below)}:
        flush(path)


def _removed(stage: Path) -> list[str]:
    """The names that a swap has left to remove; none once it was removing its own stage."""
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
    except UnicodeEncodeError:  # half a character
        return False


def _inside(target: Path, name: str) -> Path:
    """A path below the folder, whatever a damaged or foreign list of names holds."""
    path = target.joinpath(*PurePosixPath(name).parts)
    if ".." in path.parts or not path.parent.resolve().is_relative_to(target.resolve()):
        raise OSError(
            f"{name!r} in {target / UNFINISHED} points outside the folder; remove that entry"
        )
    return path


def _exchanged(new: Path, target: Path, gone: set[str]) -> bool:
    """Whether ``new`` and ``target`` have changed places, all files but ``gone`` being in both."""

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
    except OSError:  # what cannot be linked, given away or exchanged stays where it is
        for name in file_names(new) - gone:
            (new / name).unlink()
        return False
    flush(target.parent)
    for name in file_names(new) - gone - file_names(target):  # came while we were linking
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
