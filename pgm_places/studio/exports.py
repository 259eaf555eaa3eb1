"""Exports of the studio: files in its folder that the command line and other tools read."""

import json
import os
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pgm_places.errors import InputError
from pgm_places.experiment.config import NO_MODEL
from pgm_places.io.atomic import write_text
from pgm_places.io.maps.label_image import save_labels
from pgm_places.io.places.check_table import CHECK_FILE, write_checks
from pgm_places.io.places.exports import export
from pgm_places.io.places.topology_files import NAMES_FILE, save_topology
from pgm_places.options import option_values, plain_values
from pgm_places.persistence.stored import save
from pgm_places.studio.desk import Desk
from pgm_places.teaching.lesson import OF_PAINT_ALONE, TeachingOptions
from pgm_places.teaching.paint import Paint
from pgm_places.teaching.taught import Taught
from pgm_places.topology.rules import TopologyOptions
from pgm_places.trained import NAMES

__all__ = ["EXPORTS", "Export", "exports_record", "write_export", "write_training"]

CORRECTIONS = "corrections.png"


@dataclass(frozen=True)
class Export:
    """A kind of export.

    Parameters
    ----------
    words : str
        What it is, for the browser.
    files : tuple of str
        The names of what it writes, as far as they are known beforehand.
    write : callable
        Writes it into the desk's folder; the paths.
    """

    words: str
    files: tuple[str, ...]
    write: Callable[[Desk], list[Path]]


def exports_record(desk: Desk) -> dict[str, Any]:
    """The folder, and of each export what it writes, whether it is there, and older than the paint.

    As plain data for the browser.
    """
    painted_ns = _written_ns(desk.painting.journal.path) or 0
    items = []
    for name, item in EXPORTS.items():
        written = [_written_ns(desk.folder / file) for file in item.files]
        there = [each for each in written if each is not None]
        items.append(
            {
                "name": name,
                "words": item.words,
                "files": list(item.files),
                "written": bool(there),
                "older": bool(there) and min(there) < painted_ns,
            }
        )
    return {"folder": str(desk.folder.resolve()), "items": items}


def _written_ns(path: Path) -> int | None:
    """When a file, or the newest in a folder, was written; None where there is none."""
    try:
        times = [each.stat().st_mtime_ns for each in (path.iterdir() if path.is_dir() else (path,))]
    except OSError:
        return None
    return max(times, default=None)


def write_export(desk: Desk, name: str) -> list[Path]:
    """Write an export into the desk's folder; the paths.

    Raises
    ------
    InputError
        There is no such export, or nothing to write yet.
    OutputError
        A file cannot be written.
    """
    if name not in EXPORTS:
        raise InputError(f"there is no export {name[:40]!r}; there are {', '.join(EXPORTS)}")
    return EXPORTS[name].write(desk)


def _labels(desk: Desk) -> list[Path]:
    taught = _taught(desk)
    return [*save_labels(desk.folder / "labels.png", taught.labels, taught.label_names)]


def _corrections(desk: Desk) -> list[Path]:
    paint = _paint(desk)
    image = paint.save(desk.folder / CORRECTIONS, desk.grid)
    shapes = paint.save(desk.folder / "corrections.geojson", desk.grid)
    return [image, image.with_suffix(".yaml"), shapes]


def _places(desk: Desk) -> list[Path]:
    taught = _taught(desk)
    written = save_topology(desk.folder, taught.topology)
    if taught.checks:
        written.append(write_checks(desk.folder / CHECK_FILE, taught.topology))
    own = {}
    for (x, y), name in desk.painting.names.items():
        region = taught.topology.region_at(x, y)
        if region is not None and region.name == name:
            own[region.id] = name
    if own:
        lines = (f"{key}: {json.dumps(own[key], ensure_ascii=False)}\n" for key in sorted(own))
        written.append(write_text(desk.folder / NAMES_FILE, "".join(lines)))
    return written


def _nav2(desk: Desk) -> list[Path]:
    topology = _taught(desk).topology
    kinds = ("nav2-route", "zones")
    return [path for kind in kinds for path in export(topology, kind, desk.folder)]


def _training(desk: Desk) -> list[Path]:
    """A configuration by which ``pgm-places train`` learns what the studio has learned."""
    names = [name for name, n in _paint(desk).counts.items() if n]
    title = f"{desk.source.yaml_path.stem}, painted in the studio"
    return [write_training([desk], desk.folder, title, names)[0], *_corrections(desk)]


def write_training(
    desks: Sequence[Desk], folder: Path, title: str, painted: Collection[str]
) -> list[Path]:
    """Write a configuration that teaches one model the paint of all these maps, and the paint.

    ``painted`` are the classes that are painted anywhere. The desks need not be open.

    Raises
    ------
    InputError
        Without a model to build on, fewer than two classes are painted.
    """
    first = desks[0]
    alone = first.labeler is None
    if alone and len(set(painted)) < 2:
        raise InputError("paint at least two classes; there is nothing to tell apart yet")
    options = option_values(TeachingOptions())
    if alone:
        options = {name: options[name] for name in OF_PAINT_ALONE}
    rules = {} if first.rules == TopologyOptions() else option_values(first.rules)
    names = list(dict.fromkeys(name for desk in desks for name in desk.painting.classes.names))
    images = [
        _paint(desk).with_classes(names).save(desk.folder / CORRECTIONS, desk.grid)
        for desk in desks
    ]
    text = "\n".join(
        [
            *_keys({"title": title, "base_model": _base_model(first)}),
            *_table("[labels]", {"names": names}),
            *_table("[teaching]", options),
            *(_table("[topology]", rules) if rules else ()),
            *(line for desk in desks for line in _table("[[train]]", _source(desk, folder))),
            "",
        ]
    )
    return [write_text(folder / "train.toml", text), *images]


def _source(desk: Desk, folder: Path) -> dict[str, Any]:
    """What a configuration in a folder says of a painted map."""
    corrections = desk.folder.resolve() / CORRECTIONS
    found: dict[str, Any] = {
        "map": str(desk.source.yaml_path.resolve()),
        "corrections": os.path.relpath(corrections, folder.resolve()),
    }
    if desk.source.unknown_value is not None:
        found["unknown_value"] = desk.source.unknown_value
    return found


def _base_model(desk: Desk) -> str:
    if desk.labeler is None:
        return NO_MODEL
    return desk.model if desk.model in NAMES else str(Path(desk.model).resolve())


def _table(header: str, values: Mapping[str, Any]) -> list[str]:
    return ["", header, *_keys(values)]


def _keys(values: Mapping[str, Any]) -> list[str]:
    """Lines of TOML; JSON writes strings, numbers, booleans and lists of them just so."""
    return [f"{name} = {json.dumps(value, ensure_ascii=False)}" for name, value in values.items()]


def _model(desk: Desk) -> list[Path]:
    """What has been learned so far, paint included, for other maps."""
    if _taught(desk).labeler is desk.labeler:
        raise InputError("nothing has been taught yet; press 'Teach from this' first")
    folder = desk.folder / "model"
    record = {
        "taught": {"map": desk.source.yaml_path.name, "on_top_of": desk.model},
        "config": {"topology": plain_values(desk.rules)},
    }
    return [save(_taught(desk).labeler, folder, record=record)]


def _taught(desk: Desk) -> Taught:
    taught = desk.taught
    if taught is None:
        raise InputError("there are no labels yet; wait until the map has been labelled")
    return taught


def _paint(desk: Desk) -> Paint:
    if not desk.painting.n_painted:
        raise InputError("nothing is painted yet")
    return Paint(desk.painting.labels.copy(), desk.painting.classes.names)


EXPORTS = {
    "labels": Export("Label image", ("labels.png", "labels.yaml"), _labels),
    "corrections": Export(
        "Corrections", (CORRECTIONS, "corrections.yaml", "corrections.geojson"), _corrections
    ),
    "places": Export("Places", ("topology.json", "regions.png", "regions.geojson"), _places),
    "nav2": Export(
        "Route and zones for Nav2", ("nav2_route.geojson", "zones.png", "zones.yaml"), _nav2
    ),
    "model": Export("Model, with what it has learned", ("model",), _model),
    "training": Export("Training configuration", ("train.toml", CORRECTIONS), _training),
}
