"""Spatial context as features: the mean label histogram in windows around each cell."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import require_shape
from pgm_places.graph.layout import GridLayout

ROWS_AT_ONCE = 128

Values = Callable[[slice], NDArray[np.float64]]
"""(n, K) values of a range of nodes."""


def window_means(
    layout: GridLayout,
    values: NDArray[np.float64],
    half_widths_m: Sequence[float],
    resolution_m: float,
) -> NDArray[np.float32]:
    """(N, W * K) means of node values over square windows centred at each node.

    Parameters
    ----------
    layout : GridLayout
        The cells that are nodes; only they are averaged over.
    values : (N, K) float
        For place labelling, the label histogram z of each cell.
    half_widths_m : sequence of W float
        Half the side of each window, in metres; rounded to whole cells, at least one.
    resolution_m : float
        Side of a cell.

    Columns are ordered by window, then by label. Sums come from integral images, so that the cost
    does not depend on the windows' size.
    """
    require_shape("values", values.shape, (layout.n_nodes, "K"))
    n_labels = values.shape[1]
    means = np.empty((len(values), len(half_widths_m) * n_labels), np.float32)
    parts = iter_window_means(
        layout, lambda nodes: values[nodes], n_labels, half_widths_m, resolution_m
    )
    for nodes, part in parts:
        means[nodes] = part
    return means


def iter_window_means(
    layout: GridLayout,
    values: Values,
    n_labels: int,
    half_widths_m: Sequence[float],
    resolution_m: float,
) -> Iterator[tuple[slice, NDArray[np.float32]]]:
    """:func:`window_means` in bands of rows, with memory independent of the map's height.

    Parameters
    ----------
    layout, half_widths_m, resolution_m
        As in :func:`window_means`; the nodes in row-major order.
    values : callable
        Returns the values (n, K) of a range of nodes; called once for each node, in order.
    n_labels : int
        K.

    Yields
    ------
    slice, (n, W * K) float32
        A range of nodes and their means, with the same bits as :func:`window_means`.
    """
    height, width = layout.shape
    # Wider windows than the map give the same means: there is nothing to average beyond it.
    widest = max(height, width)
    radii = [max(1, round(min(half / resolution_m, widest))) for half in half_widths_m]
    first_of_row = layout.cells.row_start
    sums = _RollingIntegral(1 + n_labels, width)
    for bottom in range(0, height, ROWS_AT_ONCE):
        top = min(bottom + ROWS_AT_ONCE, height)
        nodes = slice(int(first_of_row[bottom]), int(first_of_row[top]))
        sums.forget_below(bottom - max(radii, default=0))
        ahead = min(top + max(radii, default=0), height)
        if sums.n_rows < ahead:
            new = slice(int(first_of_row[sums.n_rows]), int(first_of_row[ahead]))
            raster = np.zeros((1 + n_labels, ahead - sums.n_rows, width))
            rows, columns = layout.cells[new].T
            raster[0, rows - sums.n_rows, columns] = 1.0
            raster[1:, rows - sums.n_rows, columns] = values(new).T
            sums.append(raster)
        if nodes.start == nodes.stop:
            continue
        means = np.empty((nodes.stop - nodes.start, len(radii) * n_labels), np.float32)
        for w, radius in enumerate(radii):
            totals = sums.windows(layout.cells[nodes], radius, height)
            means[:, w * n_labels : (w + 1) * n_labels] = (totals[1:] / totals[0]).T
        yield nodes, means


class _RollingIntegral:
    """Integral images of several planes, restricted to the rows in use.

    Row r, column c of an integral image is the sum of the plane's first r rows and c columns. Rows
    are added in order, so that the sums have the same bits for any size of bands.
    """

    def __init__(self, n_planes: int, width: int) -> None:
        self.n_rows = 0
        self._first = 0
        self._below = np.zeros((n_planes, width))  # sums of the columns so far
        self._kept = np.zeros((n_planes, 1, width + 1))

    def forget_below(self, row: int) -> None:
        """Drop the rows of the integral images before ``row``."""
        drop = max(row - self._first, 0)
        self._kept, self._first = self._kept[:, drop:], self._first + drop

    def append(self, planes: NDArray[np.float64]) -> None:
        """Add the next rows (P, n, width) of the planes, which are overwritten."""
        planes[:, 0] += self._below
        np.cumsum(planes, axis=1, out=planes)
        self._below = planes[:, -1].copy()
        new = np.zeros((planes.shape[0], planes.shape[1], planes.shape[2] + 1))
        np.cumsum(planes, axis=2, out=new[:, :, 1:])
        self._kept = np.concatenate([self._kept, new], axis=1)
        self.n_rows += planes.shape[1]

    def windows(self, cells_rc: NDArray[np.int32], radius: int, height: int) -> NDArray[np.float64]:
        """(P, n) sums over the square windows around cells, cut off at the raster's edges."""
        width = self._kept.shape[2] - 1
        low = np.maximum(cells_rc - radius, 0)
        high = np.minimum(cells_rc + radius + 1, [height, width])
        bottom, top = low[:, 0] - self._first, high[:, 0] - self._first
        left, right = low[:, 1], high[:, 1]
        total: NDArray[np.float64] = (
            self._kept[:, top, right]
            - self._kept[:, bottom, right]
            - self._kept[:, top, left]
            + self._kept[:, bottom, left]
        )
        return total
