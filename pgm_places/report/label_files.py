"""A labelled map as files: the label image, probabilities, a picture and a summary."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import ROWS_AT_ONCE
from pgm_places.errors import InputError, OutputError
from pgm_places.io.atomic import write_bytes, write_json
from pgm_places.io.input_file import read_json
from pgm_places.io.maps.label_image import save_labels
from pgm_places.io.maps.map_server import MapFile
from pgm_places.io.maps.raster_image import raster_png
from pgm_places.io.places.number_image import probability_file
from pgm_places.labelers.label_map import LabelledPlaces
from pgm_places.report.drawing import Packing
from pgm_places.report.outputs import Outputs

SUMMARY_FILE = "summary.json"
MAX_BYTES = 64 << 20


def write_labels(
    result: LabelledPlaces,
    source: MapFile,
    folder: Path,
    *,
    packing: Packing | None = None,
    outputs: Outputs | None = None,
) -> list[Path]:
    """Write everything that ``pgm-places label`` promises; the paths written.

    ``labels.png`` and ``labels.yaml`` on the map image's own raster; ``probability_<label>.png``
    per label (0 to 255 for 0 to 1, 0 outside the free cells); ``overview.png`` to look at;
    ``summary.json`` for programs. ``outputs`` leaves some out.
    """
    outputs = outputs or Outputs()
    for name in result.label_names:
        if "/" in name or "\\" in name or name.startswith("."):
            raise OutputError(f"label {name!r} cannot be part of a file name; rename it")
    labels_path = folder / "labels.png"
    save_labels(labels_path, result.labels, result.label_names)
    written = [labels_path, folder / "labels.yaml"]
    if outputs.probabilities:
        written += _write_probabilities(result, folder)
    if outputs.pictures:
        written.append(_write_overview(result, source, folder, packing or Packing()))
    record = {
        "map": str(source.yaml_path),
        "method": result.method,
        "status": str(result.labeling.status),
        "status_meaning": result.labeling.status.meaning,
        "area_m2": result.shares(),
        "unentered_m2": 0.0 if result.unentered is None else result.unentered.area_m2,
        "score": result.labeling.score,
        "bound": result.labeling.bound,
        "warnings": [*source.warnings, *result.warnings],
    }
    return [*written, write_json(folder / SUMMARY_FILE, record, indent=2, allow_nan=True)]


def _write_overview(
    result: LabelledPlaces, source: MapFile, folder: Path, packing: Packing
) -> Path:
    from pgm_places.report.map_pictures import overview

    drawing = overview(
        result.grid,
        result.labels,
        result.label_names,
        beliefs=result.labeling.beliefs,
        layout=result.layout,
        title=f"{source.name}: {result.method}",
    )
    return packing.write(folder / "overview.png", drawing)


def labelled_map(folder: Path) -> Path | None:
    """The map that was labelled into a folder; None where that is unknown or it has gone.

    A relative path is looked up where the command runs, as it was when the map was labelled.
    """
    path = folder / SUMMARY_FILE
    if not path.is_file():
        return None
    record = read_json(path, InputError, "a summary of 'pgm-places label'", max_bytes=MAX_BYTES)
    name = record.get("map") if isinstance(record, dict) else None
    path_of_map = Path(name) if isinstance(name, str) else None
    return path_of_map if path_of_map is not None and path_of_map.is_file() else None


def _write_probabilities(result: LabelledPlaces, folder: Path) -> list[Path]:
    from PIL import Image

    beliefs = result.labeling.beliefs
    if beliefs is None:
        return []
    written = []
    for k, name in enumerate(result.label_names):
        raster = result.on_map(_in_bytes(beliefs[:, k]), 0)
        size = (raster.shape[1], raster.shape[0])
        # Row 0 of an image is its top: -1 reads the raster, which is not copied, from its end.
        picture = Image.frombuffer("L", size, raster, "raw", "L", 0, -1)
        path = folder / probability_file(name)
        written.append(write_bytes(path, raster_png(picture)))
    return written


def _in_bytes(shares: NDArray[np.floating[Any]]) -> NDArray[np.uint8]:
    """(N,) shares from 0 to 1 as 0 to 255, piece by piece: temporary copies take four times it."""
    levels = np.empty(len(shares), np.uint8)
    for first in range(0, len(shares), ROWS_AT_ONCE):
        some = slice(first, first + ROWS_AT_ONCE)
        levels[some] = np.round(255 * shares[some])
    return levels
