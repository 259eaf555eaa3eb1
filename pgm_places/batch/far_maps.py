"""Maps and results behind addresses: fetched and put one map at a time, through a local folder."""

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path, PurePosixPath

from pgm_places.batch.manifest import MANIFEST_FILE
from pgm_places.batch.map_task import MapTask
from pgm_places.batch.outcomes import LabelledRow, Outcome
from pgm_places.errors import MapError, OutputError
from pgm_places.io.far_files import FarFolder
from pgm_places.io.input_file import is_address
from pgm_places.io.output_set import RECORD_FILE, written_names
from pgm_places.io.places.topology_files import NAMES_FILE
from pgm_places.io.strict_yaml import read_yaml

__all__ = ["label_far", "lists_of"]

_LOOKED_AT = (MANIFEST_FILE, RECORD_FILE, NAMES_FILE)
"""The files of a result that say whether it is done."""


def label_far(task: MapTask, label: Callable[[MapTask], Outcome]) -> Outcome:
    """Label a map where it, its results or both are behind addresses.

    The manifest is removed before, and written after, all other files of a result, and the record
    of files is written first: whatever ends the run, a result that is not complete does not count
    as done, but as ours.
    """
    with tempfile.TemporaryDirectory(prefix="pgm-places-") as temporary:
        here = Path(temporary)
        near = replace(task, claim=None, source=task.shown)
        if is_address(task.map):
            near = replace(near, map=_fetched_map(task, here / "map"))
        if not is_address(task.folder):
            return label(near)
        far = FarFolder.at(task.folder, OutputError)
        near = replace(near, folder=here / "result" / task.folder.name)
        _look_at(far, near.folder)
        outcome = label(replace(near, only_look=True))
        if isinstance(outcome, LabelledRow):
            return outcome
        _fetch_all(far, near.folder)
        before = written_names(near.folder)
        outcome = label(near)
        if isinstance(outcome, LabelledRow):
            _put_result(near.folder, far, before)
        return outcome


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
    if MANIFEST_FILE not in names:
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
    if RECORD_FILE in names and MANIFEST_FILE not in names:
        names = [name for name in names if name in (NAMES_FILE, RECORD_FILE)]
    for name in names:
        far.fetch(name, here / name)


def _put_result(here: Path, far: FarFolder, before: set[str]) -> None:
    """Copy a result, and remove what only an earlier one had; files of the user's own stay."""
    ours = written_names(here)
    far.remove([MANIFEST_FILE], OutputError)
    far.put(here, [RECORD_FILE, *sorted(ours - {MANIFEST_FILE}), MANIFEST_FILE], OutputError)
    far.remove(sorted(before - ours), OutputError)
