"""Exports of the studio: files that the command line and other tools read, and where they may go.

The page names a folder, so a page that got hold of the address could, too. It may name what its
user has named on the command line or what lies below the folder that the studio was started in,
nothing hidden, and no export takes the place of a file that the studio was given.
"""

import json
import os
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from pgm_places.errors import InputError
from pgm_places.experiment.config import NO_MODEL
from pgm_places.io.atomic import write_text
from pgm_places.io.maps.label_image import save_labels
from pgm_places.io.places.exports import export
from pgm_places.io.places.result_folder import CHECK_FILE, NAMES_FILE
from pgm_places.io.places.topology_files import save_topology, write_checks
from pgm_places.options import Options, option_values, plain_values
from pgm_places.persistence.stored import save
from pgm_places.spaces.entered_options import EnteredOptions
from pgm_places.studio.desk import Desk
from pgm_places.teaching.lesson import OF_PAINT_ALONE, TeachingOptions
from pgm_places.teaching.paint import Paint
from pgm_places.trained import NAMES

LONGEST = 1000
"""Characters of a path from the page."""

MOST_OFFERED = 60
"""Folders that are offered by name; any other can be typed."""


@dataclass(frozen=True)
class ExportFolders:
    """Where the exports of a studio may go.

    Parameters
    ----------
    working : Path
        The folder that the studio was started in; names are told from there.
    told : sequence of Path
        Further folders, from the command line.
    given : frozenset of Path
        Files and folders that the studio reads: nothing is written there.
    """

    working: Path
    told: tuple[Path, ...] = ()
    given: frozenset[Path] = frozenset()

    @classmethod
    def started_here(cls, told: Sequence[Path] = (), given: Iterable[Path] = ()) -> Self:
        """Those of a studio that is started in the current folder."""
        return cls(
            Path.cwd().resolve(),
            tuple(path.resolve() for path in told),
            frozenset(path.resolve() for path in given),
        )

    def chosen(self, text: str, own: Path) -> Path:
        """The folder of that name, which need not be there yet; the desk's ``own`` for none.

        Raises
        ------
        InputError
            The page may not have files written there.
        """
        if not text.strip():
            return own
        if len(text) > LONGEST or not text.isprintable():
            raise InputError("the name of a folder is too long, or has characters that none has")
        if text.startswith("~"):
            raise InputError(f"write {text!r} out: '~' is not understood here")
        try:
            folder = (self.working / text).resolve()  # links are followed before it is judged
            in_circles = any(path.is_symlink() for path in (folder, *folder.parents))
        except (OSError, RuntimeError, ValueError):
            in_circles = True  # Python before 3.13 raises, later ones leave the link as it is
        if in_circles:
            raise InputError(f"{text!r} cannot be a folder")
        if folder == own.resolve():
            return own
        root = next((root for root in self.roots(own) if folder.is_relative_to(root)), None)
        if root is None:
            raise InputError(
                f"exports go below {self.working} or into a folder given with --export-to; "
                f"{folder} is neither"
            )
        if any(part.startswith(".") for part in folder.relative_to(root).parts):
            raise InputError(f"{text!r} is hidden; choose a folder without a dot before its name")
        if folder.exists() and not folder.is_dir():
            raise InputError(f"{text!r} is a file; name a folder")
        return folder

    def roots(self, own: Path) -> tuple[Path, ...]:
        """The folders below which files may be written; never all of the disk."""
        found = (own.resolve(), *self.told, self.working)
        return tuple(root for root in found if root.parent != root or root in self.told)

    def check_free(self, targets: Iterable[Path], further: Iterable[Path] = ()) -> None:
        """Raise InputError where one of the targets is what the studio was given, or holds it."""
        given = {*self.given, *(path.resolve() for path in further)}
        for target in targets:
            whole = target.resolve()
            if any(item == whole or item.is_relative_to(whole) for item in given):
                raise InputError(
                    f"{target} is what the studio was started with; choose another folder"
                )

    def offered(self, own: Path) -> list[str]:
        """Names of folders to choose from: the desk's own, those told, and those at hand."""
        found = [self.name_of(own), *map(self.name_of, self.told)]
        try:
            inside = sorted(path for path in self.working.iterdir() if path.is_dir())
        except OSError:
            inside = []
        found += [path.name for path in inside if not path.name.startswith(".")]
        return list(dict.fromkeys(found))[:MOST_OFFERED]

    def name_of(self, folder: Path) -> str:
        """A folder as its user would call it: from the working folder where it lies below it."""
        whole = folder.resolve()
        below = whole.is_relative_to(self.working) and whole != self.working
        return str(whole.relative_to(self.working) if below else whole)


CORRECTIONS = "corrections.png"


@dataclass(frozen=True)
class Export:
    """A kind of export.

    Parameters
    ----------
    words : str
        What it is, for the browser.
    files : tuple of str
        The names of what it always writes.
    write : callable
        Writes it of a desk into a folder; the paths.
    more : tuple of str
        The names of what it may write beside that.
    """

    words: str
    files: tuple[str, ...]
    write: Callable[[Desk, Path], list[Path]]
    more: tuple[str, ...] = ()

    def targets(self, folder: Path) -> list[Path]:
        """All that it may write into a folder."""
        return [folder / name for name in (*self.files, *self.more)]


def exports_record(desk: Desk, folders: ExportFolders, chosen: str = "") -> dict[str, Any]:
    """A folder, and of each export what it writes, whether it is there, and older than the paint.

    As plain data for the browser.

    Raises
    ------
    InputError
        Nothing may be written into the chosen folder.
    """
    folder = folders.chosen(chosen, desk.folder)
    painted_ns = _written_ns(desk.painting.journal.path) or 0
    items = []
    for name, item in EXPORTS.items():
        written = [_written_ns(folder / file) for file in item.files]
        there = [each for each in written if each is not None]
        items.append(
            {
                "name": name,
                "words": item.words,
                "files": list(item.files),
                "there": [path.name for path in item.targets(folder) if path.exists()],
                "written": bool(there),
                "older": bool(there) and min(there) < painted_ns,
            }
        )
    return {
        "folder": str(folder.resolve()),
        "name": folders.name_of(folder),
        "own": folder == desk.folder,
        "offered": folders.offered(desk.folder),
        "items": items,
    }


def _written_ns(path: Path) -> int | None:
    """When a file, or the newest in a folder, was written; None where there is none."""
    try:
        times = [each.stat().st_mtime_ns for each in (path.iterdir() if path.is_dir() else (path,))]
    except OSError:
        return None
    return max(times, default=None)


def write_export(
    desk: Desk,
    name: str,
    folders: ExportFolders | None = None,
    *,
    chosen: str = "",
    replaced: Collection[str] | None = None,
) -> list[Path]:
    """Write an export into the desk's folder, or into a chosen one; the paths.

    Of files that lie there already, only those ``replaced`` are written over, if that is given.

    Raises
    ------
    InputError
        There is no such export, or nothing to write yet; nothing may be written there.
    OutputError
        A file cannot be written.
    """
    if name not in EXPORTS:
        raise InputError(f"there is no export {name[:40]!r}; there are {', '.join(EXPORTS)}")
    item = EXPORTS[name]
    folders = folders or ExportFolders.started_here()
    folder = folders.chosen(chosen, desk.folder)
    targets = item.targets(folder)
    folders.check_free(targets, [desk.source.yaml_path, desk.source.image_path])
    there = [target.name for target in targets if target.exists()]
    new = next((name for name in there if replaced is not None and name not in replaced), None)
    if new is not None:
        raise InputError(f"{new} has come there meanwhile; look at the list again")
    return item.write(desk, folder)


def _labels(desk: Desk, folder: Path) -> list[Path]:
    taught = desk.answer
    return [*save_labels(folder / "labels.png", taught.labels, taught.label_names)]


def _corrections(desk: Desk, folder: Path) -> list[Path]:
    paint = _paint(desk)
    image = paint.save(folder / CORRECTIONS, desk.grid)
    shapes = paint.save(folder / "corrections.geojson", desk.grid)
    return [image, image.with_suffix(".yaml"), shapes]


def _places(desk: Desk, folder: Path) -> list[Path]:
    taught = desk.answer
    written = save_topology(folder, taught.topology)
    if taught.checks:
        written.append(write_checks(folder / CHECK_FILE, taught.topology))
    own = {}
    for (x, y), name in desk.painting.names.items():
        region = taught.topology.region_at(x, y)
        if region is not None and region.name == name:
            own[region.id] = name
    if own:
        lines = (f"{key}: {json.dumps(own[key], ensure_ascii=False)}\n" for key in sorted(own))
        written.append(write_text(folder / NAMES_FILE, "".join(lines)))
    return written


def _nav2(desk: Desk, folder: Path) -> list[Path]:
    topology = desk.answer.topology
    kinds = ("nav2-route", "zones")
    return [path for kind in kinds for path in export(topology, kind, folder)]


def _training(desk: Desk, folder: Path) -> list[Path]:
    """A configuration by which ``pgm-places train`` learns what the studio has learned."""
    names = [name for name, n in _paint(desk).counts.items() if n]
    title = f"{desk.source.yaml_path.stem}, painted in the studio"
    written = write_training([desk], folder, title, names, beside=True)
    return [written[0], *_corrections(desk, folder)]


def write_training(
    desks: Sequence[Desk],
    folder: Path,
    title: str,
    painted: Collection[str],
    *,
    beside: bool = False,
) -> list[Path]:
    """Write a configuration that teaches one model the paint of all these maps, and the paint.

    ``painted`` are the classes that are painted anywhere. The desks need not be open. The paint is
    written into each desk's folder, or ``beside`` the configuration.

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
    names = list(dict.fromkeys(name for desk in desks for name in desk.painting.classes.names))
    paths = [(folder if beside else desk.folder) / CORRECTIONS for desk in desks]
    images = [
        _paint(desk).with_classes(names).save(path, desk.grid)
        for desk, path in zip(desks, paths, strict=True)
    ]
    text = "\n".join(
        [
            *_keys({"title": title, "base_model": _base_model(first)}),
            *_table("[labels]", {"names": names}),
            *_table("[teaching]", options),
            *_tables_of_rules(first),
            *(
                line
                for desk, path in zip(desks, paths, strict=True)
                for line in _table("[[train]]", _source(desk, path, folder))
            ),
            "",
        ]
    )
    return [write_text(folder / "train.toml", text), *images]


def _rules(desk: Desk) -> dict[str, Options]:
    """The rules of the model, by their table in a configuration."""
    loaded = desk.loaded
    return {
        "topology": desk.rules,
        "entered": EnteredOptions() if loaded is None else loaded.entered,
    }


def _tables_of_rules(desk: Desk) -> Iterator[str]:
    """The rules that are not the defaults, as tables of a configuration."""
    for name, options in _rules(desk).items():
        if options != type(options)():
            yield from _table(f"[{name}]", option_values(options))


def _source(desk: Desk, corrections: Path, folder: Path) -> dict[str, Any]:
    """What a configuration in a folder says of a painted map."""
    found: dict[str, Any] = {
        "map": str(desk.source.yaml_path.resolve()),
        "corrections": os.path.relpath(corrections.resolve(), folder.resolve()),
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


def _model(desk: Desk, folder: Path) -> list[Path]:
    """What has been learned so far, paint included, for other maps."""
    if desk.answer.labeler is desk.labeler:
        raise InputError("nothing has been taught yet; press 'Teach from this' first")
    record = {
        "taught": {"map": desk.source.yaml_path.name, "on_top_of": desk.model},
        "config": plain_values(_rules(desk)),
    }
    return [save(desk.answer.labeler, folder / "model", record=record)]


def _paint(desk: Desk) -> Paint:
    if not desk.painting.n_painted:
        raise InputError("nothing is painted yet")
    return Paint(desk.painting.labels.copy(), desk.painting.classes.names)


EXPORTS = {
    "labels": Export("Label image", ("labels.png", "labels.yaml"), _labels),
    "corrections": Export(
        "Corrections", (CORRECTIONS, "corrections.yaml", "corrections.geojson"), _corrections
    ),
    "places": Export(
        "Places",
        ("places.json", "regions.png", "regions.geojson"),
        _places,
        more=(CHECK_FILE, NAMES_FILE),
    ),
    "nav2": Export(
        "Route and zones for Nav2", ("nav2_route.geojson", "zones.png", "zones.yaml"), _nav2
    ),
    "model": Export("Model, with what it has learned", ("model",), _model),
    "training": Export(
        "Training configuration",
        ("train.toml", CORRECTIONS),
        _training,
        more=("corrections.yaml", "corrections.geojson"),
    ),
}
