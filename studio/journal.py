"""The journal: an append-only file with a line per edit, on the disk before it is shown.

Lines are never changed, so that every edit can be undone. If the process is killed, at most the
last line is lost.
"""

import json
import os
from pathlib import Path
from typing import IO, Any

from pgm_places.errors import InputError, OutputError, quoted
from pgm_places.io.input_file import sha256_of
from pgm_places.io.staging import as_output_errors, open_own

try:
    import fcntl
except ImportError:  # Windows has no lock: two studios can open one folder
    fcntl = None  # type: ignore[assignment]

FORMAT, SCHEMA = "pgm-places-studio", 1
MAX_BYTES = 2 << 30
MAX_HEADER_BYTES = 1 << 16


class Journal:
    """An open journal, which locks its file; ``entries`` are those at the time of opening.

    ``subject`` is the map that the edits belong to; a journal of another map is refused.
    """

    entries: list[dict[str, Any]]
    _size: int

    def __init__(self, path: Path, subject: dict[str, Any]) -> None:
        self.path = path
        with as_output_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            number = open_own(path, os.O_RDWR | os.O_CREAT | os.O_APPEND)
            self._file: IO[bytes] = os.fdopen(number, "a+b")
        try:
            self._lock()
            self.entries = self._read(subject)
        except BaseException:
            self._file.close()
            raise

    def append(self, entry: dict[str, Any]) -> None:
        """Write an entry, and return once it is on the disk."""
        if self.was_changed():
            raise OutputError(f"{self.path} was changed by another program; restart the studio")
        line = _line(entry)
        with as_output_errors(self.path):
            try:
                self._file.write(line + b"\n")
                self._file.flush()
                os.fsync(self._file.fileno())
            except OSError:
                os.ftruncate(self._file.fileno(), self._size)  # no incomplete line stays
                raise
        self._size = self._length()

    def was_changed(self) -> bool:
        """Whether another program has changed or replaced the file."""
        try:
            there = self.path.stat()
        except OSError:
            return True
        here = os.fstat(self._file.fileno())
        return (there.st_ino, there.st_dev) != (here.st_ino, here.st_dev) or (
            here.st_size != self._size
        )

    def close(self) -> None:
        """Close and unlock the file."""
        self._file.close()

    def _lock(self) -> None:
        if fcntl is None:
            return
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise OutputError(
                f"{self.path} is open in another studio; use that one, end it, or choose another "
                "folder with --out"
            ) from None

    def _length(self) -> int:
        return os.fstat(self._file.fileno()).st_size

    def _read(self, subject: dict[str, object]) -> list[dict[str, object]]:
        self._size = self._length()
        if self._size > MAX_BYTES:
            raise InputError(f"{self.path} has {self._size} bytes; at most {MAX_BYTES} are read")
        self._file.seek(0)
        complete, _, torn = self._file.read().rpartition(b"\n")
        lines = complete.split(b"\n") if complete else []
        entries = [_entry(self.path, number, line) for number, line in enumerate(lines, 1)]
        header = {"format": FORMAT, "schema": SCHEMA, **subject}
        if not entries and not _is_begun(torn, header):
            raise InputError(f"{self.path} is not a journal of this studio; choose another --out")
        first = entries[0] if entries else header
        if first.get("format") != FORMAT or first.get("schema") != SCHEMA:
            raise InputError(f"{self.path} is not a journal of this studio; choose another --out")
        for key, value in subject.items():
            if first.get(key) != value:
                raise InputError(
                    f"{self.path} belongs to another {key} ({quoted(first.get(key))}, not "
                    f"{value!r}); choose another folder with --out"
                )
        if torn:  # killed in the middle of a line, before its edit was shown
            self._size -= len(torn)
            os.ftruncate(self._file.fileno(), self._size)
        if not entries:
            self.append(header)
        return entries[1:]


def _line(entry: dict[str, object]) -> bytes:
    return json.dumps(entry, ensure_ascii=False, separators=(",", ":"), allow_nan=False).encode()


def _is_begun(torn: bytes, header: dict[str, object]) -> bool:
    """Whether an incomplete line is the beginning of a journal's header, of any map."""
    first = _line({"format": header["format"], "schema": header["schema"]})[:-1]
    return torn.startswith(first) or first.startswith(torn)


def subject_of(path: Path) -> dict[str, object] | None:
    """The map that the edits of a journal belong to; None without a journal or a complete line."""
    try:
        with path.open("rb") as file:
            line = file.readline(MAX_HEADER_BYTES)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None
    if not line.endswith(b"\n"):
        return None
    header = _entry(path, 1, line)
    return {key: value for key, value in header.items() if key not in ("format", "schema")}


def _entry(path: Path, number: int, line: bytes) -> dict[str, object]:
    try:
        entry = json.loads(line)
    except (ValueError, RecursionError):
        entry = None
    if not isinstance(entry, dict):
        raise InputError(f"{path}: line {number} is damaged; restore the file from a copy")
    return entry


class SourceFile:
    """A file as it was when the studio began."""

    def __init__(self, path: Path) -> None:
        self.path, self.sha256 = path, sha256_of(path)
        self._state_at_open = self._state()

    def was_changed(self) -> bool:
        """Whether the file is missing, or was written to since."""
        return self._state() != self._state_at_open

    def _state(self) -> tuple[int, int] | None:
        try:
            found = self.path.stat()
        except OSError:
            return None
        return found.st_mtime_ns, found.st_size
