"""The data of an experiment: real data, or its substitute."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

from pgm_places.datasets import generate_building
from pgm_places.experiment.config import load_config
from pgm_places.experiment.config_changes import changed_config
from pgm_places.experiment.experiment import DATA_VARIABLE, Experiment
from pgm_places.io.maps.map_server import load_map
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.progress import Progress, Silent
from pgm_places.reproduce.stand_ins import STAND_INS, with_stand_ins

__all__ = ["CONFIGS", "Setting", "data_folder"]

CONFIGS = Path(str(files("pgm_places.reproduce"))) / "configs"
"""The configurations of the paper's sections, part of the package."""


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
    """

    data: Path | None = None
    progress: Progress = field(default_factory=Silent)
    n_threads: int | None = None
    kept: Path | None = None
    configs: Path = CONFIGS

    def experiment(self, name: str, changes: Mapping[str, Any] | None = None) -> Experiment:
        """The experiment of a configuration, with values changed (see ``changed_config``)."""
        config = load_config(self.configs / f"{name}.toml")
        if self.data is None:
            config = with_stand_ins(config)
        config = changed_config(config, changes or {})
        return Experiment(config, self.configs, self.progress, self.n_threads)

    def unlabelled_map(self, folder: str) -> OccupancyGrid:
        """A map of the real data, or of the building that stands in for it."""
        if self.data is None:
            return generate_building(STAND_INS[folder]).grid
        return load_map(self.data / folder / "map.yaml").grid
