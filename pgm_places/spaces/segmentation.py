"""Segmentation: the open space of a map divided at narrow passages, at several scales."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from pgm_places._checks import cell_list, freeze
from pgm_places._core import border_sites, highest_passes, merge_basins
from pgm_places.errors import InputError
from pgm_places.graph.bands import bands_of_rows
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.maps.occupancy_grid import FREE, OccupancyGrid
from pgm_places.spaces.basins import (
    Basins,
    BasinSums,
    clearance_m,
    find_basins,
    half_width_m,
    neighbour_steps,
    open_space,
    relief_of,
    sum_up,
)
from pgm_places.spaces.openings import Borders, Openings, find_openings

__all__ = ["RATIOS", "Segmentation", "SpaceSegments", "Watershed"]

RATIOS: tuple[float, ...] = (0.9, 0.75, 0.6)
"""Neighbours are merged if the pass between them is wider than this share of the smaller one's
radius: the larger the share, the finer the segments."""

_LEAST_RADIUS_M = 0.15  # narrower basins, such as gaps between specks, always join a neighbour


@dataclass(frozen=True, eq=False)
class Watershed:
    """The common basis of all divisions of a map's open space."""

    grid: OccupancyGrid
    # (H + 2, W + 2) smoothed distance to the nearest wall, with a frame; see ``relief_of``
    relief: NDArray[np.int32]
    basins: Basins
    borders: Borders  # where the segments of the finest scale touch

    @cached_property
    def sums(self) -> BasinSums:
        """The sums from which the shapes of segments are computed."""
        return sum_up(self.grid, self.basins, self.relief)

    def checked(self, cells_rc: ArrayLike) -> NDArray[np.int32]:
        """Cells (n, 2) as C-contiguous integers; cells outside the map are refused."""
        cells, shape = cell_list(cells_rc), self.grid.shape
        if cells.size and (cells.min() < 0 or (cells.max(axis=0) >= shape).any()):
            outside = ((cells < 0) | (cells >= shape)).any(axis=1)
            raise InputError(
                f"cells_rc must lie on the map of {shape} cells, got "
                f"{tuple(cells[outside][0].tolist())} at index {int(outside.argmax())}"
            )
        return np.ascontiguousarray(cells, np.int32)

    def read(self, cells_rc: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
        """(n,) basin, -1 for none, and (n,) distance to the nearest wall in metres at cells."""
        r, c = cells_rc[:, 0] + 1, cells_rc[:, 1] + 1
        return self.basins.raster[r, c], clearance_m(self.relief[r, c], self.grid.resolution_m)


@dataclass(frozen=True, eq=False)
class SpaceSegments:
    """One division of open space: the segment of each basin, and the openings between segments."""

    watershed: Watershed
    # (B + n_lines,) segment of each basin and of each line between basins, -1 for lines between
    # segments. Segments are numbered in the order of their first summit.
    segment_of: NDArray[np.int32]
    openings: Openings  # where segments touch

    @property
    def count(self) -> int:
        """S, the number of segments."""
        return len(self.area_m2)

    @cached_property
    def area_m2(self) -> NDArray[np.float64]:
        """(S,) area of each segment."""
        inside = self.segment_of >= 0
        cells = np.bincount(
            self.segment_of[inside], self.watershed.basins.area[inside].astype(np.float64)
        )
        return freeze(cells * self.watershed.grid.resolution_m**2)

    @cached_property
    def radius_m(self) -> NDArray[np.float64]:
        """(S,) radius of the largest disc in each segment."""
        top = np.zeros(self.count, np.int32)
        inside = self.segment_of >= 0
        np.maximum.at(top, self.segment_of[inside], self.watershed.basins.summit[inside])
        return freeze(half_width_m(top, self.watershed.grid.resolution_m))

    @cached_property
    def graph(self) -> LabelGraph:
        """The segments as nodes; segments that share an opening are joined."""
        return LabelGraph.from_edges(self.count, self.neighbours)

    @cached_property
    def neighbours(self) -> NDArray[np.int32]:
        """(E, 2) the pairs of segments that share an opening, the smaller first, sorted."""
        return freeze(np.unique(self.openings.segments, axis=0))

    def at(self, cells_rc: ArrayLike) -> NDArray[np.int32]:
        """(n,) segment of cells (n, 2) given as row and column, -1 for none."""
        return self.of_basins(self.watershed.read(self.watershed.checked(cells_rc))[0])

    def of_basins(self, basin: NDArray[np.int32]) -> NDArray[np.int32]:
        """The segment of each basin of an array of any shape, -1 for none."""
        return np.append(self.segment_of, np.int32(-1))[basin]

    def raster(self, dtype: DTypeLike = np.int32) -> NDArray[Any]:
        """(H, W) segment of each cell; -1 where it is not open, or on a line between segments."""
        basin = self.watershed.basins.raster[1:-1, 1:-1]
        segment = np.empty(basin.shape, dtype)
        for rows in bands_of_rows(basin.shape):  # NumPy looks up by 64-bit copies of the numbers
            segment[rows] = self.of_basins(basin[rows])
        return segment


@dataclass(frozen=True, eq=False)
class Segmentation:
    """The segments of a map at several scales, all composed of the same basins.

    Parameters
    ----------
    watershed : Watershed
    ratios : tuple of float
        See ``RATIOS``; one scale each.
    scales : tuple of Segments
        The finest first.
    cuts : (n, 2) int or None
        Row and column of further cells at which segments end, without a narrowing.

    Examples
    --------
    >>> cells = np.zeros((20, 42), np.int8)
    >>> cells[:, 20:22], cells[8:12, 20:22] = 100, 0  # two rooms, a wall, a door of 0.8 m
    >>> found = Segmentation.of(OccupancyGrid(cells, resolution_m=0.2))
    >>> found.scales[0].area_m2.round(1).tolist()
    [16.2, 16.2]
    >>> found.scales[0].openings.half_width_m.round(1).tolist()
    [0.4]
    """

    watershed: Watershed
    ratios: tuple[float, ...]
    scales: tuple[SpaceSegments, ...]
    cuts: NDArray[np.integer] | None = None

    @classmethod
    def of(
        cls,
        grid: OccupancyGrid,
        ratios: tuple[float, ...] = RATIOS,
        cuts: NDArray[np.integer] | None = None,
    ) -> Self:
        """The segments of a map.

        Small obstacles are filled and free pieces under 1 m2 dropped (``open_space``); the
        distance to the walls, smoothed by one cell, is cut into basins by a watershed; basins are
        merged over passes wider than a share of the smaller one's radius, the widest passes first.
        Time and memory are linear in the cells: about 20 bytes a cell at most, 8 in the result.

        Parameters
        ----------
        grid : OccupancyGrid
        ratios : tuple of float
            Shares in (0, 1], from the finest scale to the coarsest.
        cuts : (n, 2) int, optional
            Row and column of further cells at which segments end, without a narrowing: lines from
            wall to wall whose cells share sides. They do not change widths.

        Raises
        ------
        InputError
            If there is no ratio, a ratio is not in (0, 1], or they do not decrease; or if the map
            has 2^31 cells or more.
        """
        _require_ratios(ratios)
        _require_numbers(grid.shape)
        relief = relief_of(open_space(grid))
        with _lowered(relief, cuts):
            basins = find_basins(relief)
            divisions, touching = _divisions(basins, relief, ratios, grid.resolution_m)
        borders = _borders(basins, relief, divisions, touching, grid)
        watershed = Watershed(grid, freeze(relief), basins, borders)
        return cls(watershed, tuple(ratios), divided(watershed, divisions), cuts)


@contextmanager
def _lowered(relief: NDArray[np.int32], cuts: NDArray[np.integer] | None) -> Iterator[None]:
    """Lower the relief to its minimum at the cuts during the block, so that no segment crosses."""
    if cuts is None:
        yield
        return
    r, c = np.asarray(cuts).reshape(-1, 2).T + 1
    height = relief[r, c]
    relief[r, c] = np.minimum(height, 1)
    yield
    relief[r, c] = height


def divided(watershed: Watershed, divisions: NDArray[np.int32]) -> tuple[SpaceSegments, ...]:
    """Divisions by the segments of basins (D, B), at most as fine as the watershed's borders."""
    basins, resolution_m = watershed.basins, watershed.grid.resolution_m
    openings = find_openings(watershed.borders, divisions, resolution_m)
    numbers = (
        freeze(np.concatenate([segment_of, basins.segment_of_line(segment_of)]))
        for segment_of in divisions
    )
    return tuple(SpaceSegments(watershed, *both) for both in zip(numbers, openings, strict=True))


def _require_ratios(ratios: tuple[float, ...]) -> None:
    falling = all(a > b for a, b in pairwise(ratios))
    if not ratios or not falling or not all(0 < ratio <= 1 for ratio in ratios):
        raise InputError(f"ratios must be one or more decreasing numbers in (0, 1], got {ratios}")


def _require_numbers(shape: tuple[int, int]) -> None:
    """Cells are numbered with 32 bits, including a frame of one cell."""
    if (shape[0] + 2) * (shape[1] + 2) > np.iinfo(np.int32).max:
        raise InputError(
            f"segments need a map of less than 2^31 cells, got {shape[0]} x {shape[1]}; "
            "coarsen it, or cut it into parts"
        )


def _divisions(
    basins: Basins, relief: NDArray[np.int32], ratios: tuple[float, ...], resolution_m: float
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """(R, B) segment of each basin for each ratio, and the cells where basins touch."""
    steps = neighbour_steps(relief.shape[1])
    passes, touching = highest_passes(
        basins.raster.reshape(-1), relief.reshape(-1), steps, basins.count
    )
    passes = passes[np.argsort(-passes[:, 2], kind="stable")]
    pairs = np.ascontiguousarray(passes[:, :2])
    widths = half_width_m(passes[:, 2], resolution_m)
    radii = half_width_m(basins.summit[: basins.count], resolution_m)
    divisions = np.empty((len(ratios), basins.count), np.int32)
    for root, ratio in zip(divisions, ratios, strict=True):
        area = basins.area[: basins.count].copy()
        merge_basins(pairs, widths, radii.copy(), area, ratio, _LEAST_RADIUS_M, root)
        number = np.cumsum(root == np.arange(basins.count)) - 1  # a root is its own parent
        root[:] = number[root]
    return divisions, touching


def _borders(
    basins: Basins,
    relief: NDArray[np.int32],
    divisions: NDArray[np.int32],
    touching: NDArray[np.int32],
    grid: OccupancyGrid,
) -> Borders:
    """The sites where basins of different segments of any division touch."""
    sites = border_sites(
        basins.raster.reshape(-1),
        relief.reshape(-1),
        neighbour_steps(relief.shape[1]),
        basins.count,
        divisions,
        grid.cells,
        FREE,
        touching,
    )
    is_side, is_free = np.ascontiguousarray(sites[:, 4:6].T, np.bool_)
    return Borders(sites[:, :2].copy(), sites[:, 2:4].copy(), sites[:, 6].copy(), is_side, is_free)
