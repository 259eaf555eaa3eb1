"""Observed labels of map cells, such as cells painted by a person."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import label_raster
from pgm_places.graph.layout import GridLayout
from pgm_places.inference.labeling import Labeling
from pgm_places.maps.coarsening import Coarsening, coarsen_labels
from pgm_places.maps.occupancy_grid import UNKNOWN, OccupancyGrid


@dataclass(frozen=True, eq=False)
class KnownCells:
    """Known labels on a map, and on the cells of its form that a model labels.

    Parameters
    ----------
    on_map : (H, W) int16
        Label of each free cell of the map that is known, -1 elsewhere.
    on_cells : (h, w) int16
        The same at the model's resolution.
    label_names : tuple of str
        What the labels mean.
    learned_names : tuple of str
        The labels that methods know: those without the hall, which is a corridor to them.
    """

    on_map: NDArray[np.int16]
    on_cells: NDArray[np.int16]
    label_names: tuple[str, ...]
    learned_names: tuple[str, ...]

    @classmethod
    def of(
        cls,
        known: ArrayLike,
        grid: OccupancyGrid,
        used: OccupancyGrid,
        label_names: Sequence[str],
        learned_names: Sequence[str],
    ) -> Self:
        """Known labels (H, W) of a map, and what follows for the cells of ``used``.

        A coarser cell is known where any of its free parts is; it takes the label of most of them.

        Raises
        ------
        LabelError
            Labels that do not fit the map or the names.
        """
        names = tuple(label_names)
        raster = label_raster("known", known, grid.shape, n_labels=len(names))
        on_map = np.where(grid.free, raster, np.int16(-1))
        if used.resolution_m < grid.resolution_m:
            on_cells = _split(on_map, grid, used)
        elif used is grid:
            on_cells = on_map
        else:
            alone = np.where(on_map >= 0, grid.cells, np.int8(UNKNOWN))
            on_cells = coarsen_labels(on_map, grid.with_cells(alone), used)
        return cls(on_map, on_cells, names, tuple(learned_names))

    def of_nodes(self, layout: GridLayout) -> NDArray[np.int64]:
        """(N,) the learned label of each node, -1 where it is not known."""
        to = [
            self.learned_names.index(name if name in self.learned_names else "corridor")
            for name in self.label_names
        ]
        # The entry after the last serves -1, "not known".
        return np.array([*to, -1], np.int64)[layout.from_raster(self.on_cells)]

    def kept(self, labeling: Labeling, layout: GridLayout) -> Labeling:
        """A labelling in which known nodes have exactly their labels, and no doubt of them."""
        nodes = layout.from_raster(self.on_cells)
        known = np.flatnonzero(nodes >= 0)
        labels, beliefs = labeling.labels.copy(), labeling.beliefs
        labels[known] = nodes[known]
        if beliefs is not None:
            beliefs = beliefs.copy()
            beliefs[known] = np.arange(beliefs.shape[1]) == nodes[known, np.newaxis]
        return replace(labeling, labels=labels, beliefs=beliefs)


def _split(
    on_map: NDArray[np.int16], grid: OccupancyGrid, used: OccupancyGrid
) -> NDArray[np.int16]:
    """(h, w) labels of a map on the cells that it was split into."""
    layout = GridLayout.of_mask(used.free)
    r, c = Coarsening(used, grid).holders(layout.cells_rc).T
    return np.asarray(layout.to_raster(on_map[r, c], fill=-1))
