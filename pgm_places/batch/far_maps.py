"""Maps and results behind addresses: fetched and put one map at a time, through a local folder."""

import os
import tempfile
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path, PurePosixPath

from pgm_places.batch.map_task import (
    Elsewhere,
    LabelledRow,
    MapTask,
    Outcome,
    label_one,
)
from pgm_places.errors import InputError, MapError, OutputError
from pgm_places.io.far_files import FarFolder
from pgm_places.io.input_file import is_address
from pgm_places.io.output_set import RECORD_FILE, written_names
from pgm_places.io.places.result_folder import MANIFEST_FILE, NAMES_FILE
from pgm_places.io.strict_yaml import read_yaml

_MANIFESTS = (MANIFEST_FILE, PurePosixPath(MANIFEST_FILE).name)
"""The manifest, and where earlier versions left it."""

_LOOKED_AT = (*_MANIFESTS, RECORD_FILE, NAMES_FILE)
"""The files of a result that say whether it is done."""


def label_anywhere(task: MapTask) -> Outcome:
    """What :func:`~pgm_places.batch.map_task.label_one` does, also behind addresses.

    The manifest is removed before, and written after, all other files of a result, and the record
    of files is written first: whatever ends the run, a result that is not complete does not count
    as done, but as ours.

    Raises
    ------
    NoSpaceError, InputError
        As ``label_one``.
    """
    if not is_address(task.map) and not is_address(task.folder):
        return label_one(task)
    with tempfile.TemporaryDirectory(prefix="pgm-places-") as temporary:
        try:
            return _label_far(task, Path(temporary))
        except _FarError as error:
            return task.failure(error.reason)


def is_done(task: MapTask) -> bool:
    """Whether a map is labelled as the task wants it, wherever it is; nothing is written."""
    outcome = label_anywhere(replace(task, only_look=True, claim=None, limit_s=None))
    return isinstance(outcome, LabelledRow)


class _FarError(Exception):
    """Something could not be fetched or put, which is this map's fault at most."""

    def __init__(self, reason: Exception) -> None:
        super().__init__()
        self.reason = reason


@contextmanager
def _between_machines() -> Iterator[None]:
    try:
        yield
    except Exception as error:  # one bad map must not end a night's work
        raise _FarError(error) from error


def _label_far(task: MapTask, here: Path) -> Outcome:
    near = replace(task, claim=None, source=task.shown)
    if task.only_look and not _has_manifest(task):
        return Elsewhere()
    if is_address(task.map):
        with _between_machines():
            near = replace(near, map=_fetched_map(task, here / "map"))
    if not is_address(task.folder):
        return label_one(replace(near, claim=task.claim))
    near = replace(near, folder=here / "result" / task.folder.name)
    with _between_machines():
        far = FarFolder.at(task.folder, OutputError)
        _look_at(far, near.folder)
    outcome = label_one(replace(near, only_look=True))
    if task.only_look or isinstance(outcome, LabelledRow):
        return outcome
    with _between_machines():
        _fetch_all(far, near.folder)
        before = written_names(near.folder)
    outcome = label_one(near)
    if isinstance(outcome, LabelledRow):
        with _between_machines():
            _put_result(near.folder, far, before)
    return outcome


def _has_manifest(task: MapTask) -> bool:
    """Whether there is something to compare a map with: it need not be fetched otherwise."""
    if not is_address(task.folder):
        return any((task.folder / name).exists() for name in _MANIFESTS)
    with _between_machines():
        return any(FarFolder.at(task.folder / name, OutputError).exists() for name in _MANIFESTS)


@contextmanager
def lists_to_read(out: Path, names: tuple[str, ...]) -> Iterator[Path]:
    """The folder with the lists of all results: itself, or a local one with those of a far one."""
    if not is_address(out):
        yield out
        return
    with lists_of(out, names) as (here, _):
        yield here


@contextmanager
def results_of(
    out: Path, wanted: Collection[str], lists: tuple[str, ...]
) -> Iterator[tuple[Path, Callable[[], None]]]:
    """A local folder with the lists of a far one and its results' files of the wanted names.

    They are as old as there. What puts the lists back comes with the folder.
    """
    far = FarFolder.at(out, InputError)
    with lists_of(out, lists) as (here, put):
        for name in far.names():
            parts = PurePosixPath(name).parts
            if parts[-1] in wanted and not any(part.startswith(".") for part in parts):
                far.fetch(name, here / name)
                when = far.modified_s(name)
                os.utime(here / name, (when, when))
        yield here, put


@contextmanager
def lists_of(out: Path, names: tuple[str, ...]) -> Iterator[tuple[Path, Callable[[], None]]]:
    """A local folder with the lists of a far one, and what puts them back there."""
    far = FarFolder.at(out, OutputError)
    with tempfile.TemporaryDirectory(prefix="pgm-places-") as temporary:
        here = Path(temporary)
        for name in names:
            far.fetch(name, here / name)

        def put() -> None:
            there = [name for name in names if (here / name).exists()]
            far.put(here, there, OutputError)
            far.remove((name for name in names if name not in there), OutputError)

        yield here, put


def _fetched_map(task: MapTask, here: Path) -> Path:
    """The map's YAML file and its image, side by side as they were."""
    source = FarFolder.at(task.map, MapError)
    local = here / task.map.name
    if not source.parent.fetch(task.map.name, local):
        raise MapError(f"{source.address}: no such file; expected a map description (YAML)")
    image = PurePosixPath(read_yaml(local, MapError, "map description").text("image"))
    if image.is_absolute() or ".." in image.parts:
        raise MapError(
            f"{source.address}: its image {str(image)!r} lies outside its folder, where no image "
            "is fetched from; put it beside the map"
        )
    source.parent.fetch(str(image), here / image)  # what is missing, reading the map will say
    return local


def _look_at(far: FarFolder, here: Path) -> None:
    """Of a result, what says whether it is done; all other files as empty ones."""
    names = far.names()
    if not set(names).intersection(_MANIFESTS):
        return
    for name in names:
        if name in _LOOKED_AT:
            far.fetch(name, here / name)
        else:
            (here / name).parent.mkdir(parents=True, exist_ok=True)
            (here / name).touch()


def _fetch_all(far: FarFolder, here: Path) -> None:
    """What an earlier run left; of a result that it did not complete only what the user gave."""
    names = far.names()
    if RECORD_FILE in names and not set(names).intersection(_MANIFESTS):
        names = [name for name in names if name in (NAMES_FILE, RECORD_FILE)]
    for name in names:
        far.fetch(name, here / name)


def _put_result(here: Path, far: FarFolder, before: set[str]) -> None:
    """Copy a result, and remove what only an earlier one had; files of the user's own stay."""
    ours = written_names(here)
    far.remove(_MANIFESTS, OutputError)
    far.put(here, [RECORD_FILE, *sorted(ours - {MANIFEST_FILE}), MANIFEST_FILE], OutputError)
    far.remove(sorted(before - ours), OutputError)
