"""The maps to be measured: robots' maps by kind of building, and the maps of training."""

import tomllib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

from experiments.known_maps import WITH_HALLS, KnownMap, at_model_cells, real_maps
from pgm_places.errors import ConfigError
from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.map_server import load_map
from pgm_places.maps.labelled_map import LabelledMap

KINDS = Path(__file__).parent / "kinds.toml"
ROBOTS = "robots' maps"
GROUPS = ("robots", "unseen", "floors", "real")
"""What can be asked for: maps of DATA/robots, those of them whose building is in no training, drawn
floors, and the other real maps."""

SURE = {"high": 1.0, "medium": 0.5, "low": 0.25}
"""What a map counts in the means, by how sure its labels are."""


def declared() -> dict[str, tuple[str, float, str]]:
    """Kind, weight and building of each map of DATA/robots, as ``kinds.toml`` declares them."""
    return {
        name: (kind, SURE[about["sure"]], about.get("building", name))
        for kind, name, about in _entries()
    }


def trained_maps() -> frozenset[str]:
    """The maps of DATA/robots that the shipped networks were trained on."""
    return frozenset(name for _, name, about in _entries() if about.get("trained", False))


def unseen_maps() -> frozenset[str]:
    """The maps of DATA/robots of buildings that no shipped network was trained on."""
    about = declared()
    trained = {about[name][2] for name in trained_maps()}
    return frozenset(name for name, (_, _, building) in about.items() if building not in trained)


def _entries() -> list[tuple[str, str, dict[str, Any]]]:
    """Kind, name and entry of each map in ``kinds.toml``."""
    with KINDS.open("rb") as file:
        kinds = tomllib.load(file)
    return [(kind, name, about) for kind, maps in kinds.items() for name, about in maps.items()]


def robot_maps(data: Path, only: Collection[str] | None = None) -> Iterator[tuple[KnownMap, float]]:
    """The maps of DATA/robots, or ``only`` some, with the shipped models' cells, and their weights.

    Raises
    ------
    ConfigError
        A folder that ``kinds.toml`` does not declare, or the other way round.
    """
    found = {path.parent.name for path in (data / "robots").glob("*/map.yaml")}
    about = declared()
    if odd := sorted(found ^ set(about)):
        raise ConfigError(f"{KINDS} and the folders of {data / 'robots'} differ in {odd[0]!r}")
    for name, (kind, weight, building) in sorted(about.items(), key=lambda item: item[1][0]):
        if only is not None and name not in only:
            continue
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
    if group in ("robots", "unseen"):
        return robot_maps(data, unseen_maps() if group == "unseen" else None)
    return training_maps(data, group)
