"""Feature tables of the cells of maps, computed block by block, and cached between trainings."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import row_blocks
from pgm_places.features.custom import feature_values, values_on_map
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.sensing.ray_casting import iter_cast
from pgm_places.sensing.sensor import Sensor

Block = tuple[NDArray[np.int64], NDArray[np.float32]]
"""Numbers of cells, and their features (n, F)."""

_SCANS_AT_ONCE = 8_192
"""Scans whose features are in memory at a time: ten megabytes, which are reused for the next scans.
Much larger arrays get new pages each time, which the system has to clear."""


def iter_features(
    grid: OccupancyGrid,
    sensor: Sensor,
    own: Sequence[Any],
    mask: NDArray[np.bool_],
    columns: NDArray[np.int64] | None = None,
) -> Iterator[Block]:
    """Laser and custom features of the cells in a mask (H, W), numbered in row-major order."""
    # Avoid listing the cells of a huge map.
    of_cells = values_on_map(own, grid, np.argwhere(mask), columns) if own else {}
    for block in iter_cast(grid, sensor, mask=mask):
        for some in row_blocks(len(block.nodes), _SCANS_AT_ONCE):
            nodes, ranges = block.nodes[some], block.ranges[some]
            of_map = {place: rows[nodes] for place, rows in of_cells.items()}
            most = sensor.max_range_m
            yield nodes, feature_values(ranges, own, columns, max_range_m=most, from_map=of_map)


class FeatureTables(Protocol):
    """Cache of tables of laser features, by keys of their inputs.

    :class:`pgm_places.experiment.feature_cache.FeatureCache` stores them as files.
    """

    def key(self, item: LabelledMap, sensor: Sensor, mask: NDArray[np.bool_]) -> str:
        """The key of the table of the cells in a mask (H, W) of a map."""
        ...

    def kept(self, key: str, shape: tuple[int, int]) -> NDArray[np.float32] | None:
        """The table (N, F) of a key, or None without one of this shape."""
        ...

    def check_space(self, shapes: Sequence[tuple[int, int]]) -> None:
        """Raise OutputError if there is no space for tables of these shapes."""
        ...

    def keep(self, key: str, shape: tuple[int, int], blocks: Iterable[Block]) -> None:
        """Store a table, passed in blocks of rows with their indices."""
        ...
