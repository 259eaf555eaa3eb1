"""Data that the package makes: generated buildings."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pgm_places.datasets.building import LABEL_NAMES as LABEL_NAMES
    from pgm_places.datasets.building import STYLES as STYLES
    from pgm_places.datasets.building import LabelledBuilding as LabelledBuilding
    from pgm_places.datasets.building import generate_building as generate_building
    from pgm_places.datasets.tiling import building_tiled as building_tiled

__all__ = ["LABEL_NAMES", "STYLES", "LabelledBuilding", "building_tiled", "generate_building"]

_HOMES = {
    "LABEL_NAMES": "building",
    "STYLES": "building",
    "LabelledBuilding": "building",
    "building_tiled": "tiling",
    "generate_building": "building",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
