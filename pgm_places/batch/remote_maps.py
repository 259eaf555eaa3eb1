"""Maps, results and the index of a batch behind addresses, such as s3://."""

import os
import shutil
import tempfile
import time
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from itertools import islice
from pathlib import Path, PurePosixPath

from pgm_places.batch.limits import is_full
from pgm_places.batch.map_task import (
    ClaimedByOther,
    LabelledRow,
    MapTask,
    NoSpaceError,
    Outcome,
    label_one,
    same_model,
)
from pgm_places.errors import InputError, MapError, OutputError
from pgm_places.io.input_file import is_address, sha256_of
from pgm_places.io.output_set import RECORD_FILE, written_names
from pgm_places.io.places.result_folder import MANIFEST_FILE, NAMES_FILE
from pgm_places.io.remote_files import RemoteFolder, address_of, is_there, temporary_folder
from pgm_places.io.strict_yaml import read_yaml

_MANIFESTS = (MANIFEST_FILE, PurePosixPath(MANIFEST_FILE).name)
"""The manifest, and its path in earlier versions."""

_CHECK_FILES = (*_MANIFESTS, RECORD_FILE, NAMES_FILE)
"""Files needed to check whether a map is labelled."""


def label_anywhere(task: MapTask) -> Outcome:
    """:func:`~pgm_places.batch.map_task.label_one` for local paths and addresses.

    The record of files is written first and the manifest last, so that an incomplete result counts
    as not labelled, and as this package's.
    """
    if not is_address(task.map) and not is_address(task.folder):
        return label_one(task)
    try:
        with temporary_folder() as here:
            return _label_remote(task, here)
    except _TransferError as error:
        if is_full(error.reason):
            raise _no_space() from None
        return task.failure(error.reason, of_worker=True)
    except OutputError as error:
        raise (_no_space() if is_full(error) else error) from None


def _no_space() -> NoSpaceError:
    return NoSpaceError(f"{tempfile.gettempdir()}: no space left for temporary files; set TMPDIR")


_VISIBLE_WITHIN_S = (0.0, 0.1, 0.4, 1.5)
"""Waiting times (s); a network file system shows another machine's files with a delay."""


def is_visible(task: MapTask) -> bool:
    """Whether the result of a map labelled by another process exists here."""
    for wait_s in _VISIBLE_WITHIN_S:
        time.sleep(wait_s)
        if any(is_there(task.folder / name) for name in _MANIFESTS):
            return True
    return False


_CHECKED_AT_ONCE = 2_000
"""Maps whose results are listed at once, folder by folder, before they are checked."""


def done_rows(tasks: Iterable[MapTask]) -> Iterator[tuple[MapTask, LabelledRow | None]]:
    """The tasks, each with its row if its map is labelled and up to date; writes nothing."""
    remaining = iter(tasks)
    while group := list(islice(remaining, _CHECKED_AT_ONCE)):
        remote = next((RemoteFolder.at(path) for path in _remote_paths(group)), None)
        if remote is None:
            yield from ((task, _row(label_one(_check_task(task)))) for task in group)
            continue
        folders = {task.folder.parent for task in group if is_address(task.folder)}
        outer = sorted(folder_ for folder_ in folders if folders.isdisjoint(folder_.parents))
        names: dict[str, list[str]] = {str(task.folder): [] for task in group}
        for folder, below in zip(outer, remote.at_once(_names_below, outer), strict=True):
            for name in below:
                result = f"{folder}/{name}"
                while len(result) > len(str(folder)) and result not in names:
                    result = result.rpartition("/")[0]
                if result in names:
                    names[result].append(f"{folder}/{name}"[len(result) + 1 :])
        same_model(group[0])  # loads the model once, before the threads start
        with temporary_folder() as here:
            checks = [
                partial(_checked, task, names[str(task.folder)], here / str(number))
                for number, task in enumerate(group)
            ]
            outcomes = remote.at_once(lambda check: check(), checks)
        yield from zip(group, map(_row, outcomes), strict=True)


def _remote_paths(tasks: Iterable[MapTask]) -> Iterator[Path]:
    yield from (path for task in tasks for path in (task.folder, task.map) if is_address(path))


def _names_below(folder: Path) -> list[str]:
    return RemoteFolder.at(folder).names()


def _check_task(task: MapTask) -> MapTask:
    return replace(task, only_check=True, claim=None, limit_s=None)


def _row(outcome: Outcome) -> LabelledRow | None:
    return outcome if isinstance(outcome, LabelledRow) else None


def _checked(task: MapTask, names: Collection[str], here: Path) -> Outcome:
    """The outcome of checking a map, given the file names of its remote result."""
    local = replace(_check_task(task), source=task.shown)
    try:
        if is_address(task.folder):
            if not set(_MANIFESTS).intersection(names):
                return ClaimedByOther()
            local = replace(local, folder=here / "result")
            with _as_transfer_errors():
                _fetch_check_files(RemoteFolder.at(task.folder), local.folder, names)
        elif not any((task.folder / name).exists() for name in _MANIFESTS):
            return ClaimedByOther()
        if is_address(task.map):
            local = replace(local, map=here / "map" / task.map.name)
            _fetch_map(task, local.map)
        return label_one(local)
    except _TransferError as error:
        return task.failure(error.reason)
    finally:
        shutil.rmtree(here, ignore_errors=True)


class _TransferError(Exception):
    """A file could not be fetched or uploaded."""

    def __init__(self, reason: Exception) -> None:
        super().__init__()
        self.reason = reason


class _NotAMapError(_TransferError):
    """The fetched file is not a map."""


@contextmanager
def _as_transfer_errors() -> Iterator[None]:
    try:
        yield
    except Exception as error:  # one bad map must not stop the batch
        raise _TransferError(error) from error


def _label_remote(task: MapTask, here: Path) -> Outcome:
    local = replace(task, claim=None, source=task.shown)
    if is_address(task.map):
        local = replace(local, map=here / "map" / task.map.name)
        try:
            _fetch_map(task, local.map)
        except _NotAMapError as error:
            return local.failure(error.reason)
    if not is_address(task.folder):
        return label_one(replace(local, claim=task.claim))
    folder = here / "result" / task.folder.name
    local = replace(local, folder=folder, target=address_of(task.folder))
    with _as_transfer_errors():
        remote = RemoteFolder.at(task.folder, OutputError)
        there = remote.names()
        _fetch_check_files(remote, local.folder, there)
    outcome = label_one(replace(local, only_check=True))
    if isinstance(outcome, LabelledRow):
        return outcome
    with _as_transfer_errors():
        _fetch_all(remote, local.folder, there)
        before = written_names(local.folder)
    outcome = label_one(local)
    if isinstance(outcome, LabelledRow):
        with _as_transfer_errors():
            _put_result(local.folder, remote, before, there)
    return outcome


def fetch_results(out: Path, wanted: Collection[str], here: Path) -> None:
    """Copy the wanted files of a remote batch folder to a local one, with their time stamps."""
    remote = RemoteFolder.at(out, InputError)

    def fetch(name: str) -> None:
        if remote.fetch(name, here / name):
            when = remote.modified_s(name)
            os.utime(here / name, (when, when))

    paths = ((name, PurePosixPath(name).parts) for name in remote.names())
    remote.at_once(
        fetch,
        (
            name
            for name, each in paths
            if each[-1] in wanted and not any(component.startswith(".") for component in each)
        ),
    )


def _fetch_map(task: MapTask, local: Path) -> None:
    """Copy the map's YAML file and its image, with their relative paths."""
    source = RemoteFolder.at(task.map, MapError)
    with _as_transfer_errors():
        if not source.parent.fetch(task.map.name, local):
            raise MapError(f"{source.address}: no such file; expected a map description (YAML)")
    try:
        image = PurePosixPath(read_yaml(local, MapError, "map description").text("image"))
    except MapError as error:
        raise _NotAMapError(error) from error
    if image.is_absolute() or ".." in image.parts:
        raise _NotAMapError(
            MapError(
                f"{source.address}: its image {str(image)!r} is outside the map's folder and is "
                "not fetched; move it into that folder"
            )
        )
    with _as_transfer_errors():  # a missing image is reported when the map is read
        source.parent.fetch(str(image), local.parent / image)


def _fetch_check_files(remote: RemoteFolder, here: Path, names: Collection[str]) -> None:
    """Fetch the files needed to check a result; create empty ones for all others."""
    if not set(names).intersection(_MANIFESTS):
        return
    for name in names:
        if name in _CHECK_FILES:
            remote.fetch(name, here / name)
        else:
            (here / name).parent.mkdir(parents=True, exist_ok=True)
            (here / name).touch()


def _fetch_all(remote: RemoteFolder, here: Path, names: Collection[str]) -> None:
    """Fetch an earlier result; of an incomplete one only the user's names and the record."""
    if RECORD_FILE in names and not set(names).intersection(_MANIFESTS):
        names = [name for name in names if name in (NAMES_FILE, RECORD_FILE)]
    for name in names:
        remote.fetch(name, here / name)


def _put_result(here: Path, remote: RemoteFolder, before: set[str], there: Collection[str]) -> None:
    """Upload a result, and remove files of the earlier one; files of the user are not touched."""
    ours = written_names(here)
    remote.remove([MANIFEST_FILE, *set(_MANIFESTS[1:]).intersection(there)], OutputError)
    remote.put(here, [RECORD_FILE], OutputError)
    remote.at_once(
        lambda name: remote.put(here, [name], OutputError), sorted(ours - {MANIFEST_FILE})
    )
    remote.put(here, [MANIFEST_FILE], OutputError)
    remote.remove(sorted(before - ours), OutputError)


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
