"""Generated buildings in place of real ones, for when the real maps are not available."""

from collections.abc import Mapping

from pgm_places.errors import ConfigError
from pgm_places.experiment.config import ExperimentConfig
from pgm_places.experiment.config_changes import changed_config
from pgm_places.experiment.map_config import MapConfig
from pgm_places.options import plain_values

__all__ = ["STAND_INS", "with_stand_ins"]

STAND_INS: Mapping[str, int] = {
    "freiburg079": 79,
    "freiburg079_drawn": 80,
    "freiburg052": 52,
    "intel": 53,
    "cold_freiburg_seq2": 81,
    "cold_saarbrucken_seq1": 61,
    "cold_saarbrucken_seq2": 62,
    "cold_saarbrucken_seq3": 63,
    "cold_saarbrucken_seq4": 64,
}
"""The seed of the generated building that stands in for each folder of the real data."""

_PREFIX = "$PGM_PLACES_DATA/"


def with_stand_ins(config: ExperimentConfig) -> ExperimentConfig:
    """The same experiment on generated buildings, another one for each real one.

    A window that is open or 0 at its lower end becomes the left half of the building, any other
    window the right half.

    Raises
    ------
    ConfigError
        A map of the configuration has no stand-in.
    """
    changes = {
        part: [plain_values(_stand_in(item)) for item in getattr(config, part)]
        for part in ("train", "test")
    }
    return changed_config(config, changes)


def _stand_in(item: MapConfig) -> MapConfig:
    if item.map is None:
        return item
    folder = item.map.removeprefix(_PREFIX).partition("/")[0]
    if folder not in STAND_INS:
        raise ConfigError(
            f"no generated building stands in for {item.map!r}; set PGM_PLACES_DATA to the folder "
            "that holds the real maps"
        )
    half = None
    limits = [ends for axis, ends in item.window.items() if axis != "rows"]
    if limits:
        half = "right" if limits[0][0] else "left"
    return MapConfig(generated=STAND_INS[folder], half=half, building=item.building)  # type: ignore[arg-type]
