"""Index of a remote batch folder: a local copy, merged with rows of concurrent runs.

Remote folders have no locks. Each run therefore also uploads its tables under a unique name and
merges the tables of other runs. A table is removed only after a later copy contains its rows, so
the run that uploads the index last has the rows of all runs.
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
"""Seconds without an upload after which a run counts as killed."""


class RemoteIndex:
    """The index of a remote folder, with a local copy; several runs append to its ``tables``."""

    def __init__(
        self, remote: RemoteFolder, here: Path, names: Sequence[str], tables: Sequence[str]
    ) -> None:
        self._remote, self.here, self._names, self._tables = remote, here, names, tables
        self._copies = remote.below(_COPIES)
        self._run = os.urandom(8).hex()
        self._seen: dict[str, str] = {}
        remote.at_once(lambda name: remote.fetch(name, here / name), names)
        self._fetched = self._content()

    @property
    def is_unchanged(self) -> bool:
        """Whether the local files are unchanged since they were fetched."""
        return self._content() == self._fetched

    def _content(self) -> dict[str, str]:
        paths = (self.here / name for name in self._names)
        return {path.name: sha256_of(path) for path in paths if path.exists()}

    def others(self) -> list[Path]:
        """Local folders with tables of other runs that changed since the last call."""
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
        """Whether other runs have uploaded tables since the last call of ``others``."""
        return any(self._seen.get(name) != state for name, state in self._listed().items())

    def put_tables(self, *, ended: bool, patient: bool = True) -> None:
        """Upload the tables under a name of this run; ``ended`` if no rows will follow."""
        there = [name for name in self._tables if (self.here / name).exists()]
        run = self._copies.below(f"{self._run}.{_ENDED}" if ended else self._run)
        self._put(replace(run, is_patient=patient), there)
        if ended:
            self._remove(self._copies, [f"{self._run}/{name}" for name in self._tables])

    def _put(self, remote: RemoteFolder, names: Iterable[str]) -> None:
        remote.at_once(lambda name: remote.put(self.here, [name], OutputError), names)

    def _remove(self, remote: RemoteFolder, names: Iterable[str]) -> None:
        remote.at_once(lambda name: remote.remove([name], OutputError), names)

    def put(self, *, patient: bool = True) -> None:
        """Upload the index."""
        there = [name for name in self._names if (self.here / name).exists()]
        self._put(replace(self._remote, is_patient=patient), there)
        if patient:
            self._remove(self._remote, [name for name in self._names if name not in there])

    def remove_merged(self) -> None:
        """After an upload, remove the merged tables of ended or killed runs."""

        def remove(name: str) -> None:
            run, now = name.partition("/")[0], time.time()
            if run.endswith(f".{_ENDED}") or now - self._copies.modified_s(name) > _OLD_S:
                self._copies.remove([name], OutputError)

        self._copies.at_once(remove, self._seen)

    def _listed(self) -> dict[str, str]:
        """The tables of other runs, each with a version stamp."""
        return {
            name: state
            for name, state in self._copies.states().items()
            if not name.startswith(self._run) and name.rpartition("/")[2] in self._tables
        }


@contextmanager
def remote_index(out: Path, names: Sequence[str], tables: Sequence[str]) -> Iterator[RemoteIndex]:
    """The index of a remote folder, with a local copy that is removed after the block."""
    with temporary_folder() as here:
        yield RemoteIndex(RemoteFolder.at(out, OutputError), here, names, tables)
