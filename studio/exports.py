"""Exports of the studio: files that the command line and other tools read."""

import json
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pgm_places.errors import InputError
from pgm_places.io.atomic import write_text
from pgm_places.io.output_set import output_set
from pgm_places.io.places.exports import export
from pgm_places.io.places.place_settings import PlaceSettings, save_settings
from pgm_places.io.places.result_folder import (
    CHECK_FILE,
    NAMES_FILE,
    OVERVIEW_FILE,
    ExportRequest,
    probability_file,
    record_exports,
)
from pgm_places.io.places.topology_files import (
    read_own_names,
)
from pgm_places.labelling.files import (
    PLACES,
    SETTINGS,
    PageFacts,
    earlier_places,
    write_labels,
    write_topology,
)
from pgm_places.labelling.places import places_of, separating_gates
from pgm_places.options import plain_values
from pgm_places.persistence.stored import save
from pgm_places.progress import warn
from pgm_places.studio.export_folders import (
    RECORD_FILE,
    Content,
    ExportFolders,
    ExportRecord,
    digest,
)
from pgm_places.studio.relabelling import renamed
from pgm_places.studio.session import MapSession
from pgm_places.studio.training_config import CORRECTIONS, paint_of, rules_of, write_training
from pgm_places.topology import place_edits
from pgm_places.topology.topological_map import TopologicalMap


@dataclass(frozen=True)
class Export:
    """A kind of export: its title, the files it always and sometimes writes, and its inputs.

    ``write`` takes a session, a staging folder and the final folder, and returns the paths.
    ``per_class`` adds a file of probabilities for each class.
    """

    words: str
    files: tuple[str, ...]
    write: Callable[[MapSession, Path, Path], list[Path]]
    more: tuple[str, ...] = ()
    content: Content = Content.LABELS
    per_class: bool = False

    def targets(self, folder: Path, session: MapSession) -> list[Path]:
        """All files that it may write into a folder."""
        classes = session.painting.classes.names if self.per_class else ()
        return [
            folder / name for name in (*self.files, *self.more, *map(probability_file, classes))
        ]


def exports_record(session: MapSession, folders: ExportFolders, chosen: str = "") -> dict[str, Any]:
    """A folder and its exports: files, whether they exist, and are outdated, as plain data."""
    folder = folders.chosen(chosen, session.folder)
    record, now = ExportRecord(session.folder / RECORD_FILE), session.question
    items = []
    for name, item in EXPORTS.items():
        is_there = all((folder / file).exists() for file in item.files)
        state = digest(session, item.content, now.paint, learns=now.learns)
        items.append(
            {
                "name": name,
                "words": item.words,
                "files": list(item.files),
                "there": _there(item, session, folder),
                "written": is_there,
                "older": is_there and not record.is_current(folder, name, state),
            }
        )
    return {
        "folder": str(folder.resolve()),
        "name": folders.name_of(folder),
        "own": folder == session.folder,
        "offered": folders.offered(session.folder),
        "items": items,
    }


def write_export(
    session: MapSession,
    name: str,
    folders: ExportFolders | None = None,
    *,
    chosen: str = "",
    replaced: Collection[str] | None = None,
) -> list[Path]:
    """Write an export into the session's folder, or into a chosen one; the paths.

    With ``replaced``, existing files that it does not list are not overwritten.
    """
    if name not in EXPORTS:
        raise InputError(f"there is no export {name[:40]!r}; there are {', '.join(EXPORTS)}")
    item = EXPORTS[name]
    folders = folders or ExportFolders.started_here()
    folder = folders.chosen(chosen, session.folder)
    targets = item.targets(folder, session)
    folders.check_free(targets, [session.source.yaml_path, session.source.image_path])
    there = _there(item, session, folder)
    new = next((name for name in there if replaced is not None and name not in replaced), None)
    if new is not None:
        raise InputError(f"{new} was written there in the meantime; look at the list again")
    relabelling, question = session.relabelling, session.question
    paint, learns = question.paint, question.learns
    if item.content in (Content.LABELS, Content.PLACES) and relabelling is not None:
        paint, learns = relabelling.taught.paint, relabelling.learns
    state = digest(session, item.content, paint, learns=learns)
    written = _written(session, [name], folder)[name]
    is_same = session.relabelling is relabelling and session.painting.revision == question.revision
    record = ExportRecord(session.folder / RECORD_FILE)
    record.note(folder, name, state if is_same else "", written)
    return written


def edit_with_exports(session: MapSession, request: Mapping[str, object]) -> str:
    """Carry out an edit; a new name of a place is written into the exports that are up to date.

    All files in the session's folder change at once, or none.
    """
    if request.get("kind") != "rename":
        return session.edit(request)
    folder, now = session.folder, session.question
    before = ExportRecord(folder / RECORD_FILE)
    state = digest(session, Content.PLACES, now.paint, learns=now.learns)
    current = [name for name in ("places", "nav2") if before.is_current(folder, name, state)]
    remark = session.edit(request)
    if current:
        written = _written(session, current, folder)
        record = ExportRecord(folder / RECORD_FILE)
        state = digest(session, Content.PLACES, now.paint, learns=now.learns)
        for name, paths in written.items():
            record.note(folder, name, state, paths)
    return remark


def _there(item: Export, session: MapSession, folder: Path) -> list[str]:
    """The files of an export that exist in a folder."""
    targets = item.targets(folder, session)
    return [path.relative_to(folder).as_posix() for path in targets if path.exists()]


def _written(session: MapSession, names: Sequence[str], folder: Path) -> dict[str, list[Path]]:
    """Write exports into a folder, all of their files or none; the paths of each."""
    own = _named_places(session, folder).own if "places" in names else None
    with output_set(folder, "studio", force=True, shared=True, keeps_owners=True) as files:
        staged = {name: EXPORTS[name].write(session, files.stage, folder) for name in names}
        has_names = (files.stage / NAMES_FILE).exists()
    if own is not None:
        if not has_names:
            (folder / NAMES_FILE).unlink(missing_ok=True)
        ExportRecord(session.folder / RECORD_FILE).note_names(folder, own)
    return {
        name: [
            folder / path.relative_to(files.stage) if path.is_relative_to(files.stage) else path
            for path in paths
        ]
        for name, paths in staged.items()
    }


def _labels(session: MapSession, stage: Path, _: Path) -> list[Path]:
    return write_labels(session.answer.labelled, session.source, stage)


def _corrections(session: MapSession, folder: Path, _: Path) -> list[Path]:
    paint = paint_of(session)
    image = paint.save(folder / CORRECTIONS, session.grid)
    shapes = paint.save(folder / "corrections.geojson", session.grid)
    return [image, image.with_suffix(".yaml"), shapes]


def _places(session: MapSession, stage: Path, folder: Path) -> list[Path]:
    topology, others, own = _named_places(session, folder)
    labelled = session.answer.labelled
    there = {path.name for path in folder.iterdir()} if folder.is_dir() else set()
    page: PageFacts = {
        "names": {*there, *PLACES, *SETTINGS},
        "map_name": session.source.yaml_path.name,
        "warnings": (*session.source.warnings, *labelled.warnings),
    }
    gates = separating_gates(labelled.doorways, session.rules)
    written = save_settings(stage, PlaceSettings(session.rules, gates))
    written += write_topology(stage, session.grid, topology, title=session.source.name, page=page)
    if names := others | own:
        lines = (f"{key}: {json.dumps(name, ensure_ascii=False)}\n" for key, name in names.items())
        written.append(write_text(stage / NAMES_FILE, "".join(lines)))
    return written


class _NamedPlaces(NamedTuple):
    """Places, and names by id: given by other programs in the folder, and by the user."""

    topology: TopologicalMap
    others: dict[int, str]
    own: dict[int, str]


def _named_places(session: MapSession, folder: Path) -> _NamedPlaces:
    """The places with the ids in a folder, if it has any, and the user's names."""
    taught, names = session.answer, session.painting.names
    known = None if folder == session.folder else earlier_places(folder)
    if known is not None:
        cuts = session.painting.cuts
        found = places_of(taught.labelled.cells, session.rules, ids=known, cuts=cuts)
        if not np.array_equal(found.region, taught.topology.region):
            warn(f"The places have other ids in {folder} than on this page, and keep them there.")
        taught = renamed(replace(taught, topology=found), names)
    topology = taught.topology
    regions = [topology.region_at(*point) for point in names]
    own = {region.id: region.name for region in regions if region is not None}
    earlier = ExportRecord(session.folder / RECORD_FILE).names(folder)
    others = {k: name for k, name in read_own_names(folder).items() if earlier.get(k) != name}
    return _NamedPlaces(place_edits.renamed(topology, others | own), others, own)


def _nav2(session: MapSession, stage: Path, folder: Path) -> list[Path]:
    topology = _named_places(session, folder).topology
    kinds = ("nav2-route", "zones")
    record_exports(stage, folder, [*map(ExportRequest, kinds)])
    return [path for kind in kinds for path in export(topology, kind, stage, lies_in=folder)]


def _training(session: MapSession, stage: Path, _: Path) -> list[Path]:
    """A configuration with which ``pgm-places train`` repeats the training of the studio."""
    names = [name for name, n in paint_of(session).counts.items() if n]
    title = f"{session.source.name}, painted in the studio"
    written = write_training([session], stage, title, names, beside=True)
    return [written[0], *_corrections(session, stage, stage)]


def _model(session: MapSession, _: Path, folder: Path) -> list[Path]:
    """The model trained so far, paint included, for other maps."""
    if session.answer.labeler is session.labeler:
        raise InputError("nothing has been taught yet; press 'Teach from this' first")
    record = {
        "taught": {"map": session.source.yaml_path.name, "on_top_of": session.model},
        "config": plain_values(rules_of(session)),
    }
    return [save(session.answer.labeler, folder / "model", record=record)]


EXPORTS = {
    "labels": Export(
        "Label image", ("labels.png", "labels.yaml"), _labels, (OVERVIEW_FILE,), per_class=True
    ),
    "corrections": Export(
        "Corrections",
        (CORRECTIONS, "corrections.yaml", "corrections.geojson"),
        _corrections,
        content=Content.PAINT,
    ),
    "places": Export(
        "Places",
        PLACES,
        _places,
        more=(CHECK_FILE, NAMES_FILE, *SETTINGS),
        content=Content.PLACES,
    ),
    "nav2": Export(
        "Route and zones for Nav2",
        ("nav2_route.geojson", "zones.png", "zones.yaml"),
        _nav2,
        content=Content.PLACES,
    ),
    "model": Export("Model, with what it has learned", ("model",), _model),
    "training": Export(
        "Training configuration",
        ("train.toml", CORRECTIONS),
        _training,
        more=("corrections.yaml", "corrections.geojson"),
        content=Content.TRAINING,
    ),
}
