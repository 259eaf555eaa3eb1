"""Views of a floor: scores of several networks in several orientations, averaged."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from pgm_places.floor.architecture import DEEPEST, LABELS
from pgm_places.floor.network import FloorNetwork
from pgm_places.floor.raster import FARTHEST, FloorRaster, holders, network_inputs, open_cells
from pgm_places.kernels.threads import run_tasks
from pgm_places.maps.components import squared_clearance
from pgm_places.maps.occupancy_grid import OccupancyGrid

_TILE, _MARGIN = 1024, 160  # margin of a tile in cells of 0.1 m: the receptive field of its cells

_FRAME = 16  # cells of unknown space around a map

_BLOCK = 2 * DEEPEST
_CORRIDOR, _ROOM, _HALL = (LABELS.index(name) for name in ("corridor", "room", "hall"))


@dataclass(frozen=True)
class FloorView:
    """The orientation of a map for a network: rotated, mirrored, shifted by half a network cell."""

    network: int  # index of the network
    quarters: int = 0  # quarter turns
    mirrored: bool = False
    shifted: bool = False


def views_of(n_networks: int, per_network: int) -> tuple[FloorView, ...]:
    """A number of views for each network, in different orientations, half of them shifted.

    Networks begin with different orientations, so that all orientations are used.
    """
    return tuple(
        FloorView(
            n, (n + k) % 4, mirrored=(k // 2 + n // 2) % 2 == 1, shifted=(k + n // 2) % 2 == 1
        )
        for n in range(n_networks)
        for k in range(per_network)
    )


@dataclass(frozen=True, eq=False)
class FloorScores:
    """The scores of a map's cells."""

    # (h, w, 4) log-probability of corridor, room, doorway, hall, in cells of 0.1 m: the mean over
    # all views, normalised
    log_p: NDArray[np.float16]
    # (h, w) standard deviation, over views, of the log-odds of circulation (corridor or hall)
    # against rooms
    spread: NDArray[np.float16]
    # rows, columns: (H,) the cell of 0.1 m that holds each row and column of the map
    rows: NDArray[np.int64]
    columns: NDArray[np.int64]

    def of(self, cells_rc: NDArray[np.integer]) -> NDArray[np.float32]:
        """(n, 4) log-probabilities of cells given as (row, column)."""
        return self.log_p[self._holders(cells_rc)].astype(np.float32)

    def doubt(self, cells_rc: NDArray[np.integer]) -> NDArray[np.float32]:
        """(n,) the spread at cells."""
        return self.spread[self._holders(cells_rc)].astype(np.float32)

    def _holders(self, cells_rc: NDArray[np.integer]) -> tuple[NDArray[np.int64], ...]:
        return self.rows[cells_rc[:, 0]], self.columns[cells_rc[:, 1]]


def floor_scores(
    grid: OccupancyGrid,
    networks: Sequence[FloorNetwork],
    views: Sequence[FloorView],
    *,
    _tile: int = _TILE,
) -> FloorScores:
    """The networks' scores of a map, tile by tile; bitwise equal for any number of threads."""
    raster = FloorRaster.of(grid)
    h, w = raster.shape
    log_p = np.zeros((h, w, len(LABELS)), np.float16)
    spread = np.zeros((h, w), np.float16)
    free = raster.free > 0
    for rows, columns in _tiles(h, w, _tile):
        if free[rows, columns].any():
            piece = _Piece.of(raster, rows, columns)
            log_p[rows, columns], spread[rows, columns] = piece.scores(networks, views)
    r, c = (holders(length, grid.resolution_m) for length in grid.shape)
    return FloorScores(log_p, spread, r, c)


def _tiles(h: int, w: int, side: int) -> Iterator[tuple[slice, slice]]:
    for top in range(0, h, side):
        for left in range(0, w, side):
            yield slice(top, min(top + side, h)), slice(left, min(left + side, w))


@dataclass(frozen=True, eq=False)
class _Piece:
    """A tile with its margin, with sides that are multiples of the network's divisor."""

    free: NDArray[np.uint8]
    occupied: NDArray[np.bool_]
    depths: tuple[NDArray[np.float32], NDArray[np.float32]]
    inner: tuple[slice, slice]

    @classmethod
    def of(cls, raster: FloorRaster, rows: slice, columns: slice) -> "_Piece":
        spans, pads, inner = [], [], []
        for part, length in zip((rows, columns), raster.shape, strict=True):
            first, last = max(part.start - _MARGIN, 0), min(part.stop + _MARGIN, length)
            before = _FRAME
            after = -(before + last - first + _FRAME) % _BLOCK + _FRAME
            spans.append(slice(first, last))
            pads.append((before, after))
            inner.append(slice(part.start - first + before, part.stop - first + before))
        window = tuple(spans)
        free: NDArray[np.uint8] = np.pad(raster.free[window], pads)
        occupied: NDArray[np.bool_] = np.pad(raster.occupied[window], pads)
        outside, inside = (_depth(mask) for mask in open_cells(free, occupied))
        return cls(free, occupied, (outside, inside), (inner[0], inner[1]))

    def scores(
        self, networks: Sequence[FloorNetwork], views: Sequence[FloorView]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """(h, w, 4) mean log-probabilities and (h, w) spread of the tile itself."""
        by_view: list[NDArray[np.float32] | None] = [None] * len(views)

        def look(task: int) -> None:
            view = views[task]
            by_view[task] = self._seen(networks[view.network], view)

        with threadpool_limits(1, user_api="blas"):
            run_tasks(look, len(views))
        total = np.zeros((*self.free.shape, len(LABELS)), np.float32)[self.inner]
        first, second = np.zeros((2, *total.shape[:2]), np.float32)
        for log_p in by_view:
            assert log_p is not None  # run_tasks has set it
            total += log_p
            odds = np.logaddexp(log_p[..., _CORRIDOR], log_p[..., _HALL]) - log_p[..., _ROOM]
            first += odds
            second += odds * odds
        n = np.float32(len(views))
        total /= n
        mean = _normalised(total)
        spread = np.sqrt(np.maximum(second / n - (first / n) ** 2, 0))
        return mean, spread

    def _seen(self, network: FloorNetwork, view: FloorView) -> NDArray[np.float32]:
        """(h, w, 4) log-probabilities of the tile in one view."""
        free, occupied, *depths = (
            _turned(v, view) for v in (self.free, self.occupied, *self.depths)
        )
        scores = network.scores(network_inputs(free, occupied, (depths[0], depths[1])))
        log_p = _normalised(scores).repeat(2, axis=0).repeat(2, axis=1)
        if view.shifted:
            log_p = np.roll(log_p, (-1, -1), (0, 1))
        return _turned_back(log_p, view)[self.inner]


def _turned(values: NDArray[Any], view: FloorView) -> NDArray[Any]:
    turned = np.rot90(values, view.quarters)
    turned = turned[:, ::-1] if view.mirrored else turned
    return np.roll(turned, (1, 1), (0, 1)) if view.shifted else np.ascontiguousarray(turned)


def _turned_back(values: NDArray[np.float32], view: FloorView) -> NDArray[np.float32]:
    return np.rot90(values[:, ::-1] if view.mirrored else values, -view.quarters)


def _normalised(scores: NDArray[np.float32]) -> NDArray[np.float32]:
    """Scores (..., K) as log-probabilities."""
    shifted = scores - scores.max(axis=-1, keepdims=True)
    log_p: NDArray[np.float32] = shifted - np.log(np.exp(shifted).sum(axis=-1, keepdims=True))
    return log_p


def _depth(mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """(h, w) distance of the cells in the mask to the nearest cell outside, in cells."""
    # Cells beyond the raster count as outside, hence a frame.
    squared = squared_clearance(np.pad(~mask, FARTHEST))
    return np.sqrt(squared[FARTHEST:-FARTHEST, FARTHEST:-FARTHEST], dtype=np.float32)
