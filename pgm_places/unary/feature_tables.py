"""Where features of maps may be kept between trainings."""

from collections.abc import Iterable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.sensing.sensor import Sensor

__all__ = ["Block", "FeatureTables"]

Block = tuple[NDArray[np.int64], NDArray[np.float32]]
"""Numbers of cells, and their features (n, F)."""


class FeatureTables(Protocol):
    """Tables of the laser features of labelled cells, by a key that says what they are made from.

    :class:`pgm_places.experiment.feature_cache.FeatureCache` keeps them as files.
    """

    def key(self, item: LabelledMap, sensor: Sensor) -> str:
        """The key of a map's table."""
        ...

    def kept(self, key: str, shape: tuple[int, int]) -> NDArray[np.float32] | None:
        """The table (N, F) of that key, None where there is none of this shape."""
        ...

    def keep(self, key: str, shape: tuple[int, int], blocks: Iterable[Block]) -> None:
        """Keep a table, given as rows by their numbers, some at a time."""
        ...
