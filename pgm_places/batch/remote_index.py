"""Index of a remote batch folder: a local copy, merged with rows of concurrent runs.

No lock reaches so far. Each run therefore also puts its tables under a name of its own, and merges
those of the others; only what a later copy contains is removed. Whichever run puts the lists last
finds the rows of all others, and none is lost.
"""

import os
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from pgm_places.errors import OutputError
from pgm_places.io.input_file import sha256_of
from pgm_places.io.remote_files import RemoteFolder, temporary_folder

_COPIES = ".pgm-places-lists"
_ENDED = "ended"
_OLD_S = 86_400.0
"""A run that has put no table for so long was killed."""


class RemoteIndex:
    """The lists of a far folder, and a local folder with them.

    Parameters
    ----------
    far : RemoteFolder
    here : Path
        The local folder.
    names, tables : sequence of str
        The lists; those of them that several runs write rows to.
    """

    def __init__(
        self, far: RemoteFolder, here: Path, names: Sequence[str], tables: Sequence[str]
    ) -> None:
        self._far, self.here, self._names, self._tables = far, here, names, tables
        self._copies = far.below(_COPIES)
        self._run = os.urandom(8).hex()
        self._seen: dict[str, str] = {}
        far.at_once(lambda name: far.fetch(name, here / name), names)
        self._fetched = self._content()

    @property
    def is_unchanged(self) -> bool:
        """Whether the lists are as they were fetched."""
        return self._content() == self._fetched

    def _content(self) -> dict[str, str]:
        paths = (self.here / name for name in self._names)
        return {path.name: sha256_of(path) for path in paths if path.exists()}

    def others(self) -> list[Path]:
        """Local folders with the tables of other runs that are new since the last call."""
        listed = self._listed()
        new = [name for name, state in listed.items() if self._seen.get(name) != state]
        folders: dict[Path, None] = {}
        there = self._copies.at_once(
            lambda name: self._copies.fetch(name, self.here / _COPIES / name), new
        )
        for name, is_fetched in zip(new, there, strict=True):
            if is_fetched:
                folders[(self.here / _COPIES / name).parent] = None
        self._seen = listed
        return list(folders)

    def has_others(self) -> bool:
        """Whether other runs have put tables since the last call of ``others``."""
        return any(self._seen.get(name) != state for name, state in self._listed().items())

    def put_tables(self, *, ended: bool, patient: bool = True) -> None:
        """Put the tables under a name of this run; it is ``ended`` when no rows follow."""
        there = [name for name in self._tables if (self.here / name).exists()]
        run = self._copies.below(f"{self._run}.{_ENDED}" if ended else self._run)
        self._put(replace(run, is_patient=patient), there)
        if ended:
            self._remove(self._copies, [f"{self._run}/{name}" for name in self._tables])

    def _put(self, far: RemoteFolder, names: Iterable[str]) -> None:
        far.at_once(lambda name: far.put(self.here, [name], OutputError), names)

    def _remove(self, far: RemoteFolder, names: Iterable[str]) -> None:
        far.at_once(lambda name: far.remove([name], OutputError), names)

    def put(self, *, patient: bool = True) -> None:
        """Put the lists in the place where they are read."""
        there = [name for name in self._names if (self.here / name).exists()]
        self._put(replace(self._far, is_patient=patient), there)
        if patient:
            self._remove(self._far, [name for name in self._names if name not in there])

    def remove_merged(self) -> None:
        """Remove tables of others that these contain, once these have been put: of ended runs."""

        def remove(name: str) -> None:
            run, now = name.partition("/")[0], time.time()
            if run.endswith(f".{_ENDED}") or now - self._copies.modified_s(name) > _OLD_S:
                self._copies.remove([name], OutputError)

        self._copies.at_once(remove, self._seen)

    def _listed(self) -> dict[str, str]:
        """The tables of other runs, each with what tells its versions apart."""
        return {
            name: state
            for name, state in self._copies.states().items()
            if not name.startswith(self._run) and name.rpartition("/")[2] in self._tables
        }


@contextmanager
def remote_index(out: Path, names: Sequence[str], tables: Sequence[str]) -> Iterator[RemoteIndex]:
    """The lists of a far folder in a local one, which is gone when the block ends."""
    with temporary_folder() as here:
        yield RemoteIndex(RemoteFolder.at(out, OutputError), here, names, tables)
