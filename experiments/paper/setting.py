"""The data of an experiment: real data, or its substitute."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pgm_places.errors import ConfigError
from pgm_places.experiment.config import ExperimentConfig, load_config
from pgm_places.experiment.config_changes import changed_config
from pgm_places.experiment.experiment import DATA_VARIABLE, Experiment
from pgm_places.experiment.source_config import MapConfig
from pgm_places.io.maps.map_server import load_map
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.options import plain_values
from pgm_places.progress import Progress, Silent
from pgm_places.simulation import generate_building

AS_PRINTED, BY_DEFAULT = "as printed", "by default"
WAYS: Mapping[str, str | None] = {AS_PRINTED: "paper", BY_DEFAULT: None}
"""The preset of each way in which the sections are run."""

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


CONFIGS = Path(__file__).resolve().parent / "configs"
"""The configurations of the paper's sections."""


def data_folder() -> Path | None:
    """The folder of the real maps and logs; None if the environment names no existing one."""
    name = os.environ.get(DATA_VARIABLE)
    return Path(name) if name and Path(name).is_dir() else None


@dataclass(frozen=True)
class Setting:
    """Real data or generated buildings, and where progress is shown.

    Parameters
    ----------
    data : Path or None
        The folder of the real data; None for generated buildings.
    progress : Progress
    n_threads : int, optional
    kept : Path, optional
        A folder for what is slow to compute, so that an interrupted experiment resumes where it
        stopped.
    configs : Path
        The folder of the configurations.
    stockholm : Path, optional
        The folder of COLD-Stockholm, for section 7.6.
    """

    data: Path | None = None
    progress: Progress = field(default_factory=Silent)
    n_threads: int | None = None
    kept: Path | None = None
    configs: Path = CONFIGS
    stockholm: Path | None = None

    def experiment(
        self, name: str, changes: Mapping[str, Any] | None = None, *, preset: str | None = None
    ) -> Experiment:
        """The experiment of a configuration, with values changed (see ``changed_config``)."""
        config = load_config(self.configs / f"{name}.toml", preset=preset)
        if self.data is None:
            config = with_stand_ins(config)
        config = changed_config(config, changes or {})
        return Experiment(config, self.configs, self.progress, self.n_threads)

    def unlabelled_map(self, folder: str) -> OccupancyGrid:
        """A map of the real data, or of the building that stands in for it."""
        if self.data is None:
            return generate_building(STAND_INS[folder]).grid
        return load_map(self.data / folder / "map.yaml").grid
