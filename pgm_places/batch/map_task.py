"""The work on one map of a batch, as a worker process does it."""

import errno
import time
import traceback
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from pgm_places._version import __version__
from pgm_places.batch.manifest import (
    MANIFEST_FILE,
    Elsewhere,
    Failure,
    LabelledRow,
    Outcome,
    done_figures,
    made_from,
    manifest_text,
)
from pgm_places.batch.map_files import LabelledFile, label_file
from pgm_places.batch.ready_model import LabelOptions, ReadyModel, ready_model
from pgm_places.batch.workers import TimeIsUpError, time_limit
from pgm_places.errors import InputError, OutputError, PgmPlacesError, printable
from pgm_places.io.atomic import write_bytes, write_text
from pgm_places.io.far_files import address_of
from pgm_places.io.input_file import is_address
from pgm_places.io.maps.map_server import load_map
from pgm_places.io.output_set import output_set
from pgm_places.io.staging import claimed
from pgm_places.progress import Silent, duration
from pgm_places.report.map_pictures import thumbnail
from pgm_places.report.outputs import label_names
from pgm_places.topology.checks import doubtful_share, places_to_check

THUMBNAIL_FILE = "thumbnail.png"


class NoSpaceError(OutputError):
    """The disk or the quota is full: no other map could be written either."""


@dataclass(frozen=True)
class MapTask:
    """One map to label, complete in itself, so that any process may do it.

    Parameters
    ----------
    name : str
        For the summary.
    map, folder : Path
        The YAML file, and where the results will stand; both absolute.
    options : LabelOptions
    model_sha256 : str
        Of the model that is meant, wherever the process finds it.
    n_threads : int
    force : bool
        Overwrite what is not, or no longer, ours.
    claim : Path, optional
        The file that stands for the right to label this map.
    limit_s : float, optional
        How long it may take.
    source : str
        What the map is called in lists and messages, if not by its path.
    only_look : bool
        Say whether it is done, and leave it to others if not.
    version : str
        Of the process that made the task.
    """

    name: str
    map: Path
    folder: Path
    options: LabelOptions
    model_sha256: str
    n_threads: int = 1
    force: bool = False
    claim: Path | None = None
    limit_s: float | None = None
    source: str = ""
    only_look: bool = False
    version: str = __version__

    @property
    def shown(self) -> str:
        """What the map is called in lists and messages."""
        return self.source or (address_of(self.map) if is_address(self.map) else str(self.map))

    def failure(self, error: BaseException) -> Failure:
        """What the error makes of this map."""
        name = type(error).__name__
        if isinstance(error, PgmPlacesError):
            message = str(error)
        elif isinstance(error, MemoryError):
            message = "out of memory; raise --memory, or use fewer jobs"
        elif isinstance(error, TimeIsUpError):
            name = "TimeLimit"
            message = f"it took longer than {duration(self.limit_s or 0.0)}; raise --time-limit"
        else:
            frame = traceback.extract_tb(error.__traceback__)[-1:]
            where = f" ({Path(frame[0].filename).name}:{frame[0].lineno})" if frame else ""
            message = f"{error}{where}"
        return Failure(self.name, self.shown, name, printable(message))


def label_one(task: MapTask) -> Outcome:
    """Label a map, unless it is done; whatever is wrong with it is an outcome, too.

    Raises
    ------
    NoSpaceError
        The disk is full, which is not the map's fault.
    InputError
        This process runs another version, or finds another model.
    """
    model = _same_model(task)
    try:
        with claimed(task.claim, task.name) as is_ours:
            if not is_ours:
                return Elsewhere()
            figures = done_figures(task.folder, task.map, model, task.options)
            if figures is not None:
                return LabelledRow.of_figures(task.name, task.shown, figures)
            if task.only_look:
                return Elsewhere()
            with time_limit(task.limit_s):
                return _labelled(task, model)
    except OutputError as error:
        if _is_full(error):
            raise NoSpaceError(str(error)) from None
        return task.failure(error)
    except (Exception, TimeIsUpError) as error:  # noqa: BLE001  one bad map must not end a night's work
        return task.failure(error)


def _same_model(task: MapTask) -> ReadyModel:
    """The model of this process, if it gives the labels that the task's maker would get."""
    if task.version != __version__:
        raise InputError(
            f"a worker runs pgm-places {__version__}, but the batch was started by "
            f"{task.version}; install one version everywhere"
        )
    model = _ready(task.options, task.model_sha256)
    if model.sha256 != task.model_sha256:
        raise InputError(
            f"{task.options.folder} holds another model on a worker than where the batch was "
            "started; put the model on a shared disk, and leave it unchanged while the batch runs"
        )
    return model


@lru_cache(maxsize=1)
def _ready(options: LabelOptions, sha256: str) -> ReadyModel:  # noqa: ARG001  a part of the key
    """The model, read once per process and content."""
    return ready_model(options)


def _labelled(task: MapTask, model: ReadyModel) -> LabelledRow:
    start = time.perf_counter()
    outputs = task.options.outputs
    names = (*label_names(model.labeler.label_names, outputs), THUMBNAIL_FILE, MANIFEST_FILE)
    with output_set(task.folder, "label", names=names, force=task.force) as files:
        source = load_map(task.map, unknown_value=task.options.unknown_value)
        made = made_from(task.folder, task.map, source.image_path, model, task.options)
        labelled = label_file(
            model,
            source,
            files,
            max_cells=task.options.max_cells,
            outputs=outputs,
            n_threads=task.n_threads,
            progress=Silent(),
        )
        if outputs.pictures:
            picture = thumbnail(source.grid, labelled.labels, labelled.topology.label_names)
            write_bytes(files.stage / THUMBNAIL_FILE, picture)
        row = _row(task, model, labelled, time.perf_counter() - start)
        write_text(files.stage / MANIFEST_FILE, manifest_text(made, row, outputs))
    return row


def _row(task: MapTask, model: ReadyModel, labelled: LabelledFile, seconds: float) -> LabelledRow:
    topology = labelled.topology
    checks = places_to_check(topology)
    return LabelledRow(
        name=task.name,
        map=task.shown,
        method=model.method,
        n_places=len(topology.regions),
        n_connections=len(topology.connections),
        area_m2=labelled.area_m2,
        doubt=doubtful_share(topology),
        check_first=checks[0].place.name if checks else "",
        warnings=labelled.warnings,
        seconds=round(seconds, 3),
    )


def _is_full(error: BaseException) -> bool:
    """Whether the system said that no space is left, at any step on the way to this error."""
    step: BaseException | None = error
    while step is not None:
        if isinstance(step, OSError) and step.errno in (errno.ENOSPC, errno.EDQUOT):
            return True
        step = step.__cause__ or step.__context__
    return False
