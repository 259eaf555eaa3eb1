"""Small generated buildings in the folders and files of the real data."""

from pathlib import Path

import numpy as np

from pgm_places.io.maps.label_image import save_labels
from pgm_places.io.maps.map_server import save_map
from pgm_places.maps.occupancy_grid import UNKNOWN, OccupancyGrid
from pgm_places.simulation import generate_building

CUT_COLUMN = 366
"""Where the configurations cut building 79."""


def write_small_map(folder: Path, seed: int, *, cut_column: int | None = None) -> None:
    """A small building as map and labels; unknown space before it puts its cut at a column."""
    building = generate_building(seed, size="small", resolution_m=0.1)
    pad = 0 if cut_column is None else cut_column - building.split_column
    cells = np.pad(building.grid.cells, ((0, 0), (pad, 0)), constant_values=UNKNOWN)
    labels = np.pad(building.labels, ((0, 0), (pad, 0)), constant_values=-1)
    folder.mkdir(parents=True)
    save_map(OccupancyGrid(cells, building.grid.resolution_m), folder / "map")
    save_labels(folder / "labels.png", labels, building.label_names)


def write_small_data(data: Path) -> None:
    """What sections 7.1, 7.3 and 7.5 need."""
    write_small_map(data / "freiburg079", 3, cut_column=CUT_COLUMN)
