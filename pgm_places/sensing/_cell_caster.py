"""Ray casting from the wanted cells of a map, one box at a time."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import ceil, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places._core import add_noise, dda_from_centres
from pgm_places.graph.bands import bands_of_rows
from pgm_places.kernels.threads import resolve_threads, run_parts, run_tasks
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, OccupancyGrid
from pgm_places.sensing import _sweep
from pgm_places.sensing._sweep import Extent, Surroundings, TileCells, TileSweep, Work
from pgm_places.sensing.sensor import Beams, Sensor, SensorNoise


@dataclass(frozen=True)
class Box:
    """Rows ``bottom`` to ``top`` and columns ``left`` to ``right`` of a map, the ends excluded."""

    bottom: int
    top: int
    left: int
    right: int

    @property
    def height(self) -> int:
        """Number of rows."""
        return self.top - self.bottom

    @property
    def width(self) -> int:
        """Number of columns."""
        return self.right - self.left

    @property
    def slices(self) -> tuple[slice, slice]:
        """Index of the box in the map's array."""
        return slice(self.bottom, self.top), slice(self.left, self.right)

    def grown(self, margin: int, shape: tuple[int, int]) -> "Box":
        """The box with a ``margin`` of cells on all sides, clipped to the map."""
        return Box(
            max(self.bottom - margin, 0),
            min(self.top + margin, shape[0]),
            max(self.left - margin, 0),
            min(self.right + margin, shape[1]),
        )


def tiles(wanted: NDArray[np.bool_], capacity: Callable[[Box], int]) -> Iterator[Box]:
    """Boxes of at most ``capacity(box)`` wanted cells, made by halving the longer side."""
    waiting = [Box(0, wanted.shape[0], 0, wanted.shape[1])]
    while waiting:
        box = _trimmed(waiting.pop(), wanted)
        if box is None:
            continue
        cells = wanted[box.slices]
        n_cells, fit = int(np.count_nonzero(cells)), capacity(box)
        if n_cells <= fit or cells.size == 1:
            yield box
        else:
            # Near the end, three nearly full thirds are faster than four quarters.
            parts = ceil(n_cells / fit) if 4 * fit >= n_cells else 2
            waiting += reversed(_cut(box, cells, (parts // 2) / parts))


def _trimmed(box: Box, wanted: NDArray[np.bool_]) -> Box | None:
    cells = wanted[box.slices]
    rows, columns = np.flatnonzero(cells.any(axis=1)), np.flatnonzero(cells.any(axis=0))
    if len(rows) == 0:
        return None
    bottom, left = box.bottom, box.left
    return Box(
        bottom + int(rows[0]),
        bottom + int(rows[-1]) + 1,
        left + int(columns[0]),
        left + int(columns[-1]) + 1,
    )


def _cut(box: Box, cells: NDArray[np.bool_], share: float) -> tuple[Box, Box]:
    """The box cut in two, the first part with about ``share`` of the cells."""
    across = 0 if box.height >= box.width else 1
    below = np.cumsum(cells.sum(axis=1 - across))
    cut = int(np.searchsorted(below, below[-1] * share))
    cut = min(max(cut, 1), cells.shape[across] - 1)
    if across == 0:
        middle = box.bottom + cut
        return (
            Box(box.bottom, middle, box.left, box.right),
            Box(middle, box.top, box.left, box.right),
        )
    middle = box.left + cut
    return Box(box.bottom, box.top, box.left, middle), Box(box.bottom, box.top, middle, box.right)


class NodeNumbers:
    """Numbers of the wanted cells of a map in row-major order."""

    def __init__(self, wanted: NDArray[np.bool_]) -> None:
        self._wanted = wanted
        in_row = wanted.sum(axis=1)
        self._row_starts = np.cumsum(in_row) - in_row
        self.total = int(in_row.sum())

    def of(self, box: Box) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """(n,) node numbers, rows and columns of a box's wanted cells."""
        cells = self._wanted[box.slices]
        rows, columns = np.nonzero(cells)
        before = self._wanted[box.slices[0], : box.left].sum(axis=1)
        in_row = cells.sum(axis=1)
        first = self._row_starts[box.slices[0]] + before - (np.cumsum(in_row) - in_row)
        nodes = np.repeat(first, in_row) + np.arange(len(rows))
        return nodes, rows + box.bottom, columns + box.left


class Cells(NamedTuple):
    """The cells from which scans are cast."""

    rows: NDArray[np.int64]  # (n,)
    columns: NDArray[np.int64]  # (n,)
    nodes: NDArray[np.int32]  # (n,) output row of each cell


class Noise(NamedTuple):
    """A :class:`~pgm_places.sensing.sensor.SensorNoise` for ``add_noise``."""

    seed_low: int  # the lower 32 bits of the seed
    seed_high: int  # the upper 32 bits of the seed
    sigma_m: float
    p_random: float
    p_max: float
    max_range_m: float

    @classmethod
    def of(cls, noise: SensorNoise, max_range_m: float) -> "Noise":
        """The noise of a sensor with a maximum range."""
        return cls(
            noise.seed & 0xFFFFFFFF,
            noise.seed >> 32,
            float(noise.sigma_m),
            float(noise.p_random),
            float(noise.p_max),
            float(max_range_m),
        )


_CELLS_PER_TASK = 256

# Measured times of the two methods in nanoseconds; only their ratio matters.
_FOLLOW_RAY, _FOLLOW_CELL = 2.5, 1.6
_SWEEP_RAY, _SWEEP_FACE, _SWEEP_COLUMN = 1.2, 18.0, 60.0

_CELL_BYTES = 2  # bytes per cell of a box's surroundings: the blocked mask, and one temporary mask
_LISTING_BYTES = 2  # bytes per cell and thread that lists faces
_FACE_BYTES = 18  # bytes per face in the lists, including mirrored copies


def blocked_window(grid: OccupancyGrid, window: Box, stop_at_unknown: bool) -> NDArray[np.uint8]:
    """Ones where rays end in a window of the map, with a rim of ones around it."""
    cells = grid.cells[window.slices]
    blocked = np.ones((window.height + 2, window.width + 2), np.uint8)
    inner = blocked[1:-1, 1:-1].view(np.bool_)
    if stop_at_unknown:
        np.not_equal(cells, FREE, out=inner)
    else:
        np.equal(cells, OCCUPIED, out=inner)
    return blocked


def _bytes_of_lists(grid: OccupancyGrid, stop_at_unknown: bool) -> float:
    """Bytes per cell for lists of faces: enough for parts with three times the mean density."""
    blocked = grid.free if stop_at_unknown else grid.occupied  # or its complement: same faces
    faces = 0
    for rows in bands_of_rows(grid.shape):
        band = blocked[rows.start : rows.stop + 1]
        faces += int(np.count_nonzero(band[1:] != band[:-1]))
        band = blocked[rows]
        faces += int(np.count_nonzero(band[:, 1:] != band[:, :-1]))
    return max(1.0, 3 * _FACE_BYTES * faces / blocked.size)


class CellCaster:
    """Casts a sensor's beams from cells of a map; working memory is reused between boxes."""

    def __init__(self, grid: OccupancyGrid, sensor: Sensor) -> None:
        self._grid = grid
        self._sensor = sensor
        self._n_threads = resolve_threads()
        self._beams = Beams.full_circle(sensor.n_beams)
        self._groups = _sweep.beam_groups(self._beams, self._n_threads)
        self._ways = self._beams.ways(grid.resolution_m)
        self._reach = sensor.max_range_m / grid.resolution_m
        self._list_bytes = _bytes_of_lists(grid, sensor.stop_at_unknown)
        self._spare: list[Work] = []
        # The last surroundings are cached: in a map smaller than the reach, all boxes share them.
        self._last_region: Box | None = None
        self._blocked = np.empty((0, 0), np.uint8)
        self._surroundings: dict[bool, Surroundings] = {}

    def bytes_beside_scans(self, box: Box) -> int:
        """Upper bound of the memory of :meth:`cast` for a box, besides its arguments."""
        region = self._region(box)
        each = _CELL_BYTES + _LISTING_BYTES * min(self._n_threads, 2) + self._list_bytes
        return (
            ceil(each * (region.height + 2) * (region.width + 2))
            + 32 * box.height * box.width
            + self._n_threads * _sweep.work_bytes(box.height, box.width)
        )

    def cast(
        self,
        box: Box,
        rows: NDArray[np.int64],
        columns: NDArray[np.int64],
        nodes: NDArray[np.int32],
        out: NDArray[np.float32],
    ) -> None:
        """Write the scans of cells of a box to the rows ``nodes`` of ``out`` (n, n_beams).

        The cells are given by ``rows`` and ``columns`` of the map.
        """
        region = self._region(box)
        if region != self._last_region:
            self._surroundings = {}
            self._blocked = np.empty((0, 0), np.uint8)  # free the old ones first
            self._blocked = blocked_window(self._grid, region, self._sensor.stop_at_unknown)
            self._last_region = region
        blocked = self._blocked
        if self._sweep_pays(box, blocked, len(nodes)):
            raster = np.full((box.height, box.width), -1, np.int32)
            raster[rows - box.bottom, columns - box.left] = nodes
            self._sweep(box, region, blocked, raster, out)
        else:
            at = Cells(rows - region.bottom + 1, columns - region.left + 1, nodes)
            self.follow(blocked, at, out)
        self._add_noise(Cells(rows, columns, nodes), out)

    def _region(self, box: Box) -> Box:
        """The region that beams from a box can reach."""
        shape = self._grid.shape
        return box.grown(ceil(min(self._reach, max(shape))) + 1, shape)

    def _sweep_pays(self, box: Box, blocked: NDArray[np.uint8], n_cells: int) -> bool:
        """Whether sweeping is expected to be faster than following each ray.

        Following visits each crossed cell; by Cauchy's formula the mean free path among obstacles
        of perimeter P in an area A is pi A / P. Sweeping visits each painted face.
        """
        height, width = blocked.shape
        if max(height, width) + self._reach > _sweep.LARGEST_REGION:
            return False
        faces = np.count_nonzero(blocked[1:] != blocked[:-1])
        faces += np.count_nonzero(blocked[:, 1:] != blocked[:, :-1])
        if _FACE_BYTES * faces > self._list_bytes * blocked.size:
            return False
        area = blocked.size - np.count_nonzero(blocked)
        free_way = min(pi * area / faces, self._reach)
        # The beams of a direction cross a strip of the region, and meet half of its faces.
        strip = box.height * box.width + 0.64 * self._reach * (box.height + box.width)
        painted = 0.5 * faces * min(strip / blocked.size, 1.0)
        n_columns = 0.5 * (height + width + box.height + box.width) / 2
        follow = n_cells * (_FOLLOW_RAY + _FOLLOW_CELL * free_way)
        sweep = n_cells * _SWEEP_RAY + painted * _SWEEP_FACE + n_columns * _SWEEP_COLUMN
        return sweep < follow

    def _sweep(
        self,
        box: Box,
        region: Box,
        blocked: NDArray[np.uint8],
        raster: NDArray[np.int32],
        out: NDArray[np.float32],
    ) -> None:
        tiles: dict[bool, TileCells] = {}

        def look_along(task: int) -> None:
            x_is_major = task == 1
            tiles[x_is_major] = _sweep.tile_cells(raster, x_is_major)
            if x_is_major not in self._surroundings:
                self._surroundings[x_is_major] = Surroundings.of(blocked, x_is_major)

        run_tasks(look_along, 2, n_threads=self._n_threads)
        tile = TileSweep(
            self._surroundings,
            tiles,
            Extent(box.left, box.right, region.left - 1, region.right + 1, self._grid.shape[1]),
            Extent(box.bottom, box.top, region.bottom - 1, region.top + 1, self._grid.shape[0]),
            self._beams,
            self._ways,
            self._grid.resolution_m,
            self._sensor.max_range_m,
        )

        def sweep_group(task: int) -> None:
            try:
                work = self._spare.pop()
            except IndexError:
                work = Work()
            tile.sweep(self._groups[task], work, out)
            self._spare.append(work)

        run_tasks(sweep_group, len(self._groups), n_threads=self._n_threads)

    def follow(self, blocked: NDArray[np.uint8], cells: Cells, out: NDArray[np.float32]) -> None:
        """Write the scans of cells by following each ray through ``blocked``."""
        metres_x, metres_y = (metres.astype(np.float32) for metres in self._ways[-2:])
        beams = self._ways._replace(metres_x=metres_x, metres_y=metres_y)
        cap = np.float32(self._sensor.max_range_m)
        self._in_parts(
            lambda part: dda_from_centres(blocked, part, beams, self._reach, cap, out), cells
        )

    def _add_noise(self, cells: Cells, out: NDArray[np.float32]) -> None:
        noise = self._sensor.noise
        if noise is None or noise.is_silent:
            return
        noise_levels = Noise.of(noise, self._sensor.max_range_m)
        self._in_parts(lambda part: add_noise(out, part, noise_levels), cells)

    def _in_parts(self, work: Callable[[Cells], None], cells: Cells) -> None:
        """Call ``work`` for the parts of a list of cells, spread over threads."""

        def one(part: slice) -> None:
            work(Cells(cells.rows[part], cells.columns[part], cells.nodes[part]))

        run_parts(one, len(cells.nodes), _CELLS_PER_TASK, n_threads=self._n_threads)
