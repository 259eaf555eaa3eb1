"""File names in the folder of a labelled map, and those of earlier versions."""

from pathlib import Path

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
