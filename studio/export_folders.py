"""Export folders: where the exports of a studio may be written, and what was written when.

Requests name the folder, so a foreign page with the address could name one, too. Allowed are the
folders of the command line and folders below the one in which the studio was started, except
hidden ones. No export overwrites a file that the studio reads.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any, Self

from pgm_places._version import __version__
from pgm_places.errors import InputError
from pgm_places.io.atomic import write_json
from pgm_places.io.input_file import read_json, sha256_of
from pgm_places.options import plain_values
from pgm_places.studio.session import MapSession
from pgm_places.teaching.paint import Paint

RECORD_FILE = "exports.json"
MAX_BYTES = 16 << 20
_NAMES = "names of places"


class Content(Enum):
    """The inputs of an export: paint, with the model, with teaching, with names of places."""

    PAINT, TRAINING, LABELS, PLACES = range(4)


def digest(session: MapSession, content: Content, paint: Paint, *, learns: bool) -> str:
    """A hash of all inputs of an export: equal for equal files."""
    loaded = session.loaded
    files = [file.sha256 for file in session.files]
    state: list[Any] = [files, session.source.unknown_value, paint.classes]
    if content is not Content.PAINT:
        state += [__version__, session.model, plain_values(session.rules)]
    if content is not Content.PAINT and loaded is not None:
        state += [loaded.sha256, loaded.method, plain_values(loaded.entered)]
    if content in (Content.LABELS, Content.PLACES):
        state.append(learns)
    if content is Content.PLACES:
        state += [sorted(session.painting.names.items()), *session.painting.cuts]
    found = hashlib.sha256(json.dumps(state).encode())
    found.update(paint.labels.tobytes())
    return found.hexdigest()


class ExportRecord:
    """The exports of a painting in a file: by folder and name, a digest and the files' SHA-256.

    Where the file is missing or damaged, no export counts as up to date.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            record = read_json(path, InputError, "a record of exports", max_bytes=MAX_BYTES)
        except InputError:
            record = {}
        self._folders: dict[str, Any] = record if isinstance(record, dict) else {}

    def note(self, folder: Path, name: str, state: str, written: Iterable[Path]) -> None:
        """Record an export that was written from a state; "" for an unknown one."""
        files = (each for path in written for each in (path.iterdir() if path.is_dir() else [path]))
        sums = {path.relative_to(folder).as_posix(): sha256_of(path) for path in files}
        here = self._folders.setdefault(str(folder.resolve()), {})
        here[name] = {"state": state, "files": sums}
        write_json(self.path, self._folders, indent=1)

    def note_names(self, folder: Path, names: Mapping[int, str]) -> None:
        """Record the studio's names of places, by id, in a folder."""
        self._folders.setdefault(str(folder.resolve()), {})[_NAMES] = dict(names)
        write_json(self.path, self._folders, indent=1)

    def names(self, folder: Path) -> dict[int, str]:
        """The studio's names of places in a folder, as they were last written."""
        found = self._entry(folder, _NAMES).items()
        return {int(key): name for key, name in found if key.isdecimal()}

    def is_current(self, folder: Path, name: str, state: str) -> bool:
        """Whether an export was written from this state, and its files are as they were written."""
        entry = self._entry(folder, name)
        files = entry.get("files", {})
        return entry.get("state") == state and all(
            (folder / file).is_file() and sha256_of(folder / file) == files[file] for file in files
        )

    def _entry(self, folder: Path, name: str) -> dict[str, Any]:
        here = self._folders.get(str(folder.resolve()), {})
        entry = here.get(name, {}) if isinstance(here, dict) else {}
        return entry if isinstance(entry, dict) else {}


LONGEST = 1000
"""Most characters of a path from the page."""

MOST_OFFERED = 60
"""Most folders that are offered by name; any other can be typed."""


@dataclass(frozen=True)
class ExportFolders:
    """The folders into which a studio may export, relative to the working folder.

    ``extra`` folders come from the command line; ``inputs`` are never overwritten.
    """

    working: Path
    extra: tuple[Path, ...] = ()
    inputs: frozenset[Path] = frozenset()

    @classmethod
    def started_here(cls, extra: Sequence[Path] = (), inputs: Iterable[Path] = ()) -> Self:
        """Export folders of a studio that is started in the current folder."""
        return cls(
            Path.cwd().resolve(),
            tuple(path.resolve() for path in extra),
            frozenset(path.resolve() for path in inputs),
        )

    def chosen(self, text: str, own: Path) -> Path:
        """The folder of that name, which need not exist yet; ``own`` for an empty name."""
        if not text.strip():
            return own
        if len(text) > LONGEST or not text.isprintable():
            raise InputError("the folder name is too long or has invalid characters; change it")
        if text.startswith("~"):
            raise InputError(f"write {text!r} out: '~' is not understood here")
        try:
            folder = (self.working / text).resolve()  # links are followed before the check
            in_circles = any(path.is_symlink() for path in (folder, *folder.parents))
        except (OSError, RuntimeError, ValueError):
            in_circles = True  # Python before 3.13 raises, later ones leave the link as it is
        if in_circles:
            raise InputError(f"{text!r} cannot be a folder")
        if folder == own.resolve():
            return own
        root = next((root for root in self.roots(own) if folder.is_relative_to(root)), None)
        if root is None:
            raise InputError(
                f"exports go below {self.working} or into a folder given with --export-to; "
                f"{folder} is neither"
            )
        if any(part.startswith(".") for part in folder.relative_to(root).parts):
            raise InputError(f"{text!r} is hidden; choose a folder without a dot before its name")
        if folder.exists() and not folder.is_dir():
            raise InputError(f"{text!r} is a file; name a folder")
        return folder

    def roots(self, own: Path) -> tuple[Path, ...]:
        """The folders below which files may be written; never all of the disk."""
        roots = (own.resolve(), *self.extra, self.working)
        return tuple(root for root in roots if root.parent != root or root in self.extra)

    def check_free(self, targets: Iterable[Path], further: Iterable[Path] = ()) -> None:
        """Raise InputError if a target is an input of the studio, or a folder that contains one."""
        inputs = {*self.inputs, *(path.resolve() for path in further)}
        for target in targets:
            blocked = target.resolve()
            if any(path == blocked or path.is_relative_to(blocked) for path in inputs):
                raise InputError(f"{target} is an input of the studio; choose another folder")

    def offered(self, own: Path) -> list[str]:
        """Folder names to choose from: the session's, the command line's, and subfolders."""
        names = [self.name_of(own), *map(self.name_of, self.extra)]
        try:
            inside = sorted(path for path in self.working.iterdir() if path.is_dir())
        except OSError:
            inside = []
        names += [path.name for path in inside if not path.name.startswith(".")]
        return list(dict.fromkeys(names))[:MOST_OFFERED]

    def name_of(self, folder: Path) -> str:
        """The path of a folder, relative to the working folder if it lies below it."""
        path = folder.resolve()
        below = path.is_relative_to(self.working) and path != self.working
        return str(path.relative_to(self.working) if below else path)
