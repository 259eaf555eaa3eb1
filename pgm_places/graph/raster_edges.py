"""The edges between neighbouring cells of a raster, listed only on demand.

A map of 100 million cells has hundreds of millions of edges; methods that iterate over the raster,
such as relaxation, never need the list.
"""

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import freeze
from pgm_places.errors import InputError
from pgm_places.graph.bands import bands_of_rows
from pgm_places.graph.layout import GridLayout


class EdgeKind(IntEnum):
    """The kind of an edge; models may treat kinds differently."""

    AXIS = 0
    """Two cells that share a side."""
    DIAGONAL = 1
    """Two cells that share a corner."""
    TIME = 2
    """Two steps that follow each other."""
    LINK = 3
    """Nodes of two joined graphs."""
    LOOP = 4
    """Two steps at one location on different passes."""


_STEPS = {
    4: ((0, 1, EdgeKind.AXIS), (1, 0, EdgeKind.AXIS)),
    8: (
        (0, 1, EdgeKind.AXIS),
        (1, -1, EdgeKind.DIAGONAL),
        (1, 0, EdgeKind.AXIS),
        (1, 1, EdgeKind.DIAGONAL),
    ),
}
"""Rows, columns and kind of the steps to later cells, in the order of the cells."""


@dataclass(frozen=True, eq=False)
class RasterEdges:
    """Each cell of a raster joined to its neighbours among the cells, by 8- or 4-connectivity.

    The list is computed on first use and cached: 8 bytes an edge. 8 joins cells that share a side
    or a corner (paper section 6.1), 4 only a side; InputError for other numbers.
    """

    layout: GridLayout
    connectivity: int = 8

    def __post_init__(self) -> None:
        if self.connectivity not in _STEPS:
            raise InputError(f"connectivity must be 4 or 8, got {self.connectivity}")

    @property
    def pairs(self) -> NDArray[np.int32]:
        """(E, 2) node pairs with ``i < j``, sorted: per node right, then the row above."""
        return self._listed[0]

    @property
    def kinds(self) -> NDArray[np.int8]:
        """(E,) AXIS or DIAGONAL per edge."""
        return self._listed[1]

    @property
    def n_edges(self) -> int:
        """E, counted on the raster."""
        sides, corners = self.layout.n_pairs
        return sides + corners if self.connectivity == 8 else sides

    def label_pairs(self, labels: NDArray[np.int64], n_labels: int) -> NDArray[np.int64]:
        """(K, K) how many edges have label ``a`` at their first node and ``b`` at their second.

        They are counted on the raster, band by band, without listing the edges.
        """
        number = np.int16 if n_labels <= np.iinfo(np.int16).max else np.int32
        raster = self.layout.to_raster(labels.astype(number), fill=-1)
        counts = np.zeros(n_labels**2, np.int64)
        for rows in bands_of_rows(self.layout.shape):
            for down, right, _ in _STEPS[self.connectivity]:
                here, there = _shifted(raster, rows, down, right)
                both = (here >= 0) & (there >= 0)
                key = here[both].astype(np.int64) * n_labels + there[both]
                counts += np.bincount(key, minlength=n_labels**2)
        return counts.reshape(n_labels, n_labels)

    def among(self, keep: NDArray[np.bool_]) -> "RasterEdges":
        """The edges between the cells of the mask (N,), renumbered in order."""
        return RasterEdges(self.layout.part(keep), self.connectivity)

    @cached_property
    def _listed(self) -> tuple[NDArray[np.int32], NDArray[np.int8]]:
        steps = _STEPS[self.connectivity]
        height, width = self.layout.shape
        padded = np.full((height + 1, width + 2), -1, np.int32)
        padded[:-1, 1:-1] = self.layout.node_of_cell
        rows, columns = self.layout.cells_rc[:, 0], self.layout.cells_rc[:, 1] + 1
        heads = np.stack([padded[rows + dr, columns + dc] for dr, dc, _ in steps], axis=1)
        tails = np.broadcast_to(np.arange(len(rows), dtype=np.int32)[:, None], heads.shape)
        kinds = np.broadcast_to(np.array([kind for *_, kind in steps], np.int8), heads.shape)
        present = heads >= 0
        pairs = np.stack([tails[present], heads[present]], axis=1)
        return freeze(pairs), freeze(kinds[present])


def _shifted(
    raster: NDArray[Any], rows: slice, down: int, right: int
) -> tuple[NDArray[Any], NDArray[Any]]:
    """The cells of a band of rows, and their neighbours a step away, where both exist."""
    last = min(rows.stop, len(raster) - down)
    left, width = max(0, -right), raster.shape[1] - abs(right)
    here = raster[rows.start : last, left : left + width]
    return here, raster[rows.start + down : last + down, left + right : left + right + width]
