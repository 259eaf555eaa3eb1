"""Cell table: the cells of one map with their features, cached for repeated labelling."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.features.custom import n_columns
from pgm_places.graph.layout import GridLayout
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.sensing.sensor import Sensor
from pgm_places.spaces.gates import Gates, gate_candidates
from pgm_places.spaces.segmentation import Segmentation
from pgm_places.unary.space_model import MapSpaces
from pgm_places.unary.training_cells import training_features


@dataclass(frozen=True, eq=False)
class CellPaint:
    """Paint on the cells that are labelled.

    Parameters
    ----------
    raster : (h, w) int16
        Index into ``classes`` of each painted cell, -1 elsewhere.
    classes : tuple of str
    """

    raster: NDArray[np.int16]
    classes: tuple[str, ...]

    def on(self, names: tuple[str, ...]) -> NDArray[np.int16]:
        """(h, w) the paint as indices into other names; -1 where a class is not among them."""
        to = [names.index(name) if name in names else -1 for name in self.classes]
        # The entry after the last is looked up by -1, "not painted".
        return np.array([*to, -1], np.int16)[self.raster]

    @property
    def used(self) -> tuple[str, ...]:
        """The classes that are painted, in the order of ``classes``."""
        painted = np.unique(self.raster[self.raster >= 0]).tolist()
        return tuple(self.classes[k] for k in painted)


MAX_BYTES = 1 << 30
"""Bytes of the largest feature table in memory; features of larger maps are recomputed."""


@dataclass(eq=False)
class CellTable:
    """Laser and custom features of all free cells of a map.

    Parameters
    ----------
    grid : OccupancyGrid
        At the resolution that is labelled.
    sensor : Sensor
    features : tuple
        Custom features.
    """

    grid: OccupancyGrid
    sensor: Sensor
    features: tuple[Any, ...] = ()
    _own: NDArray[np.float32] | None = None

    @cached_property
    def layout(self) -> GridLayout:
        """The free cells in the order of the nodes."""
        return GridLayout.of_map(self.grid)

    @cached_property
    def gates(self) -> Gates:
        """The gate candidates of the map."""
        return gate_candidates(Segmentation.of(self.grid))

    @property
    def fits(self) -> bool:
        """Whether the features of all cells fit into memory."""
        return 4 * self.layout.n_nodes * n_columns(self.features) <= MAX_BYTES

    def all(self) -> NDArray[np.float32] | None:
        """(N, F) the features of all cells; None if they do not fit into memory."""
        if self._own is None and self.fits:
            self._own = self._computed(self.grid.free)
        return self._own

    def rows(self, nodes: NDArray[np.int64]) -> NDArray[np.float32]:
        """(n, F) the features of some cells, by ascending node."""
        table = self.all()
        if table is not None:
            return table[nodes]
        mask = np.zeros(self.grid.shape, np.bool_)
        mask[tuple(self.layout.cells[nodes].T)] = True
        return self._computed(mask)

    def beside_spaces(self, nodes: NDArray[np.int64], spaces: MapSpaces) -> NDArray[np.float32]:
        """(n, F + S) the features of some cells, followed by their space features."""
        cells = self.layout.cells[nodes]
        around = spaces.features.lookup(cells)
        return np.concatenate([self.rows(nodes), around], axis=1)

    def _computed(self, mask: NDArray[np.bool_]) -> NDArray[np.float32]:
        item = LabelledMap(self.grid, np.zeros(self.grid.shape, np.int16))
        return training_features([item], self.sensor, self.features, [mask])
