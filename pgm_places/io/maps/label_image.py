"""Label images: ground truth or results on the map image's own raster, with a names file."""

from __future__ import annotations

import json
import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._arguments import public
from pgm_places._checks import label_raster
from pgm_places.errors import LabelError, OutputError, nearest_name
from pgm_places.graph.bands import bands_of_rows
from pgm_places.io.atomic import refuse_another_kind, write_bytes, write_text
from pgm_places.io.input_file import user_path
from pgm_places.io.maps import label_values as coding
from pgm_places.io.maps.label_values import LabelValues
from pgm_places.io.maps.raster_image import MAX_PIXELS, RasterImage, open_image, raster_png
from pgm_places.maps.occupancy_grid import OccupancyGrid

# Shares of labels off the free cells. Labels drawn by hand spill over walls even in the right
# orientation; in a wrong one they spill several times as much. Of 121 label images of real floors,
# flipped, the best fit has 2.7 % off.
_TIMES, _MARGIN = 4.0, 0.01

_TIMES_DOUBTED = 2.0

_MANY_OFF = 0.2

# No verdict on fewer labels off the free cells than this, or on labels on a smaller part of the
# free cells: strokes of paint lie on free cells in any orientation.
_FEWEST, _LEAST_COVERED = 20, 0.2


@dataclass(frozen=True)
class Orientation:
    """How well the labels of an image fit the free cells of its map, as it is and turned.

    ``on_free`` is the share of labelled pixels on free cells, ``best`` the largest such share over
    all turned and flipped images. ``what`` and ``remedy`` say how the image deviates from its best
    orientation and how to correct it; empty if it is best as it is.
    """

    on_free: float
    best: float = 0.0
    what: str = ""
    remedy: str = ""
    is_wrong: bool = False
    is_doubtful: bool = False

    @classmethod
    def of(cls, labelled: NDArray[np.bool_], free: NDArray[np.bool_]) -> Orientation:
        """From masks (H, W) of the labelled cells (at least one) and the free cells."""
        n_labelled = int(np.count_nonzero(labelled))
        n_on_free = int(np.count_nonzero(labelled & free))
        on_free, off = n_on_free / n_labelled, 1 - n_on_free / n_labelled
        if n_labelled - n_on_free < _FEWEST and off <= _MANY_OFF:
            return cls(on_free)
        shares = {
            words: float(np.count_nonzero(view & free[::-1]) / n_labelled)
            for words, view in _views(labelled[::-1])
        }
        (what, remedy), best = max(shares.items(), key=lambda item: item[1])
        if best <= on_free:
            return cls(on_free, on_free, is_doubtful=off > _MANY_OFF)
        covers = n_labelled >= _LEAST_COVERED * int(np.count_nonzero(free))
        is_wrong = covers and off >= _TIMES * (1 - best) + _MARGIN
        doubted = covers and off >= _TIMES_DOUBTED * (1 - best) + _MARGIN
        return cls(on_free, best, what, remedy, is_wrong, off > _MANY_OFF or doubted)


def _views(image: NDArray[np.bool_]) -> Iterator[tuple[tuple[str, str], NDArray[np.bool_]]]:
    """All rotations and flips of an image (row 0 on top) that keep its size, with their names."""
    yield ("upside down", "flip it vertically"), image[::-1]
    yield ("mirrored left to right", "flip it horizontally"), image[:, ::-1]
    yield ("turned by 180 degrees", "turn it by 180 degrees"), image[::-1, ::-1]
    if image.shape[0] == image.shape[1]:
        yield ("turned clockwise", "turn it by 90 degrees anticlockwise"), np.rot90(image)
        yield ("turned anticlockwise", "turn it by 90 degrees clockwise"), np.rot90(image, -1)
        turned = "turn it by 90 degrees clockwise, then flip it"
        yield ("mirrored at a diagonal", f"{turned} horizontally"), image.T
        yield ("mirrored at a diagonal", f"{turned} vertically"), image[::-1, ::-1].T


_log = logging.getLogger(__name__)


@public
def load_labels(
    image_path: Path | str,
    label_names: Sequence[str],
    *,
    grid: OccupancyGrid,
    names_path: Path | str | None = None,
    classes: Mapping[str, str] | None = None,
) -> NDArray[np.int16]:
    """(H, W) label of each cell of ``grid`` (row 0 at the bottom); -1 for no label.

    Parameters
    ----------
    image_path : Path
        PNG, PGM, BMP or TIFF of the size of the map's image. Greys are compared with the values of
        the names file; in an indexed image the palette's greys, or the indices if its palette has
        other colours. The colours of :func:`save_labels` mean the same values in any image, even if
        an editor has changed its palette. Fully transparent pixels have no label.
    label_names : sequence of str
        The labels to read; label ``k`` of the result is ``label_names[k]``.
    grid : OccupancyGrid
        The map that the labels belong to.
    names_path : Path, optional
        YAML file with ``values: {room: 77, ...}`` and ``ignore: 0`` (a value or a list); by
        default ``<image>.yaml`` in the image's folder, else ``labels.yaml`` there.
    classes : mapping of str to str, optional
        From the names of that file to label names; the key ``*`` stands for all other names. Names
        without an entry, or mapped to an empty string, have no label. Without a mapping the file's
        names must be the label names.

    Raises
    ------
    LabelError
        A file is missing or damaged, the sizes differ, a value has no name, the names are not
        ``label_names``, or the image is flipped or turned against the map.
    """
    path = user_path(image_path, LabelError)
    names = label_names if classes is None else coding.listed_names(path, names_path)
    values = coding.read_label_values(path, names, names_path)
    with open_image(path, LabelError, max_pixels=max(MAX_PIXELS, grid.cells.size)) as image:
        if image.shape != grid.shape:
            raise LabelError(
                f"{path}: the labels have {image.shape[0]} rows x {image.shape[1]} columns, the "
                f"map has {grid.shape[0]} x {grid.shape[1]}; draw the labels on the map's own image"
            )
        if image.is_deep:
            raise LabelError(
                f"{path}: 16-bit grey values, but label values are 0 to 255; save it with 8 bits"
            )
        raster = _raster(image, values)
    if classes is not None:
        raster = _translated(path, raster, names, classes, label_names)
    _check_orientation(path, raster, grid)
    return raster


@public
def save_labels(
    path: Path | str, raster: ArrayLike, label_names: Sequence[str]
) -> tuple[Path, Path]:
    """Write labels as an indexed PNG with a names file; ``load_labels`` reads them back.

    Parameters
    ----------
    path : Path
        The PNG; the names go to the same path with the suffix ``.yaml``.
    raster : (H, W) int
        Label of each cell, row 0 at the bottom; -1 for no label.
    label_names : sequence of str
        At most 255 names. Label ``k`` of K gets the index ``(k + 1) * (255 // K)``; no label is 0.

    Returns
    -------
    (Path, Path)
        The image and the names file.

    Raises
    ------
    OutputError
        A file cannot be written, or a file of another kind exists there, such as the map's own
        description.
    """
    target = Path(path)
    if not target.name:
        raise OutputError(f"path must end in the name of a file, got {str(path)!r}")
    names = [str(name) for name in label_names]
    values = coding.default_values(names)
    labels = label_raster("raster", raster, ("H", "W"), n_labels=len(names))
    table = np.zeros(len(names) + 1, np.uint8)  # the last entry is for label -1
    table[: len(names)] = list(values.values())
    stored = np.empty(labels.shape, np.uint8)
    # NumPy looks up by 64-bit copies of the numbers.
    for rows in bands_of_rows((labels.shape[0], labels.shape[1])):
        stored[rows] = table[labels[rows]]
    names_path = target.with_suffix(".yaml")
    # A JSON string is a YAML string.
    quoted = {json.dumps(name, ensure_ascii=False): value for name, value in values.items()}
    listed = "".join(f"  {name}: {value}\n" for name, value in quoted.items())
    text = f"ignore: 0\nvalues:\n{listed}"
    refuse_another_kind(names_path, text.encode())  # before the image is written
    write_bytes(target, _indexed_png(stored, values))
    write_text(names_path, text)
    return target, names_path


def _raster(image: RasterImage, values: LabelValues) -> NDArray[np.int16]:
    height = image.shape[0]
    raster = np.empty(image.shape, np.int16)
    counts = np.zeros(256, np.int64)
    by_index = image.is_indexed and not coding.colours_are_wanted(image, values)
    table = values.table()
    for strip in image.strips(indices=by_index):
        stored = coding.values_of_colours(strip, values, image)
        labels = table[stored]
        opaque = stored
        if strip.alpha is not None:
            labels[strip.alpha == 0] = -1
            opaque = stored[strip.alpha > 0]
        counts += np.bincount(opaque.ravel(), minlength=256)
        raster[height - strip.row - len(stored) : height - strip.row] = labels[::-1]
    _check_values(image.path, counts, values)
    return raster


def _translated(
    path: Path,
    raster: NDArray[np.int16],
    names: Sequence[str],
    classes: Mapping[str, str],
    label_names: Sequence[str],
) -> NDArray[np.int16]:
    """A file's labels, translated by ``classes``."""
    wanted = [str(name) for name in label_names]
    to = [classes.get(name, classes.get("*", "")) for name in names]
    unknown = sorted({*to} - {"", *wanted})
    if unknown:
        raise LabelError(
            f"{path}: 'classes' translates to {unknown[0]!r}, not a configured label. "
            f"{nearest_name(unknown[0], wanted)}"
        )
    # The entry after the last serves -1, "no label".
    table = [wanted.index(name) if name else -1 for name in to]
    return np.array([*table, -1], np.int16)[raster]


def _check_values(path: Path, counts: NDArray[np.int64], values: LabelValues) -> None:
    unnamed = [value for value in np.flatnonzero(counts) if value not in values.known]
    if unnamed:
        shown = ", ".join(f"{value} ({counts[value]} pixels)" for value in unnamed[:8])
        more = f" and {len(unnamed) - 8} more" if len(unnamed) > 8 else ""
        raise LabelError(
            f"{path}: grey values without a name: {shown}{more}. {values.path} names "
            f"{values.listed()}; add them under 'values', or under 'ignore' if they are not labels"
        )


def _check_orientation(path: Path, raster: NDArray[np.int16], grid: OccupancyGrid) -> None:
    labelled = raster >= 0
    if not labelled.any():
        raise LabelError(f"{path}: no pixel has a label; are all its values under 'ignore'?")
    orientation = Orientation.of(labelled, grid.free)
    shares = (
        f"{100 * orientation.on_free:.1f} % of the labelled pixels lie on free cells of the map"
    )
    if orientation.remedy:
        shares += f", the other way {100 * orientation.best:.1f} % would"
    if orientation.is_wrong:
        raise LabelError(
            f"{path}: the label image is {orientation.what}: only {shares}; {orientation.remedy}"
        )
    if orientation.is_doubtful:
        hint = (
            f"is it {orientation.what}, or do the labels "
            if orientation.remedy
            else "do the labels "
        )
        _log.warning("%s: only %s; %sbelong to another map?", path, shares, hint)


def _indexed_png(stored: NDArray[np.uint8], values: dict[str, int]) -> bytes:
    from PIL import Image

    palette = coding.palette_of(list(values.values()))
    size = (stored.shape[1], stored.shape[0])
    # Row 0 of an image is its top: -1 reads the raster, which is not copied, from its end.
    picture = Image.frombuffer("P", size, stored, "raw", "P", 0, -1)
    picture.putpalette(palette.ravel().tolist())
    return raster_png(picture)
