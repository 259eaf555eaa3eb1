"""Exports of the studio: files in its folder that the command line and other tools read."""

import json
from collections.abc import Callable, Mapping
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

__all__ = ["EXPORTS", "Export", "write_export"]

CORRECTIONS = "corrections.png"


@dataclass(frozen=True)
class Export:
    """A kind of export.

    Parameters
    ----------
    words : str
        What it is, for the browser.
    write : callable
        Writes it into the desk's folder; the paths.
    """

    words: str
    write: Callable[[Desk], list[Path]]


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
    paint, alone = _paint(desk), desk.labeler is None
    used = [name for name, n in paint.counts.items() if n]
    if alone and len(used) < 2:
        raise InputError("paint at least two classes; there is nothing to tell apart yet")
    options = option_values(TeachingOptions())
    if alone:
        options = {name: options[name] for name in OF_PAINT_ALONE}
    rules = option_values(desk.rules)
    if desk.rules == TopologyOptions():
        rules = {}
    source: dict[str, Any] = {
        "map": str(desk.source.yaml_path.resolve()),
        "corrections": CORRECTIONS,
    }
    if desk.source.unknown_value is not None:
        source["unknown_value"] = desk.source.unknown_value
    text = "\n".join(
        [
            *_keys(
                {
                    "title": f"{desk.source.yaml_path.stem}, painted in the studio",
                    "base_model": _base_model(desk),
                }
            ),
            *_table("[labels]", {"names": list(desk.painting.classes.names)}),
            *_table("[teaching]", options),
            *(_table("[topology]", rules) if rules else ()),
            *_table("[[train]]", source),
            "",
        ]
    )
    return [write_text(desk.folder / "train.toml", text), *_corrections(desk)]


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
    "labels": Export("Label image", _labels),
    "corrections": Export("Corrections (image and GeoJSON)", _corrections),
    "places": Export("Places (GeoJSON, topology)", _places),
    "nav2": Export("Nav2 (route and zones)", _nav2),
    "model": Export("Model, with what it has learned", _model),
    "training": Export("Training configuration", _training),
}
