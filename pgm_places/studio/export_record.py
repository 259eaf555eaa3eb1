"""Export record: from which state of the painting each export was written."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from enum import Enum
from pathlib import Path
from typing import Any

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
    """The exports of a painting: by folder and name, their digest and the SHA-256 of their files.

    Parameters
    ----------
    path : Path
        Its file. Where it is missing or damaged, no export counts as up to date.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            record = read_json(path, InputError, "a record of exports", max_bytes=MAX_BYTES)
        except InputError:
            record = {}
        self._folders: dict[str, Any] = record if isinstance(record, dict) else {}

    def note(self, folder: Path, name: str, state: str, written: Iterable[Path]) -> None:
        """Record an export that was written from a state; "" for an unknown one.

        Raises
        ------
        OutputError
            The file cannot be written.
        """
        files = (each for path in written for each in (path.iterdir() if path.is_dir() else [path]))
        sums = {path.relative_to(folder).as_posix(): sha256_of(path) for path in files}
        here = self._folders.setdefault(str(folder.resolve()), {})
        here[name] = {"state": state, "files": sums}
        write_json(self.path, self._folders, indent=1)

    def note_names(self, folder: Path, names: Mapping[int, str]) -> None:
        """Record the studio's names of places, by id, in a folder.

        Raises
        ------
        OutputError
            The file cannot be written.
        """
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
