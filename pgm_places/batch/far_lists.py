"""The lists of a far folder: a local copy, and what several runs at once put back there.

No lock reaches so far. Each run therefore also puts its tables under a name of its own, and merges
those of the others; only what a later copy contains is removed. Whichever run puts the lists last
finds the rows of all others, and none is lost.
"""

import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from pgm_places.errors import OutputError
from pgm_places.io.far_files import FarFolder, temporary_folder

_COPIES = ".pgm-places-lists"
_ENDED = "ended"
_OLD_S = 86_400.0
"""A run that has put no table for so long was killed."""


class FarLists:
    """The lists of a far folder, and a local folder with them.

    Parameters
    ----------
    far : FarFolder
    here : Path
        The local folder.
    names, tables : sequence of str
        The lists; those of them that several runs write rows to.
    """

    def __init__(
        self, far: FarFolder, here: Path, names: Sequence[str], tables: Sequence[str]
    ) -> None:
        self._far, self.here, self._names, self._tables = far, here, names, tables
        self._copies = far.below(_COPIES)
        self._run = os.urandom(8).hex()
        self._seen: dict[str, str] = {}
        for name in names:
            far.fetch(name, here / name)

    def others(self) -> list[Path]:
        """Local folders with the tables of other runs that are new since the last call."""
        listed = self._listed()
        new = [name for name, state in listed.items() if self._seen.get(name) != state]
        folders: dict[Path, None] = {}
        for name in new:
            local = self.here / _COPIES / name
            if self._copies.fetch(name, local):
                folders[local.parent] = None
        self._seen = listed
        return list(folders)

    def has_others(self) -> bool:
        """Whether other runs have put tables since the last call of ``others``."""
        return any(self._seen.get(name) != state for name, state in self._listed().items())

    def put_tables(self, *, ended: bool, patient: bool = True) -> None:
        """Put the tables under a name of this run; it is ``ended`` when no rows follow."""
        there = [name for name in self._tables if (self.here / name).exists()]
        run = self._copies.below(f"{self._run}.{_ENDED}" if ended else self._run)
        replace(run, is_patient=patient).put(self.here, there, OutputError)
        if ended:
            for name in self._tables:
                self._copies.remove([f"{self._run}/{name}"], OutputError)

    def put(self, *, patient: bool = True) -> None:
        """Put the lists in the place where they are read."""
        there = [name for name in self._names if (self.here / name).exists()]
        replace(self._far, is_patient=patient).put(self.here, there, OutputError)
        absent = [name for name in self._names if name not in there]
        if patient and absent:
            self._far.remove(absent, OutputError)

    def remove_merged(self) -> None:
        """Remove tables of others that these contain, once these have been put: of ended runs."""
        now = time.time()
        for name in self._seen:
            run = name.partition("/")[0]
            if run.endswith(f".{_ENDED}") or now - self._copies.modified_s(name) > _OLD_S:
                self._copies.remove([name], OutputError)

    def _listed(self) -> dict[str, str]:
        """The tables of other runs, each with what tells its versions apart."""
        return {
            name: state
            for name, state in self._copies.states().items()
            if not name.startswith(self._run) and name.rpartition("/")[2] in self._tables
        }


@contextmanager
def far_lists(out: Path, names: Sequence[str], tables: Sequence[str]) -> Iterator[FarLists]:
    """The lists of a far folder in a local one, which is gone when the block ends."""
    with temporary_folder() as here:
        yield FarLists(FarFolder.at(out, OutputError), here, names, tables)
