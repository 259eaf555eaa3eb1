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
    """Observed labels of a map's free cells (H, W), and at the model's resolution (h, w); else -1.

    ``learned_names`` are the labels of the methods, which label halls as corridors.
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
        """Transfer a map's observed labels (H, W) to the cells of ``used``, by majority.

        LabelError if the labels do not fit the map or the names.
        """
        names = tuple(label_names)
        raster = label_raster("known", known, grid.shape, n_labels=len(names))
        on_map = np.where(grid.free, raster, np.int16(-1))
        if used.resolution_m < grid.resolution_m:
            layout = GridLayout.of_mask(used.free)
            r, c = Coarsening(used, grid).holders(layout.cells_rc).T
            on_cells = np.asarray(layout.to_raster(on_map[r, c], fill=-1))
        elif used is grid:
            on_cells = on_map
        else:
            alone = np.where(on_map >= 0, grid.cells, np.int8(UNKNOWN))
            on_cells = coarsen_labels(on_map, grid.with_cells(alone), used)
        return cls(on_map, on_cells, names, tuple(learned_names))

    def of_nodes(self, layout: GridLayout) -> NDArray[np.int64]:
        """(N,) the methods' label of each observed node, -1 elsewhere."""
        to = [
            self.learned_names.index(name if name in self.learned_names else "corridor")
            for name in self.label_names
        ]
        # The last entry is the one for index -1, "not observed".
        return np.array([*to, -1], np.int64)[layout.from_raster(self.on_cells)]

    def enforced(self, labeling: Labeling, layout: GridLayout) -> Labeling:
        """The labelling with observed labels at observed nodes, with probability 1."""
        nodes = layout.from_raster(self.on_cells)
        known = np.flatnonzero(nodes >= 0)
        labels, beliefs = labeling.labels.copy(), labeling.beliefs
        labels[known] = nodes[known]
        if beliefs is not None:
            beliefs = beliefs.copy()
            beliefs[known] = np.arange(beliefs.shape[1]) == nodes[known, np.newaxis]
        return replace(labeling, labels=labels, beliefs=beliefs)
