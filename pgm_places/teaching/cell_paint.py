"""Paint on the cells that are labelled, whatever the map's own resolution."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["CellPaint"]


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
        # The entry after the last serves -1, "not painted".
        return np.array([*to, -1], np.int16)[self.raster]

    @property
    def used(self) -> tuple[str, ...]:
        """The classes that are painted, in their order."""
        seen = np.unique(self.raster[self.raster >= 0]).tolist()
        return tuple(self.classes[k] for k in seen)
