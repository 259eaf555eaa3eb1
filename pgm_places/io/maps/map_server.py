"""Maps in ROS's map_server format: a YAML file and an image, read exactly as Nav2 does."""

import json
import logging
import math
import re
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path, PureWindowsPath
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from pgm_places._arguments import public
from pgm_places._checks import frozen_copy
from pgm_places.errors import MapError, OutputError, nearest_name, quoted
from pgm_places.io.atomic import refuse_another_kind, write_bytes, write_text
from pgm_places.io.input_file import file_kind, read_bytes, user_path
from pgm_places.io.maps.map_pixels import (
    FREE_GREY,
    FREE_THRESH,
    NO_WALLS,
    OCCUPIED_GREY,
    OCCUPIED_THRESH,
    UNKNOWN_GREY,
    Compat,
    Fractions,
    MapPixels,
    Mode,
    PixelRules,
)
from pgm_places.io.maps.missing_walls import (
    ENOUGH_WALLS,
    lacks_walls,
    wall_share,
    wall_threshold,
    with_walls,
)
from pgm_places.io.maps.raster_image import (
    MAX_PIXELS,
    PICTURES,
    RasterImage,
    encoded,
    open_image,
)
from pgm_places.io.strict_yaml import MAX_BYTES, YamlFile, YamlValue, read_yaml
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, OccupancyGrid
from pgm_places.options import UnknownGrey, check_option

__all__ = ["KEPT_SUFFIX", "Fractions", "MapFile", "correct_map", "load_map", "save_map"]


KEPT_SUFFIX = ".orig"
"""Suffix of the original file; searches for maps ignore it."""

Correction: TypeAlias = Literal["free_thresh", "occupied_thresh", "image"]
_LONGEST_PATH = 200  # characters, in a message
_KEYS = ("image", "mode", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")


def correct_map(path: Path | str, corrections: Mapping[Correction, float | str]) -> Path:
    """Change thresholds or the image's name in a map's YAML file; returns the backup's path.

    All else, comments included, stays the same. The backup is the original file, with ``.orig``
    appended to its name; an existing one is not overwritten.
    """
    yaml_path, what = user_path(path, MapError), "the map description (YAML)"
    file = read_yaml(yaml_path, MapError, "map description")
    old = new = read_bytes(yaml_path, MapError, what, max_bytes=MAX_BYTES)
    for key, value in corrections.items():
        quoted = rb"[\"']?" if key == "image" else rb""
        stated = re.escape(file.text(key).encode())
        line = re.compile(
            rb"^(%s[ \t]*:[ \t]+)%s%s%s(?=\s|$)" % (key.encode(), quoted, stated, quoted),
            re.MULTILINE,
        )
        if len(line.findall(new)) != 1:
            raise MapError(
                f"{yaml_path}: the key {key} does not have its own line; set {key}: {value} by hand"
            )
        text = json.dumps(value, ensure_ascii=False).encode()  # a JSON string is a YAML string
        new = line.sub(lambda found, text=text: found[1] + text, new)  # type: ignore[misc]
    original = yaml_path.with_name(yaml_path.name + KEPT_SUFFIX)
    if original.exists() or original.is_symlink():
        raise OutputError(f"{original} exists and would be lost; move it away first")
    write_bytes(original, old)
    write_bytes(yaml_path, new)
    return original


_log = logging.getLogger(__name__)


@public
@dataclass(frozen=True, eq=False)
class MapFile:
    """A map file with its grid, occupancy and warnings.

    Parameters
    ----------
    grid : OccupancyGrid
        Free, occupied and unknown cells; row 0 is the bottom of the image.
    yaml_path, image_path : Path
    fractions : Fractions
        Shares of free, occupied and unknown cells.
    warnings : tuple of str
        Suspicious properties of the map, each with its remedy.
    occupancy : (H, W) int8
        Occupancy from 0 to 100 or -1, as map_server would publish it; in trinary mode the cells.
    rules : PixelRules
        Mode, thresholds and negation of the YAML file.
    unknown_value : int or "none", optional
        The grey that was read as unknown regardless of thresholds; "none" if only the thresholds
        count.
    wall_threshold : float, optional
        The ``occupied_thresh`` used instead of the file's, which would read walls as unknown.
    image_beside : str, optional
        The image in the YAML file's folder that was read instead of a missing one.
    """

    grid: OccupancyGrid
    yaml_path: Path
    image_path: Path
    fractions: Fractions
    warnings: tuple[str, ...]
    occupancy: NDArray[np.int8]
    rules: PixelRules
    unknown_value: UnknownGrey | None = None
    wall_threshold: float | None = None
    image_beside: str | None = None

    @property
    def corrections(self) -> dict[Correction, float | str]:
        """The values used to read the map, where they differ from the file's."""
        corrections: dict[Correction, float | str] = {}
        if self.unknown_value == UNKNOWN_GREY and self.rules.is_free(UNKNOWN_GREY):
            corrections["free_thresh"] = FREE_THRESH
        if self.wall_threshold is not None:
            corrections["occupied_thresh"] = self.wall_threshold
        if self.image_beside is not None:
            corrections["image"] = self.image_beside
        return corrections

    @property
    def name(self) -> str:
        """The map's name: of its file, or of its folder if the file is called ``map.yaml``."""
        path = self.yaml_path.absolute()
        return path.parent.name if path.stem == "map" and path.parent.name else path.stem


@public
def load_map(
    path: Path | str,
    *,
    compat: Compat = "nav2",
    unknown_value: UnknownGrey | None = None,
    max_pixels: int = MAX_PIXELS,
) -> MapFile:
    """The map that a YAML file describes.

    Parameters
    ----------
    path : Path
        The YAML file; ``image`` is found relative to its folder unless absolute.
    compat : {"nav2", "ros1"}
        The rules of current Nav2, or of ROS 1 and older Nav2 (mean of the colour channels and
        alpha, strict comparisons).
    unknown_value : int or "none", optional
        Grey from 0 to 255 that is unknown regardless of thresholds. By default, 205 if it is a map
        saver's unknown: in mode trinary, together with greys 0 and 254 and no other grey near it.
        With "none" only the thresholds count.
    max_pixels : int
        Largest width x height that is decoded.

    Raises
    ------
    MapError
        The YAML file or the image is missing, damaged, inconsistent or too large.
    ConfigError
        An option is invalid.
    """
    yaml_path = user_path(path, MapError)
    check_option("compat", Compat, compat)
    check_option("unknown_value", UnknownGrey | None, unknown_value)
    _refuse_picture(yaml_path)
    file = read_yaml(yaml_path, MapError, "map description", keys=_KEYS)
    if "values" in file and "image" not in file:
        raise file.fail(
            "these are the names of a label image; give the map's description (YAML), whose key "
            "'image' names its picture"
        )
    file.require(*(key for key in _KEYS if key != "mode"))
    warnings: list[str] = []
    rules = _rules(file, compat)
    resolution_m = file.number("resolution")
    x, y, yaw = _origin(file, warnings)
    try:  # before the image is decoded
        OccupancyGrid(np.zeros((1, 1), np.int8), resolution_m, (x, y), yaw)
    except MapError as error:
        raise file.fail(str(error)) from None
    image_path, image_beside = _image_path(file, warnings)
    opened = partial(open_image, image_path, MapError, max_pixels=max_pixels, lossy=True)
    with opened() as image:
        pixels = MapPixels.read(image, rules, unknown_value)
    warnings += pixels.suspicions(yaml_path)
    cells, threshold = pixels.cells, None
    may_lack = rules.mode == "trinary" and unknown_value != "none"  # other modes are for masks
    if may_lack and lacks_walls(cells, resolution_m):
        cells, threshold, message = _with_walls(pixels, yaml_path, opened, resolution_m)
        warnings = [line for line in warnings if line != NO_WALLS] + [message]
    grid = OccupancyGrid(cells, resolution_m, (x, y), yaw)
    occupancy = grid.cells if pixels.occupancy is None else frozen_copy(pixels.occupancy)
    for message in warnings:
        _log.info("%s: %s", yaml_path, message)
    return MapFile(
        grid,
        yaml_path,
        image_path,
        Fractions.of(cells),
        tuple(warnings),
        occupancy,
        rules,
        pixels.unknown_value,
        threshold,
        image_beside,
    )


def _with_walls(
    pixels: MapPixels,
    yaml_path: Path,
    opened: Callable[[], AbstractContextManager[RasterImage]],
    resolution_m: float,
) -> tuple[NDArray[np.int8], float | None, str]:
    """Cells with walls for a map that lacks them, the threshold used, and a warning."""
    rules, share = pixels.rules, wall_share(pixels.cells, resolution_m)
    lack = f"only {100 * share:.0f} % of the border of free space has a wall"
    with opened() as image:
        grey = wall_threshold(image, rules, pixels.cells, resolution_m)
    if grey is not None:
        changed = replace(rules, occupied_thresh=grey[1])
        with opened() as image:
            cells = MapPixels.read(image, changed, pixels.unknown_value).cells
        if wall_share(cells, resolution_m) >= ENOUGH_WALLS:
            return (
                cells,
                grey[1],
                f"{lack}, and walls look like grey {grey[0]}: read with occupied_thresh "
                f"{grey[1]:g} instead of {rules.occupied_thresh:g}. 'pgm-places doctor "
                f"{yaml_path.name} --fix' corrects the file; to rely on the file's thresholds, "
                'pass unknown_value = "none" (--unknown-value none)',
            )
    return (
        with_walls(pixels.cells),
        None,
        f"{lack}: unknown cells next to free ones are read as walls; to rely on the file's "
        'thresholds, pass unknown_value = "none" (--unknown-value none)',
    )


def _rules(file: YamlFile, compat: Compat) -> PixelRules:
    stated = file.text("mode") if "mode" in file else "trinary"
    mode = stated.lower()  # as Nav2 does
    if mode not in get_args(Mode):
        raise file.fail(
            f"mode {quoted(stated)} is unknown. {nearest_name(mode, list(get_args(Mode)))}"
        )
    free, occupied = file.number("free_thresh"), file.number("occupied_thresh")
    if not 0 <= free <= occupied <= 1 or (mode == "scale" and free == occupied):
        raise file.fail(
            "the thresholds must satisfy 0 <= free_thresh <= occupied_thresh <= 1 (and differ in "
            "mode scale), got "
            f"free_thresh {free:g} and occupied_thresh {occupied:g}"
        )
    # get_args(Mode) holds exactly the literals of Mode, which a checker cannot see
    return PixelRules(mode, file.flag("negate"), free, occupied, compat)  # type: ignore[arg-type]


def _origin(file: YamlFile, warnings: list[str]) -> tuple[float, float, float]:
    origin: YamlValue = file.value("origin")
    if not isinstance(origin, list) or len(origin) != 3:
        raise file.fail(f"origin must be three numbers [x, y, yaw], got {quoted(origin)}")
    x = file.as_number(origin[0], "origin x")
    y = file.as_number(origin[1], "origin y")
    yaw = file.as_number(origin[2], "origin yaw", allow_nan=True)
    if math.isnan(yaw):
        warnings.append(
            f"the yaw of the origin is {origin[2]} (some map savers write that); read as 0. Write "
            "a number into the YAML file if the map is rotated"
        )
        yaw = 0.0
    return x, y, yaw


def _refuse_picture(path: Path) -> None:
    """Refuse an image in place of a map description, with a hint to the description."""
    if path.suffix.lower() not in PICTURES:
        return
    candidates = [path.with_suffix(end) for end in (".yaml", ".yml")]
    descriptions = [str(each) for each in candidates if file_kind(each) == "file"]
    raise MapError(
        f"{path} is the picture of a map; give its description (YAML), "
        + (descriptions[0] if descriptions else f"which names it: 'image: {path.name}'")
    )


def _image_path(file: YamlFile, warnings: list[str]) -> tuple[Path, str | None]:
    """The image's path, and its name if it was missing but exists in the file's folder."""
    name = file.text("image")
    path = file.path.parent / name  # absolute if the name is
    if file_kind(path) == "file":
        return path, None
    last = PureWindowsPath(name).name  # after slashes of either kind
    if last and last != name and file_kind(file.path.parent / last) == "file":
        warnings.append(
            f"the image {quoted(name)} is missing; {quoted(last)} in the YAML file's folder is "
            "read instead; "
            f"'pgm-places doctor {file.path.name} --fix' corrects the file"
        )
        return file.path.parent / last, last
    where = str(path) if len(str(path)) <= _LONGEST_PATH else f"{str(path)[:_LONGEST_PATH]}..."
    raise MapError(
        f"{file.path}: its image {quoted(name)} is missing: no file {where}; correct the key "
        "'image' or put the image there"
    )


@public
def save_map(
    grid: OccupancyGrid, stem: Path | str, *, image_format: Literal["png", "pgm"] = "png"
) -> Path:
    """Write ``<stem>.yaml`` and its image as Nav2's map saver does in trinary mode.

    Greys 254 (free), 205 (unknown) and 0 (occupied) with ``free_thresh: 0.196``, so that current
    and older readers agree. Resolution and origin have all digits (Nav2's saver rounds the origin
    to millimetres).

    Returns
    -------
    Path
        The YAML file, which is written last: if it exists, its image does, too.

    Raises
    ------
    OutputError
        A file cannot be written, or a file of another kind exists there, such as label names.
    """
    target = Path(stem)
    if not target.name:
        raise OutputError(f"stem must be a path that ends in a name, got {str(stem)!r}")
    image_path = target.with_name(f"{target.name}.{image_format}")
    grey = np.full(grid.shape, UNKNOWN_GREY, np.uint8)
    grey[grid.cells == FREE] = FREE_GREY
    grey[grid.cells == OCCUPIED] = OCCUPIED_GREY
    refuse_another_kind(image_path.with_suffix(".yaml"), b"image: a\nresolution: 1\n")
    write_bytes(image_path, _encoded(grey[::-1], image_format))
    return write_description(image_path, grid, "trinary")


def write_description(image_path: Path, grid: OccupancyGrid, mode: Mode) -> Path:
    """Write the YAML file of a map's image next to it; returns its path."""
    x, y = grid.origin_xy_m
    name = json.dumps(image_path.name, ensure_ascii=False)  # a JSON string is a YAML string
    return write_text(
        image_path.with_suffix(".yaml"),
        f"image: {name}\n"
        f"mode: {mode}\n"
        f"resolution: {grid.resolution_m!r}\n"
        f"origin: [{x!r}, {y!r}, {grid.yaw_rad!r}]\n"
        "negate: 0\n"
        f"occupied_thresh: {OCCUPIED_THRESH}\n"
        f"free_thresh: {FREE_THRESH}\n",
    )


def _encoded(grey: NDArray[np.uint8], image_format: str) -> bytes:
    if image_format == "pgm":
        height, width = grey.shape
        return f"P5\n{width} {height}\n255\n".encode("ascii") + grey.tobytes()
    from PIL import Image

    return encoded(Image.fromarray(np.ascontiguousarray(grey)))


def as_grid(value: Any) -> OccupancyGrid | None:
    """The grid of a loaded map file, a labelled map, or a map's path; None for other values."""
    held = getattr(value, "grid", None)
    if isinstance(held, OccupancyGrid):
        return held
    is_path = isinstance(value, str | Path) and Path(value).suffix in (".yaml", ".yml")
    return load_map(value).grid if is_path else None
