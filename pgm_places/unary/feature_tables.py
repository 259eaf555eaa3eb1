"""Where features of maps may be kept between trainings."""

from collections.abc import Iterable, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.sensing.sensor import Sensor

Block = tuple[NDArray[np.int64], NDArray[np.float32]]
"""Numbers of cells, and their features (n, F)."""


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

    def make_room(self, shapes: Sequence[tuple[int, int]]) -> None:
        """Called before tables of these shapes are kept; an OutputError if there is no room."""
        ...

    def keep(self, key: str, shape: tuple[int, int], blocks: Iterable[Block]) -> None:
        """Keep a table, given as rows by their numbers, some at a time."""
        ...
