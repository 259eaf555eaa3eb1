"""Maps and results behind addresses: fetched and put one map at a time, through a local folder."""

import os
import tempfile
import time
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path, PurePosixPath

from pgm_places.batch.limits import is_full
from pgm_places.batch.map_task import (
    Elsewhere,
    LabelledRow,
    MapTask,
    NoSpaceError,
    Outcome,
    label_one,
)
from pgm_places.errors import InputError, MapError, OutputError
from pgm_places.io.far_files import FarFolder, address_of, is_there, temporary_folder
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
    try:
        with temporary_folder() as here:
            return _label_far(task, here)
    except _FarError as error:
        if is_full(error.reason):
            raise _no_space() from None
        return task.failure(error.reason, of_worker=True)
    except OutputError as error:
        raise (_no_space() if is_full(error) else error) from None


def _no_space() -> NoSpaceError:
    return NoSpaceError(f"{tempfile.gettempdir()}: no space left for temporary files; set TMPDIR")


_VISIBLE_WITHIN_S = (0.0, 0.1, 0.4, 1.5)
"""A network file system shows a file of another machine after some time."""


def is_visible(task: MapTask) -> bool:
    """Whether this process sees the result of a map that another one has labelled."""
    for wait_s in _VISIBLE_WITHIN_S:
        time.sleep(wait_s)
        if any(is_there(task.folder / name) for name in _MANIFESTS):
            return True
    return False


def is_done(task: MapTask) -> bool:
    """Whether a map is labelled as the task wants it, wherever it is; nothing is written."""
    outcome = label_anywhere(replace(task, only_look=True, claim=None, limit_s=None))
    return isinstance(outcome, LabelledRow)


class _FarError(Exception):
    """Something could not be fetched or put."""

    def __init__(self, reason: Exception) -> None:
        super().__init__()
        self.reason = reason


class _NotAMapError(_FarError):
    """What was fetched is no map."""


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
        near = replace(near, map=here / "map" / task.map.name)
        try:
            _fetch_map(task, near.map)
        except _NotAMapError as error:
            return near.failure(error.reason)
    if not is_address(task.folder):
        return label_one(replace(near, claim=task.claim))
    folder = here / "result" / task.folder.name
    near = replace(near, folder=folder, target=address_of(task.folder))
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


def fetch_results(out: Path, wanted: Collection[str], here: Path) -> None:
    """Copy a far folder's results into a local one: their files of the wanted names, as old."""
    far = FarFolder.at(out, InputError)
    for name in far.names():
        parts = PurePosixPath(name).parts
        if parts[-1] in wanted and not any(part.startswith(".") for part in parts):
            far.fetch(name, here / name)
            when = far.modified_s(name)
            os.utime(here / name, (when, when))


def _fetch_map(task: MapTask, local: Path) -> None:
    """Copy the map's YAML file and its image, side by side as they were."""
    source = FarFolder.at(task.map, MapError)
    with _between_machines():
        if not source.parent.fetch(task.map.name, local):
            raise MapError(f"{source.address}: no such file; expected a map description (YAML)")
    try:
        image = PurePosixPath(read_yaml(local, MapError, "map description").text("image"))
    except MapError as error:
        raise _NotAMapError(error) from error
    if image.is_absolute() or ".." in image.parts:
        raise _NotAMapError(
            MapError(
                f"{source.address}: its image {str(image)!r} lies outside its folder, where no "
                "image is fetched from; put it beside the map"
            )
        )
    with _between_machines():  # what is missing, reading the map will say
        source.parent.fetch(str(image), local.parent / image)


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
