"""Exports of the studio: files in its folder that the command line and other tools read."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from pgm_places.errors import InputError
from pgm_places.io.atomic import write_text
from pgm_places.io.maps.label_image import save_labels
from pgm_places.io.places.check_table import CHECK_FILE, write_checks
from pgm_places.io.places.exports import export
from pgm_places.io.places.topology_files import NAMES_FILE, save_topology
from pgm_places.persistence.stored import save
from pgm_places.studio.desk import Desk
from pgm_places.teaching.paint import Paint
from pgm_places.teaching.taught import Taught

__all__ = ["EXPORTS", "Export", "write_export"]


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
    image = paint.save(desk.folder / "corrections.png", desk.grid)
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
    """The paint as training data: ``pgm-places train`` learns from it alone."""
    paint = _paint(desk)
    used = [name for name, n in paint.counts.items() if n]
    if len(used) < 2:
        raise InputError("paint at least two classes; there is nothing to tell apart yet")
    image = paint.with_classes(used).save(desk.folder / "training.png", desk.grid)
    quote = json.dumps  # a JSON string is a TOML string
    lines = [
        f"title = {quote(f'{desk.source.yaml_path.stem}, painted in the studio')}",
        "",
        "[labels]",
        f"names = [{', '.join(map(quote, used))}]",
        "",
        "[[train]]",
        f"map = {quote(str(desk.source.yaml_path.resolve()))}",
        f"labels = {quote(image.name)}",
        "",
        "[[methods]]",
        'name = "potts"',
    ]
    config = write_text(desk.folder / "train.toml", "\n".join(lines) + "\n")
    return [config, image, image.with_suffix(".yaml")]


def _model(desk: Desk) -> list[Path]:
    """What has been learned so far, paint included, for other maps."""
    folder = desk.folder / "model"
    record = {"taught": {"map": desk.source.yaml_path.name, "on_top_of": desk.model}}
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
