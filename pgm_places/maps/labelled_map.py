"""A map with its ground truth, for training and testing."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pgm_places import plotting
from pgm_places._arguments import public
from pgm_places._checks import require_names, set_frozen
from pgm_places.errors import LabelError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.plotting import Plotted, axes_or_new

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["LabelledMap"]


@public
@dataclass(frozen=True, eq=False)
class LabelledMap(Plotted):
    """An occupancy grid, the true label of its cells, and the part of it to use.

    Parameters
    ----------
    grid : OccupancyGrid
        The map; scans are simulated in all of it, also beyond the window.
    labels : (H, W) int16
        Label index per cell in the grid's order (row 0 at the bottom), -1 where unknown.
    window : (H, W) bool, optional
        The part to train or test on; all of the map by default.
    name : str
        The name in messages and tables.
    building : str, optional
        The building of the map. Maps of one building are never on both sides of a cross-validation.
        By default each map is a separate building.
    domain : str, optional
        The origin of the map, such as "drawn" or "simulated". If training maps have several
        domains, the list with space features is the mean of lists that are each trained without one
        domain; maps without a domain are used for all of them.
    """

    grid: OccupancyGrid
    labels: NDArray[np.int16]
    window: NDArray[np.bool_] | None = None
    name: str = "map"
    building: str | None = None
    domain: str | None = None

    def __post_init__(self) -> None:
        labels = np.asarray(self.labels)
        if labels.shape != self.grid.shape or not np.issubdtype(labels.dtype, np.integer):
            raise LabelError(
                f"{self.name}: labels must be integers of the map's shape {self.grid.shape}, got "
                f"{labels.dtype} of shape {labels.shape}"
            )
        set_frozen(self, labels=labels.astype(np.int16))
        window = self.window
        if window is not None:
            window = np.asarray(window, np.bool_)
            if window.shape != self.grid.shape:
                raise LabelError(
                    f"{self.name}: window must have the map's shape {self.grid.shape}, "
                    f"got {window.shape}"
                )
            set_frozen(self, window=window)

    @cached_property
    def cells(self) -> NDArray[np.bool_]:
        """(H, W) mask of the free cells inside the window."""
        return self.grid.free if self.window is None else self.grid.free & self.window

    @cached_property
    def labelled_cells(self) -> NDArray[np.bool_]:
        """(H, W) mask of the free cells inside the window whose label is known."""
        return self.cells & (self.labels >= 0)

    def plot(self, ax: "Axes | None" = None, *, label_names: Sequence[str] = ()) -> "Axes":
        """Draw the map with its ground truth on ``ax``, or on new axes; returns the axes.

        ``label_names`` determine the colours; by default the labels' numbers.
        """
        numbers = range(int(self.labels.max(initial=-1)) + 1)
        names = tuple(label_names) or tuple(f"label {number}" for number in numbers)
        require_names(self.name, self.labels, names)
        ax = self.grid.plot(axes_or_new(ax))
        plotting.draw_labels(ax, self.labels, names, self.grid.frame)
        return ax

    def graph(self, *, connectivity: int = 8, labelled_only: bool = False) -> LabelGraph:
        """The graph of the window's free cells, or only of cells with a known label."""
        mask = self.labelled_cells if labelled_only else self.cells
        return LabelGraph.from_grid(self.grid, connectivity=connectivity, mask=mask)

    def truth(self, graph: LabelGraph) -> NDArray[np.int64]:
        """(N,) label index per node of one of this map's graphs, -1 where unknown."""
        return graph.grid_layout.from_raster(self.labels).astype(np.int64)


def require_examples(maps: list[LabelledMap], label_names: tuple[str, ...]) -> None:
    """Raise LabelError unless every label has at least one cell in some map."""
    counts = np.zeros(len(label_names), np.int64)
    for known in maps:
        labels = known.labels[known.labelled_cells]
        require_names(known.name, labels, label_names)
        counts += np.bincount(labels, minlength=len(label_names))
    missing = [name for name, count in zip(label_names, counts, strict=True) if count == 0]
    if missing:
        where = ", ".join(known.name for known in maps)
        raise LabelError(
            f"no training cell is labelled {' or '.join(map(repr, missing))} in {where}; "
            "label some, widen the window, or take the name out of [labels] names"
        )
