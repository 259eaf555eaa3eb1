"""Labelling a map anew as it grows.

A floor on which chairs come and go, and two maps that are drawn scan by scan: from the log of
building 79, a map every 40 s, and from a simulated drive through a generated floor, a map every
20 s. Each map is labelled by `LiveMap`, which keeps what it can from the one before, on one thread.
The maps of drives are grouped by how many scans had to be cast again; given are medians, the
processor time of the update beside that of labelling the same map from the beginning. For every
fourth map of a drive, both give the same labels and beliefs to the last bit, or this stops.
"""

import os
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from pgm_places import trained_labeler
from pgm_places.datasets import generate_building
from pgm_places.io.logs.trajectories import read_trajectory
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.live.live_map import LiveLabels, LiveMap
from pgm_places.live.live_options import LiveOptions
from pgm_places.live.place_finder import FoundPlace, PlaceFinder
from pgm_places.live.replay import Replay
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from pgm_places.sensing.simulated_robot import SimulatedRobot
from pgm_places.trajectories.scan import Scan
from pgm_places.trajectories.trajectory import Trajectory

MODEL = "default"
CHAIR_CELLS = 8
GROUPS = (("less than a tenth", 0.1), ("up to three tenths", 0.3), ("more", 1.1))
CHECKED_EVERY = 4


class Timed(LiveMap):
    """A live map that takes down what its updates cost."""

    def __init__(self, labeler: PlaceLabeler) -> None:
        super().__init__(labeler, n_threads=1)
        self.seconds: list[float] = []
        self.alone: list[float] = []
        self.found: list[LiveLabels] = []

    def on_map(self, grid: OccupancyGrid) -> LiveLabels:
        """Label a map; every few, also from the beginning."""
        start = time.process_time()
        found = super().on_map(grid)
        self.seconds.append(time.process_time() - start)
        self.found.append(found)
        if len(self.found) % CHECKED_EVERY == 0:
            self._check(found)
        return found

    def _check(self, found: LiveLabels) -> None:
        start = time.process_time()
        alone = LiveMap(self.model, n_threads=1).on_map(found.labels.grid)
        self.alone.append(time.process_time() - start)
        assert np.array_equal(alone.labels.labels, found.labels.labels)
        one, other = alone.labels.labeling.beliefs, found.labels.labeling.beliefs
        assert one is not None and other is not None
        assert np.array_equal(one, other)


class Still(PlaceFinder):
    """Finds no places: only the maps count here."""

    def step(self, scan: Scan, robot: Any = None) -> FoundPlace:
        """Nothing, at once."""
        return FoundPlace(scan.time_s, (0.0, 0.0, 0.0), "", {}, robot, 0, changed=False)


def chairs_come_and_go(labeler: PlaceLabeler) -> Iterator[dict[str, Any]]:
    """The cost of an update by what has changed, from map to map of one floor."""
    grid = generate_building(0, size="small", resolution_m=0.05).grid
    live = LiveMap(labeler, n_threads=1)
    rng = np.random.default_rng(0)

    def chairs(count: int) -> OccupancyGrid:
        cells, side = grid.cells.copy(), CHAIR_CELLS
        for row, column in rng.choice(np.argwhere(grid.free), count):
            seat = cells[row : row + side, column : column + side]
            seat[seat == FREE] = OCCUPIED
        return grid.with_cells(cells)

    half = np.where(np.arange(grid.shape[1]) < grid.shape[1] // 2, grid.cells, UNKNOWN)
    noise = grid.free & (rng.random(grid.shape) < 0.02)
    margin = np.pad(grid.cells, ((0, 5), (0, 5)), constant_values=UNKNOWN)
    wider = OccupancyGrid(margin, grid.resolution_m, grid.origin_xy_m, grid.yaw_rad)
    runs = [
        ("everything: half of the floor", grid.with_cells(half)),
        ("the other half", grid),
        ("nothing", grid),
        ("a margin of unknown cells", wider),
        ("2 % noise, for the first time", grid.with_cells(np.where(noise, OCCUPIED, grid.cells))),
        ("a chair", chairs(1)),
        ("four other chairs", chairs(4)),
        ("all chairs gone", grid),
    ]
    for name, sent in runs:
        start = time.process_time()
        found = live.on_map(sent)
        seconds = time.process_time() - start
        assert found.update is not None
        yield {
            "what has changed": name,
            "cells changed": found.update.n_changed,
            "scans cast": found.update.n_cast,
            "of": found.update.n_cells,
            "processor time (s)": seconds,
        }


def growing(
    labeler: PlaceLabeler, drive: Trajectory, period_s: float, name: str
) -> Iterator[dict[str, Any]]:
    """The cost of the updates of a map that is drawn scan by scan, by how much is cast."""
    live = Timed(labeler)
    finder = Still(TrajectoryLabeler.from_places(labeler))
    for _ in Replay(drive, finder, live, LiveOptions(relabel_min_period_s=period_s)):
        pass
    updates = [found.update for found in live.found]
    shares = [item.n_cast / item.n_cells for item in updates if item is not None]
    lowest = 0.0
    for words, highest in GROUPS:
        some = [k for k, share in enumerate(shares) if lowest <= share < highest]
        lowest = highest
        if some:
            chosen = [item for k in some if (item := updates[k]) is not None]
            yield {
                "map drawn from": name,
                "scans cast again": words,
                "maps": len(some),
                "cells changed": int(median(item.n_changed for item in chosen)),
                "scans cast": int(median(item.n_cast for item in chosen)),
                "of": int(median(item.n_cells for item in chosen)),
                "processor time (s)": median(live.seconds[k] for k in some),
            }
    yield {
        "map drawn from": name,
        "compared from the beginning": len(live.alone),
        "processor time from the beginning (s)": median(live.alone),
        "of these updates (s)": median(live.seconds[CHECKED_EVERY - 1 :: CHECKED_EVERY]),
    }


def simulated() -> Trajectory:
    """A drive through a generated floor."""
    grid = generate_building(3, size="small", resolution_m=0.05).grid
    return SimulatedRobot().explore(grid, max_length_m=60.0)


def run(quick: bool) -> list[dict[str, Any]]:
    """The rows of the tables."""
    labeler = trained_labeler(MODEL)
    floor = generate_building(0, size="small", resolution_m=0.05).grid
    LiveMap(labeler, n_threads=1).on_map(floor)  # reads the kernels from the cache
    rows = list(chairs_come_and_go(labeler))
    if quick:
        return rows
    log = Path(os.environ.get("PGM_PLACES_DATA", "")) / "freiburg079" / "laser.log.gz"
    if log.exists():
        rows += growing(labeler, read_trajectory(log).trajectory, 40.0, "log of building 79")
    return [*rows, *growing(labeler, simulated(), 20.0, "simulated drive")]
