"""File names in the folder of a labelled map, and those of earlier versions."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

from pgm_places.errors import InputError
from pgm_places.io.atomic import write_json
from pgm_places.io.input_file import read_record
from pgm_places.options import from_mapping, plain_values

PLACES_FILE, REGION_FILE, FEATURES_FILE = "places.json", "regions.png", "regions.geojson"
NAMES_FILE, CHECK_FILE = "place_names.yaml", "check.csv"
OVERVIEW_FILE = "overview.png"

DETAILS = "details"
"""The subfolder for files that programs read."""

SETTINGS_FILE, GATES_FILE = f"{DETAILS}/settings.json", f"{DETAILS}/gate_places.png"
SUMMARY_FILE, MANIFEST_FILE = f"{DETAILS}/summary.json", f"{DETAILS}/manifest.json"
EXPORTS_FILE = f"{DETAILS}/exports.json"
THUMBNAIL_FILE = f"{DETAILS}/thumbnail.png"

OLD_PLACES_FILE = "topology.json"
"""The former file of places; ``places.json`` then held the settings."""

OLD_FILES = (OLD_PLACES_FILE, Path(GATES_FILE).name)
"""Former names of files that are written with places."""

SETTINGS_FORMAT = "pgm-places settings of places"
_HEAD = 200


def probability_file(label: str) -> str:
    """The name of a label's image: 0 to 255 for a probability of 0 to 1, 0 outside free cells."""
    return f"{DETAILS}/probability_{label}.png"


def places_path(folder: Path) -> Path:
    """The file of a folder's places: ``places.json``, or ``topology.json`` of earlier versions."""
    path, old = folder / PLACES_FILE, folder / OLD_PLACES_FILE
    return old if old.exists() and (_is_settings(path) or not path.exists()) else path


def settings_path(folder: Path) -> Path:
    """The file of the settings of a folder's places."""
    path, old = folder / SETTINGS_FILE, folder / PLACES_FILE
    return old if not path.exists() and _is_settings(old) else path


def detail_path(folder: Path, name: str) -> Path:
    """A file in ``details``; if missing, in the folder itself, as in earlier versions."""
    path, old = folder / name, folder / Path(name).name
    return old if old.exists() and not path.exists() else path


def _is_settings(path: Path) -> bool:
    """Whether a ``places.json`` holds settings, as in earlier versions."""
    try:
        with path.open("rb") as file:
            return SETTINGS_FORMAT.encode() in file.read(_HEAD)
    except OSError:
        return False


FORMAT, SCHEMA = "pgm-places exports", 1
MAX_BYTES = 1 << 20


@dataclass(frozen=True)
class ExportRequest:
    """The parameters of an export of places, as in ``pgm-places export``.

    ``values`` are ``NAME=NUMBER``; ``keep_out`` names forbidden classes and places; ``map_yaml``
    and ``out`` are by default the labelled map and the folder of the places.
    """

    to: str
    values: tuple[str, ...] = ()
    robot_radius_m: float | None = None
    keep_out: tuple[str, ...] = ()
    map_yaml: str | None = None
    out: str | None = None

    def __post_init__(self) -> None:
        if self.keep_out and self.to not in ("nav2", "nav2-route"):
            raise InputError(
                f"the export {self.to!r} accepts no --keep-out; nav2 and nav2-route do"
            )
        if self.map_yaml and self.to not in ("nav2", "map"):
            raise InputError(f"the export {self.to!r} accepts no --map; nav2 and map do")

    def renamed(self, old: str, new: str) -> Self:
        """The request with another name for a place."""
        values = tuple(
            f"{new}={text.rpartition('=')[2]}" if text.rpartition("=")[0].strip() == old else text
            for text in self.values
        )
        keep_out = tuple(new if name == old else name for name in self.keep_out)
        return replace(self, values=values, keep_out=keep_out)


def record_exports(stage: Path, folder: Path, requests: Sequence[ExportRequest]) -> None:
    """Record exports for ``rename``, one per format and output folder."""
    new = {(request.to, request.out) for request in requests}
    others = (
        request for request in recorded_exports(folder) if (request.to, request.out) not in new
    )
    requests = [*others, *requests]
    record = {"format": FORMAT, "schema": SCHEMA, "exports": [*map(plain_values, requests)]}
    path = stage / EXPORTS_FILE
    path.parent.mkdir(exist_ok=True)
    write_json(path, record, indent=1)


def recorded_exports(folder: Path) -> list[ExportRequest]:
    """The recorded exports of a folder's places, the newest per format and output folder."""
    path = folder / EXPORTS_FILE
    if not path.exists():
        return []
    remedy = "delete it and export again"
    with read_record(
        path, "a record of exports", FORMAT, SCHEMA, max_bytes=MAX_BYTES, remedy=remedy
    ) as record:
        items = enumerate(record["exports"])
        return [from_mapping(ExportRequest, item, path=f"exports[{k}]") for k, item in items]
