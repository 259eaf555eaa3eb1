"""Labelling one map of a batch: task, outcome and manifest."""

import json
import os
import time
import traceback
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from pgm_places._version import __version__
from pgm_places.batch.limits import TimeIsUpError, causes_of_system, is_full, time_limit
from pgm_places.errors import InputError, OutputError, PgmPlacesError, escape_control
from pgm_places.io.atomic import write_bytes, write_text
from pgm_places.io.input_file import read_json, sha256_of
from pgm_places.io.maps.map_server import load_map
from pgm_places.io.output_set import has_all_files
from pgm_places.io.places.result_folder import (
    MANIFEST_FILE,
    NAMES_FILE,
    THUMBNAIL_FILE,
    detail_path,
)
from pgm_places.io.remote_files import shown_path
from pgm_places.io.staging import claimed
from pgm_places.labelling.files import WrittenMap, label_files, write_labelled
from pgm_places.labelling.label import label
from pgm_places.labelling.model import LoadedModel
from pgm_places.labelling.options import LabelOptions, Outputs
from pgm_places.options import option_values
from pgm_places.pictures.map_pictures import thumbnail
from pgm_places.progress import duration
from pgm_places.topology.checks import doubtful_share, places_to_check


@dataclass(frozen=True, kw_only=True)
class LabelledRow:
    """A labelled map: its output folder and YAML file, and its values in the batch's tables.

    ``doubt``: expected share of wrongly labelled area; ``check_first``: the place with most of it.
    """

    name: str
    map: str
    skipped: bool = False
    method: str
    n_places: int
    n_connections: int
    area_m2: dict[str, float]
    doubt: float | None
    check_first: str
    warnings: tuple[str, ...] = field(default=())
    seconds: float

    @property
    def total_m2(self) -> float:
        """Area of all labels."""
        return sum(self.area_m2.values())

    @property
    def is_sound(self) -> bool:
        """Whether every value has its type; a manifest may be damaged."""
        numbers = [self.n_places, self.n_connections, self.seconds, *self.area_m2.values()]
        numbers += [] if self.doubt is None else [self.doubt]
        texts = [self.method, self.check_first, *self.area_m2, *self.warnings]
        return all(isinstance(value, int | float) for value in numbers) and all(
            isinstance(value, str) for value in texts
        )

    @property
    def figures(self) -> dict[str, Any]:
        """The values stored in the manifest."""
        left_out = ("name", "map", "skipped")
        return {key: value for key, value in asdict(self).items() if key not in left_out}

    @classmethod
    def of_figures(cls, name: str, path: str, figures: dict[str, Any]) -> "LabelledRow":
        """The row of a map labelled by an earlier run."""
        warnings = tuple(figures.pop("warnings"))
        return cls(name=name, map=path, skipped=True, warnings=warnings, **figures)


@dataclass(frozen=True)
class Failure:
    """A map's error in one line; ``of_worker``: another worker could succeed."""

    name: str
    map: str
    kind: str
    message: str
    of_worker: bool = False


@dataclass(frozen=True)
class ClaimedByOther:
    """A map that is claimed by another batch with the same output folder."""


Outcome = LabelledRow | Failure | ClaimedByOther


_FORMAT, _SCHEMA = "pgm-places labelled map", 1
_MAX_BYTES = 1 << 20


def provenance(
    folder: Path, yaml_path: Path, image_path: Path, model: LoadedModel, options: LabelOptions
) -> dict[str, Any]:
    """Everything that the labels and places of a map depend on, as plain data.

    The image's path is relative to the map's folder, so that a collection may be moved.
    """
    names = folder / NAMES_FILE  # the user's names of places
    return {
        "map": sha256_of(yaml_path),
        "image": os.path.relpath(image_path, yaml_path.parent),
        "image_sha256": sha256_of(image_path),
        "names": sha256_of(names) if names.exists() else None,
        "model": model.sha256,
        "method": model.method,
        "options": {
            "halls": model.labeler.halls,
            "doorway_depth_m": model.labeler.doorway_depth_m,
            "unknown_value": options.unknown_value,
            "entered": option_values(model.entered),
            "topology": json.loads(json.dumps(option_values(model.rules))),
        },
        "version": __version__,
    }


def manifest_text(made: Mapping[str, Any], row: LabelledRow, outputs: Outputs) -> str:
    """The manifest: provenance, figures of the result, and requested outputs."""
    record = {
        "format": _FORMAT,
        "schema": _SCHEMA,
        "map": row.map,
        "made_from": made,
        "outputs": asdict(outputs),
        "figures": row.figures,
    }
    return json.dumps(record, indent=1, allow_nan=False) + "\n"


def done_figures(
    folder: Path, yaml_path: Path, model: LoadedModel, options: LabelOptions
) -> dict[str, Any] | None:
    """The figures of an up-to-date result; None if the map has to be labelled.

    Up to date: current provenance and requested outputs in the manifest, and all files exist.
    """
    record = manifest_record(folder)
    if record is None:
        return None
    try:
        made, figures = record["made_from"], dict(record["figures"])
        wanted = {name for name, is_wanted in asdict(options.outputs).items() if is_wanted}
        left_out = {name for name, was in record.get("outputs", {}).items() if not was}
        image_path = yaml_path.parent / made["image"]
        now = provenance(folder, yaml_path, image_path, model, options)
    except (InputError, LookupError, TypeError, ValueError, AttributeError):
        return None  # a damaged manifest or a missing map, which labelling will report
    same = made == now and not wanted & left_out
    return figures if same and has_all_files(folder) else None


def labelled_row(folder: Path, name: str) -> LabelledRow | None:
    """The row of a folder's manifest; None if the manifest is missing or damaged."""
    record = manifest_record(folder)
    try:
        if record is not None:
            row = LabelledRow.of_figures(name, str(record["map"]), dict(record["figures"]))
            return row if row.is_sound else None
    except (LookupError, TypeError, ValueError, AttributeError):
        pass
    return None


def warnings_of(folder: Path) -> tuple[str, ...]:
    """The warnings of a labelled map; empty if they are unknown."""
    row = labelled_row(folder, "")
    return () if row is None else row.warnings


def manifest_record(folder: Path) -> dict[str, Any] | None:
    """The content of a folder's manifest; None if it is missing or invalid."""
    path = detail_path(folder, MANIFEST_FILE)
    try:
        record = read_json(path, InputError, "a labelled map's manifest", max_bytes=_MAX_BYTES)
        known = (record["format"], record["schema"]) == (_FORMAT, _SCHEMA)
    except (InputError, LookupError, TypeError):
        return None
    return record if known else None


class NoSpaceError(OutputError):
    """The disk or the quota is full, so no other map could be written either."""


@dataclass(frozen=True)
class MapTask:
    """One map to label, self-contained for any process; paths are absolute.

    ``force`` overwrites foreign or changed files. ``claim`` is the map's lock file. ``source`` and
    ``target`` are names for messages, if they differ from the paths; ``version`` is the package's.
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
    target: str = ""
    only_check: bool = False
    version: str = __version__

    @property
    def shown(self) -> str:
        """Name of the map in the index and in messages."""
        return self.source or shown_path(self.map)

    def as_called(self, text: str) -> str:
        """A text with local paths replaced by the user's names."""
        if self.source:
            text = text.replace(str(self.map), self.source)
            text = text.replace(f"{self.map.parent}/", f"{self.source.rpartition('/')[0]}/")
        return text.replace(str(self.folder), self.target) if self.target else text

    def failure(self, error: BaseException, *, of_worker: bool = False) -> Failure:
        """The failure of this map by an error."""
        name = type(error).__name__
        if isinstance(error, PgmPlacesError):
            message = str(error)
        elif isinstance(error, MemoryError):
            message = "out of memory; raise --memory, or use fewer jobs"
        elif isinstance(error, TimeIsUpError):
            name = "TimeLimit"
            message = f"time limit of {duration(self.limit_s or 0.0)} exceeded; raise --time-limit"
        else:
            frame = traceback.extract_tb(error.__traceback__)[-1:]
            where = f" ({Path(frame[0].filename).name}:{frame[0].lineno})" if frame else ""
            message = f"{error}{where}"
        message = escape_control(self.as_called(message))
        return Failure(self.name, self.shown, name, message, of_worker)


def label_one(task: MapTask) -> Outcome:
    """Label a map, unless it is labelled; most errors become a :class:`Failure`."""
    try:
        model = same_model(task)
    except MemoryError as error:
        return task.failure(error)
    try:
        with claimed(task.claim, task.name) as is_ours:
            if not is_ours:
                return ClaimedByOther()
            figures = done_figures(task.folder, task.map, model, task.options)
            if figures is not None:
                return LabelledRow.of_figures(task.name, task.shown, figures)
            if task.only_check:
                return ClaimedByOther()
            with time_limit(task.limit_s):
                return _labelled(task, model)
    except OutputError as error:
        if is_full(error):
            raise NoSpaceError(task.as_called(str(error))) from None
        return task.failure(error, of_worker=any(causes_of_system(error)))
    except (Exception, TimeIsUpError) as error:  # noqa: BLE001  one bad map must not stop the batch
        return task.failure(error, of_worker=not os.path.lexists(task.map))


def same_model(task: MapTask) -> LoadedModel:
    """The model of the task; an error if this process has another version of it."""
    if task.version != __version__:
        raise InputError(
            f"a worker has pgm-places {__version__}, but the batch was started by version "
            f"{task.version}; install the same version everywhere"
        )
    model = _ready(task.options, task.model_sha256)
    if model.sha256 != task.model_sha256:
        raise InputError(
            f"{task.options.folder}: a worker has another version of this model; put the model on "
            "a shared disk, and do not change it during the batch"
        )
    return model


@lru_cache(maxsize=1)
def _ready(options: LabelOptions, sha256: str) -> LoadedModel:  # noqa: ARG001  a cache key
    """The model, loaded once per process and content."""
    return LoadedModel.load(options)


def _labelled(task: MapTask, model: LoadedModel) -> LabelledRow:
    start = time.perf_counter()
    outputs = task.options.outputs
    labels, more = model.labeler.label_names, (THUMBNAIL_FILE, MANIFEST_FILE)
    with label_files(task.folder, labels, outputs, more=more, force=task.force) as files:
        source = load_map(task.map, unknown_value=task.options.unknown_value)
        if task.source:
            warnings = tuple(map(task.as_called, source.warnings))
            source = replace(source, yaml_path=Path(task.source), warnings=warnings)
        made = provenance(task.folder, task.map, source.image_path, model, task.options)
        labelled = write_labelled(
            label(model, source.grid, max_cells=task.options.max_cells, n_threads=task.n_threads),
            source,
            files,
            model.rules,
            outputs=outputs,
            n_threads=task.n_threads,
        )
        if outputs.pictures:
            picture = thumbnail(source.grid, labelled.labels, labelled.topology.label_names)
            write_bytes(files.stage / THUMBNAIL_FILE, picture)
        row = _row(task, model, labelled, time.perf_counter() - start)
        write_text(files.stage / MANIFEST_FILE, manifest_text(made, row, outputs))
    return row


def _row(task: MapTask, model: LoadedModel, labelled: WrittenMap, seconds: float) -> LabelledRow:
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
