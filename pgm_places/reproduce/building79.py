"""The real log of building 79 in the frame of its map, cut at the column where the paper cuts."""

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pgm_places.io.logs.trajectories import read_trajectory
from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.map_server import load_map
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.trajectories.similarity import Similarity
from pgm_places.trajectories.trajectory import Trajectory

PLACES = ("corridor", "room", "doorway")
CATEGORIES: Mapping[str, str] = {
    "CR": "corridor",
    "DW": "doorway",
    "KT": "kitchen",
    "1PO": "office",
    "2PO": "office",
    "LO": "large office",
    "PT": "printer area",
}
CATEGORY_NAMES = tuple(dict.fromkeys(CATEGORIES.values()))
NO_RETURN_M = 80.0  # the log writes 81.83 and 81.91
CUT_COLUMN = 366
CELLS_KEPT = 0.25  # of the training cells, at random: neighbouring cells look alike


@dataclass(frozen=True, eq=False)
class Building79:
    """The log with its labels, and which steps lie left of the cut; the left half of the map."""

    path: Trajectory
    category: NDArray[np.int64]
    left: NDArray[np.bool_]
    map: LabelledMap
    training_map: LabelledMap

    @property
    def place(self) -> NDArray[np.int64]:
        """(T,) index into PLACES, -1 where unknown."""
        assert self.path.labels is not None
        return self.path.labels


def load_building79(data: Path) -> Building79:
    """The map, its labels, the log and the log's labels."""
    folder = data / "freiburg079"
    grid = load_map(folder / "map.yaml").grid
    labels = load_labels(folder / "labels.png", PLACES, grid=grid)
    whole = LabelledMap(grid, labels, name="building 79")
    log = read_trajectory(folder / "laser.log.gz", range_max_m=NO_RETURN_M).trajectory
    path = log.transformed(_log_to_map(grid.shape[0]))
    with (folder / "scan_labels.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    place = [PLACES.index(row["place"]) if row["place"] else -1 for row in rows]
    category = [
        CATEGORY_NAMES.index(CATEGORIES[row["category"]]) if row["category"] else -1 for row in rows
    ]
    kept = np.random.default_rng(0).random(grid.shape) < CELLS_KEPT
    window = np.zeros(grid.shape, np.bool_)
    window[:, :CUT_COLUMN] = True
    return Building79(
        path.with_labels(np.array(place), PLACES),
        np.array(category),
        path.poses[:, 0] < CUT_COLUMN * grid.resolution_m,
        whole,
        LabelledMap(grid, np.where(kept, labels, -1).astype(np.int16), window, "left half"),
    )


def _log_to_map(height: int) -> Similarity:
    """From the log's frame to the map's: the registration that comes with the data."""
    per_cell = np.array([19.8359, 1.596]) * 0.05
    return Similarity(
        float(np.arctan2(per_cell[1], per_cell[0])),
        (492.7 * 0.05, (height - 135.37) * 0.05),
        float(np.hypot(*per_cell)),
    )
