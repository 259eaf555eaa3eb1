"""The maps to be measured: robots' maps by kind of building, and the maps of training."""

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from experiments.known_maps import WITH_HALLS, KnownMap, at_model_cells, real_maps
from pgm_places.errors import ConfigError
from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.map_server import load_map
from pgm_places.maps.labelled_map import LabelledMap

KINDS = Path(__file__).parent / "kinds.toml"
ROBOTS = "robots' maps"
GROUPS = ("robots", "floors", "real")
"""Maps of DATA/robots, drawn floors, and the other real maps."""

SURE = {"high": 1.0, "medium": 0.5, "low": 0.25}
"""What a map counts in the means, by how sure its labels are."""


class Declared(NamedTuple):
    """A map of DATA/robots as ``kinds.toml`` declares it; its weight is how sure its labels are."""

    kind: str
    weight: float
    building: str
    fold: int


def declared() -> dict[str, Declared]:
    """The maps of DATA/robots by name."""
    with KINDS.open("rb") as file:
        kinds = tomllib.load(file)
    return {
        name: Declared(kind, SURE[entry["sure"]], entry.get("building", name), entry["fold"])
        for kind, maps in kinds.items()
        for name, entry in maps.items()
    }


def robot_maps(data: Path) -> Iterator[tuple[KnownMap, float]]:
    """The maps of DATA/robots with the shipped models' cells, and their weights.

    Raises
    ------
    ConfigError
        A folder that ``kinds.toml`` does not declare, or the other way round.
    """
    found = {path.parent.name for path in (data / "robots").glob("*/map.yaml")}
    about = declared()
    if odd := sorted(found ^ set(about)):
        raise ConfigError(f"{KINDS} and the folders of {data / 'robots'} differ in {odd[0]!r}")
    for name, (kind, weight, building, _) in sorted(about.items(), key=lambda item: item[1].kind):
        grid = load_map(data / "robots" / name / "map.yaml").grid
        labels = load_labels(data / "robots" / name / "labels.png", WITH_HALLS.names, grid=grid)
        item = LabelledMap(grid, labels, None, name, building)
        yield KnownMap.of(at_model_cells(item), kind, ROBOTS), weight


def training_maps(data: Path, group: str) -> Iterator[tuple[KnownMap, float]]:
    """The drawn floors, or the other real maps: the shipped model has learned from both."""
    for known in real_maps(data):
        if (known.item.name.startswith(("office_", "school_"))) == (group == "floors"):
            yield known, 1.0


def chosen_maps(data: Path, group: str) -> Iterator[tuple[KnownMap, float]]:
    """The maps of one of the ``GROUPS``."""
    return robot_maps(data) if group == "robots" else training_maps(data, group)
