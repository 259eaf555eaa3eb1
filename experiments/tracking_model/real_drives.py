"""Drives of real robots: the runs of the COLD campaign, and the log of building 79."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.array_cache import ArrayCache, fingerprint
from experiments.known_maps import CELLS_M
from experiments.paper.categories import load_building79
from experiments.paper.front_laser import PLACES, STEP_M, load_cold_folder, place_classes
from experiments.tracking_model.drives import Laser, Observed, observed
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.simulation.simulated_robot import scans_along
from pgm_places.trajectories.trajectory import Trajectory
from pgm_places.unary.floor_model import FloorModel

FRONT = Laser(180.0, 180, 30.0)
"""The half circle ahead, as the campaign's robots had it."""


LOBBY = {"cold_saarbrucken_seq1": -11.1, "cold_saarbrucken_seq2": -4.2}
"""The lobby of Saarbruecken is the corridor beyond this y: 10 m wide, furnished, and as long."""


def in_lobby(drive: Observed) -> NDArray[np.bool_]:
    """(n,) which steps lie in the lobby that the campaign calls a corridor."""
    beyond = LOBBY.get(drive.name, np.inf)
    return (drive.labels == PLACES.index("corridor")) & (drive.poses[:, 1] > beyond)


def log_of_79(data: Path, cache: ArrayCache, floor: FloorModel | None = None) -> Observed:
    """What the real front laser of building 79's log shows at every step, to networks, too."""
    found = load_building79(data)
    geometry = found.path.geometry
    assert geometry is not None
    laser = Laser(180.0, geometry.n_beams, geometry.range_max_m)
    item = replace(found.map, name="log of building 79", building="Freiburg 79")
    path = found.path.with_labels(found.place, PLACES)
    stem = fingerprint("log of building 79", path.poses, path.labels)
    group = "building 79, real log"
    return observed(item, group, laser, lambda: path, cache, stem, all_steps=True, floor=floor)


def cold_drives(
    data: Path, town: str, cache: ArrayCache, floor: FloorModel | None = None
) -> Iterator[Observed]:
    """What every run in a town shows at its recorded positions, and every tenth of a metre between.

    A step between recorded positions has label -1.
    """
    for folder in sorted(data.glob(f"cold_{town}*")):
        known, runs = load_cold_folder(folder, place_classes(), PLACES, CELLS_M)
        for number, run in enumerate(runs):
            stem = fingerprint(number, FRONT, run.poses, known.grid.cells)
            drive = partial(_with_scans, known.grid, run, number)
            yield observed(known, town, FRONT, drive, cache, stem, all_steps=True, floor=floor)


def _with_scans(grid: OccupancyGrid, run: Trajectory, number: int) -> Trajectory:
    """A run with a scan every tenth of a metre."""
    dense = run.resampled(STEP_M)
    return scans_along(grid, dense, FRONT.geometry, noise=FRONT.noise(number))
