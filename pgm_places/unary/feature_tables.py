"""Features of the cells of maps, block by block, and where they may be kept between trainings."""

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
"""Scans whose features are held at a time: ten megabytes of all columns, which the next scans find
again; for much larger arrays the system gives new pages each time, and clears them."""


def iter_features(
    grid: OccupancyGrid,
    sensor: Sensor,
    own: Sequence[Any],
    mask: NDArray[np.bool_],
    columns: NDArray[np.int64] | None = None,
) -> Iterator[Block]:
    """Laser and custom features of the cells in a mask (H, W), numbered in row-major order."""
    # The cells of a huge map are not listed without need.
    of_cells = values_on_map(own, grid, np.argwhere(mask), columns) if own else {}
    for block in iter_cast(grid, sensor, mask=mask):
        for some in row_blocks(len(block.nodes), _SCANS_AT_ONCE):
            nodes, ranges = block.nodes[some], block.ranges[some]
            of_map = {place: rows[nodes] for place, rows in of_cells.items()}
            most = sensor.max_range_m
            yield nodes, feature_values(ranges, own, columns, max_range_m=most, from_map=of_map)


class FeatureTables(Protocol):
    """Tables of the laser features of some cells of maps, by keys that say what they depend on.

    :class:`pgm_places.experiment.feature_cache.FeatureCache` keeps them as files.
    """

    def key(self, item: LabelledMap, sensor: Sensor, mask: NDArray[np.bool_]) -> str:
        """The key of the table of the cells in a mask (H, W) of a map."""
        ...

    def kept(self, key: str, shape: tuple[int, int]) -> NDArray[np.float32] | None:
        """The table (N, F) of that key, None where there is none of this shape."""
        ...

    def check_space(self, shapes: Sequence[tuple[int, int]]) -> None:
        """Called before tables of these shapes are kept; an OutputError if there is no room."""
        ...

    def keep(self, key: str, shape: tuple[int, int], blocks: Iterable[Block]) -> None:
        """Keep a table, given as rows by their numbers, some at a time."""
        ...
