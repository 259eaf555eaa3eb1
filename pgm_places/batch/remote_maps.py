"""Batch labelling of remote maps: each is fetched, labelled in a local folder and uploaded."""

import os
import shutil
import tempfile
import time
from collections.abc import Collection, Iterable, Iterator
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
from pgm_places.io.input_file import is_address
from pgm_places.io.output_set import RECORD_FILE, written_names
from pgm_places.io.places.result_folder import MANIFEST_FILE, NAMES_FILE
from pgm_places.io.remote_files import RemoteFolder, address_of, is_there, temporary_folder
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


_LOOKED_AT_ONCE = 2_000
"""Maps whose results are listed, folder by folder, before they are looked at."""


def done_rows(tasks: Iterable[MapTask]) -> Iterator[tuple[MapTask, LabelledRow | None]]:
    """The tasks, each with its row if its map is labelled as wanted; nothing is written.

    Wherever the maps and the results are: far results are listed by folder, and what has to be
    compared is fetched with many requests at once.
    """
    waiting = iter(tasks)
    while some := list(islice(waiting, _LOOKED_AT_ONCE)):
        far = next((RemoteFolder.at(path) for path in _far_paths(some)), None)
        if far is None:
            yield from ((task, _row(label_one(_only_looking(task)))) for task in some)
            continue
        folders = {task.folder.parent for task in some if is_address(task.folder)}
        outer = sorted(item for item in folders if folders.isdisjoint(item.parents))
        names: dict[str, list[str]] = {str(task.folder): [] for task in some}
        for folder, below in zip(outer, far.at_once(_names_below, outer), strict=True):
            for name in below:
                result = f"{folder}/{name}"
                while len(result) > len(str(folder)) and result not in names:
                    result = result.rpartition("/")[0]
                if result in names:
                    names[result].append(f"{folder}/{name}"[len(result) + 1 :])
        same_model(some[0])  # read once, not by each of the threads
        with temporary_folder() as here:
            looks = [
                partial(_looked_at, task, names[str(task.folder)], here / str(number))
                for number, task in enumerate(some)
            ]
            outcomes = far.at_once(lambda look: look(), looks)
        yield from zip(some, map(_row, outcomes), strict=True)


def _far_paths(tasks: Iterable[MapTask]) -> Iterator[Path]:
    yield from (path for task in tasks for path in (task.folder, task.map) if is_address(path))


def _names_below(folder: Path) -> list[str]:
    return RemoteFolder.at(folder).names()


def _only_looking(task: MapTask) -> MapTask:
    return replace(task, only_look=True, claim=None, limit_s=None)


def _row(outcome: Outcome) -> LabelledRow | None:
    return outcome if isinstance(outcome, LabelledRow) else None


def _looked_at(task: MapTask, names: Collection[str], here: Path) -> Outcome:
    """Whether a map is done, of whose far result the files are listed."""
    near = replace(_only_looking(task), source=task.shown)
    try:
        if is_address(task.folder):
            if not set(_MANIFESTS).intersection(names):
                return ClaimedByOther()
            near = replace(near, folder=here / "result")
            with _between_machines():
                _look_at(RemoteFolder.at(task.folder), near.folder, names)
        elif not any((task.folder / name).exists() for name in _MANIFESTS):
            return ClaimedByOther()
        if is_address(task.map):
            near = replace(near, map=here / "map" / task.map.name)
            _fetch_map(task, near.map)
        return label_one(near)
    except _FarError as error:
        return task.failure(error.reason)
    finally:
        shutil.rmtree(here, ignore_errors=True)


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
        far = RemoteFolder.at(task.folder, OutputError)
        there = far.names()
        _look_at(far, near.folder, there)
    outcome = label_one(replace(near, only_look=True))
    if isinstance(outcome, LabelledRow):
        return outcome
    with _between_machines():
        _fetch_all(far, near.folder, there)
        before = written_names(near.folder)
    outcome = label_one(near)
    if isinstance(outcome, LabelledRow):
        with _between_machines():
            _put_result(near.folder, far, before, there)
    return outcome


def fetch_results(out: Path, wanted: Collection[str], here: Path) -> None:
    """Copy a far folder's results into a local one: their files of the wanted names, as old."""
    far = RemoteFolder.at(out, InputError)

    def fetch(name: str) -> None:
        if far.fetch(name, here / name):
            when = far.modified_s(name)
            os.utime(here / name, (when, when))

    parts = ((name, PurePosixPath(name).parts) for name in far.names())
    far.at_once(
        fetch,
        (
            name
            for name, each in parts
            if each[-1] in wanted and not any(part.startswith(".") for part in each)
        ),
    )


def _fetch_map(task: MapTask, local: Path) -> None:
    """Copy the map's YAML file and its image, side by side as they were."""
    source = RemoteFolder.at(task.map, MapError)
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


def _look_at(far: RemoteFolder, here: Path, names: Collection[str]) -> None:
    """Of a result, what says whether it is done; all other files as empty ones."""
    if not set(names).intersection(_MANIFESTS):
        return
    for name in names:
        if name in _LOOKED_AT:
            far.fetch(name, here / name)
        else:
            (here / name).parent.mkdir(parents=True, exist_ok=True)
            (here / name).touch()


def _fetch_all(far: RemoteFolder, here: Path, names: Collection[str]) -> None:
    """What an earlier run left; of a result that it did not complete only what the user gave."""
    if RECORD_FILE in names and not set(names).intersection(_MANIFESTS):
        names = [name for name in names if name in (NAMES_FILE, RECORD_FILE)]
    for name in names:
        far.fetch(name, here / name)


def _put_result(here: Path, far: RemoteFolder, before: set[str], there: Collection[str]) -> None:
    """Copy a result, and remove what only an earlier one had; files of the user's own stay."""
    ours = written_names(here)
    far.remove([MANIFEST_FILE, *set(_MANIFESTS[1:]).intersection(there)], OutputError)
    far.put(here, [RECORD_FILE], OutputError)
    far.at_once(lambda name: far.put(here, [name], OutputError), sorted(ours - {MANIFEST_FILE}))
    far.put(here, [MANIFEST_FILE], OutputError)
    far.remove(sorted(before - ours), OutputError)
