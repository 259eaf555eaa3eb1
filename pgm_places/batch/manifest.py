"""The manifest of a labelled map: what it was made from, by which a run knows what is done."""

import json
import os
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from pgm_places._version import __version__
from pgm_places.batch.outcomes import LabelledRow
from pgm_places.batch.ready_model import LabelOptions, ReadyModel
from pgm_places.errors import InputError
from pgm_places.io.input_file import sha256_of
from pgm_places.io.output_set import has_all_files
from pgm_places.io.places.topology_files import NAMES_FILE
from pgm_places.io.text_file import read_json
from pgm_places.options import option_values
from pgm_places.report.outputs import Outputs

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
