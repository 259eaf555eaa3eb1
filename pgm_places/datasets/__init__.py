"""Generated data: buildings, and robot-like maps of plans."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pgm_places.datasets.building import LABEL_NAMES as LABEL_NAMES
    from pgm_places.datasets.building import STYLES as STYLES
    from pgm_places.datasets.building import LabelledBuilding as LabelledBuilding
    from pgm_places.datasets.building import generate_building as generate_building
    from pgm_places.datasets.map_simulation import MapSimulation as MapSimulation
    from pgm_places.datasets.simulated_map import simulate_map as simulate_map

__all__ = [
    "LABEL_NAMES",
    "STYLES",
    "LabelledBuilding",
    "MapSimulation",
    "generate_building",
    "simulate_map",
]

_HOMES = {
    "LABEL_NAMES": "building",
    "STYLES": "building",
    "LabelledBuilding": "building",
    "MapSimulation": "map_simulation",
    "generate_building": "building",
    "simulate_map": "simulated_map",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
