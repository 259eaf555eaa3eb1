"""Parameters that several commands take, and the maps, label images and places that they name."""

from contextlib import suppress
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import pgm_places as pp
from pgm_places.cli.declarations import Argument, Option
from pgm_places.errors import InputError
from pgm_places.options import UnknownGrey, Whole

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pgm_places.io.maps.map_server import MapFile
    from pgm_places.options import UnknownGrey
    from pgm_places.progress import Progress


Config = Annotated[Path, Argument(metavar="CONFIG.toml", help="Experiment configuration (TOML).")]
Places = Annotated[Path, Argument(metavar="DIR", help="Folder written by label or topology.")]
Place = Annotated[str, Argument(metavar="PLACE", help="Name or id of a place.")]

Out = Annotated[Path, Option("--out", "-o", help="Folder for the results; created if needed.")]
Cache = Annotated[
    Path | None, Option(metavar="DIR", help="Cache the features of training maps in this folder.")
]
Threads = Annotated[
    Whole | None, Option("--threads", help="Number of threads; all cores by default.")
]
Model = Annotated[
    str, Option("--model", "-m", help="Folder written by 'train', or the name of a shipped model.")
]
Method = Annotated[str | None, Option(help="Method of the model; its last one by default.")]
UnknownValue = Annotated[
    UnknownGrey | None,
    Option(
        metavar="GREY|none",
        help="Grey value to read as unknown; none to rely on the thresholds alone; by default "
        "205 if the file looks like a map saver's.",
    ),
]
Quiet = Annotated[bool, Option("--quiet", "-q", help="Hide progress.")]
Force = Annotated[
    bool,
    Option(
        "--force", help="Overwrite files that pgm-places did not write, or that were changed since."
    ),
]
ForceMisfit = Annotated[
    bool,
    Option(
        "--force",
        help="Label a drive that does not fit its map; overwrite files that pgm-places did not "
        "write, or that were changed since.",
    ),
]


def read_map(path: Path, unknown_value: "UnknownGrey | None", progress: "Progress") -> "MapFile":
    """A map, with its warnings on standard error."""
    loaded = pp.load_map(path, unknown_value=unknown_value)
    for message in loaded.warnings:
        progress.warn(message)
    return loaded


def read_labels(
    path: Path, grid: "pp.OccupancyGrid", names_path: Path | None = None
) -> "tuple[tuple[str, ...], NDArray[np.int16]]":
    """The label names of a label image, and the label of each cell."""
    from pgm_places.io.maps.label_values import listed_names

    names = listed_names(path, names_path)
    return names, pp.load_labels(path, names, grid=grid, names_path=names_path)


def place_key(text: str) -> int | str:
    """A place by its id or name."""
    return int(text) if text.isdecimal() else text


def metres(text: str) -> float:
    """The X of a position."""
    with suppress(ValueError):
        if isfinite(x := float(text)):
            return x
    raise InputError(f"X must be a finite number, got {text!r}")
