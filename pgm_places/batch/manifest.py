"""What becomes of a map in a batch, and the manifest by which later runs know what is done."""

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from pgm_places._version import __version__
from pgm_places.batch.ready_model import LabelOptions, ReadyModel
from pgm_places.errors import InputError
from pgm_places.io.input_file import read_json, sha256_of
from pgm_places.io.output_set import has_all_files
from pgm_places.io.places.topology_files import NAMES_FILE
from pgm_places.options import option_values
from pgm_places.report.outputs import Outputs


@dataclass(frozen=True, kw_only=True)
class LabelledRow:
    """A map that is labelled.

    Parameters
    ----------
    name, map : str
        Its folder among the results, and its YAML file.
    kept : bool
        Whether an earlier run had labelled it.
    method : str
    n_places, n_connections : int
        Of the topological map.
    area_m2 : dict of str to float
        Per label.
    doubt : float or None
        Share of the area that is expected to be labelled wrongly; None if unknown.
    check_first : str
        The place with most area in doubt; empty where nothing is known.
    warnings : tuple of str
    seconds : float
        Wall clock of the run that labelled it.
    """

    name: str
    map: str
    kept: bool = False
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
        """Whether every value is of its kind: a manifest may be damaged."""
        numbers = [self.n_places, self.n_connections, self.seconds, *self.area_m2.values()]
        numbers += [] if self.doubt is None else [self.doubt]
        texts = [self.method, self.check_first, *self.area_m2, *self.warnings]
        return all(isinstance(item, int | float) for item in numbers) and all(
            isinstance(item, str) for item in texts
        )

    @property
    def figures(self) -> dict[str, Any]:
        """What the manifest keeps of it."""
        left_out = ("name", "map", "kept")
        return {key: value for key, value in asdict(self).items() if key not in left_out}

    @classmethod
    def of_figures(cls, name: str, path: str, figures: dict[str, Any]) -> "LabelledRow":
        """The row of a map that an earlier run had labelled."""
        warnings = tuple(figures.pop("warnings"))
        return cls(name=name, map=path, kept=True, warnings=warnings, **figures)


@dataclass(frozen=True)
class Failure:
    """A map that could not be labelled.

    Parameters
    ----------
    name, map : str
        Its folder among the results, and its YAML file.
    kind : str
        The class of the error, such as ``MapError``.
    message : str
        One line.
    """

    name: str
    map: str
    kind: str
    message: str


@dataclass(frozen=True)
class Elsewhere:
    """A map that another batch on the same folder is labelling."""


Outcome = LabelledRow | Failure | Elsewhere


MANIFEST_FILE = "manifest.json"
_FORMAT, _SCHEMA = "pgm-places labelled map", 1
_MAX_BYTES = 1 << 20


def made_from(
    folder: Path, yaml_path: Path, image_path: Path, model: ReadyModel, options: LabelOptions
) -> dict[str, Any]:
    """Everything that the labels and places of a map depend on, as plain data.

    The image's path is relative to the map's folder, so that a collection may be moved.
    """
    names = folder / NAMES_FILE  # the user's own, which the places are called by
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
    """The file: what :func:`made_from` says, what came out, and which files were written."""
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
    folder: Path, yaml_path: Path, model: ReadyModel, options: LabelOptions
) -> dict[str, Any] | None:
    """What came out when the map was labelled before; None where it has to be labelled (again).

    It is done where the manifest says that it was made from the same map, model, options and
    version, and where every file that was written then is still there, and all that are wanted.
    """
    record = _record(folder)
    if record is None:
        return None
    try:
        made, figures = record["made_from"], dict(record["figures"])
        wanted = {name for name, is_wanted in asdict(options.outputs).items() if is_wanted}
        left_out = {name for name, was in record.get("outputs", {}).items() if not was}
        image_path = yaml_path.parent / made["image"]
        now = made_from(folder, yaml_path, image_path, model, options)
    except (InputError, LookupError, TypeError, ValueError, AttributeError):
        return None  # damaged, or a map that is gone: labelling it will say what is wrong
    same = made == now and not wanted & left_out
    return figures if same and has_all_files(folder) else None


def labelled_row(folder: Path, name: str) -> LabelledRow | None:
    """What a folder's manifest says came out; None where it is no labelled map's, or damaged."""
    record = _record(folder)
    try:
        if record is not None:
            row = LabelledRow.of_figures(name, str(record["map"]), dict(record["figures"]))
            return row if row.is_sound else None
    except (LookupError, TypeError, ValueError, AttributeError):
        pass
    return None


def warnings_of(folder: Path) -> tuple[str, ...]:
    """The warnings that came when a map was labelled; none where that is not known any more."""
    row = labelled_row(folder, "")
    return () if row is None else row.warnings


def _record(folder: Path) -> dict[str, Any] | None:
    """The content of a folder's manifest; None where there is none, or it is no manifest."""
    path = folder / MANIFEST_FILE
    try:
        record = read_json(path, InputError, "a labelled map's manifest", max_bytes=_MAX_BYTES)
        known = (record["format"], record["schema"]) == (_FORMAT, _SCHEMA)
    except (InputError, LookupError, TypeError):
        return None
    return record if known else None
