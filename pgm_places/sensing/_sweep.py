"""Sweep-line ray casting: the surroundings of a tile by octant, and the beams' pictures."""

from dataclasses import dataclass
from itertools import pairwise
from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places._core import list_runs, sweep
from pgm_places.sensing.sensor import OCTANTS, Beams, Octant, Ways

BLOCK = 32
"""Cells per look-up; buffers are padded by this number."""


class Listed(NamedTuple):
    """Entries in compressed columns: those of column i are ``starts[i]`` to ``starts[i + 1]``."""

    starts: NDArray[np.int64]  # (columns + 1,)
    entries: NDArray[np.int32]  # (n, ...)


class SweepRegion(NamedTuple):
    """The region that beams from a tile can reach, with a blocked rim.

    Lists of faces count columns from the map's own end, even if the frame is ``backward``; if it is
    ``downward`` they are mirrored so that rows go up.
    """

    blocked: NDArray[np.uint8]  # (rows, columns) of the map, neither mirrored nor swapped
    near: Listed  # begin and end (n, 2) of the runs of exposed near sides
    lower: Listed  # rows (n,) of the exposed lower sides


class TileCells(NamedTuple):
    """The wanted cells of a tile, by columns along a major axis, not mirrored."""

    nodes: NDArray[np.int32]  # (columns, rows) output row of each cell, -1 for unwanted cells
    runs: Listed  # begin and end (n, 2) of the runs of wanted cells


class SweepFrame(NamedTuple):
    """Orientation of an octant, and position of a tile, in the map."""

    x_is_major: bool  # whether the octant's columns are the map's columns
    backward: bool  # whether its columns count down along the map's axis
    downward: bool  # whether its rows count down along the map's axis
    tile_column: int  # start of the tile in the mirrored region
    tile_row: int
    map_column: int  # start column of the region in the mirrored map


class Rays(NamedTuple):
    """Neighbouring beams of one octant, and how far they reach."""

    # (n, 14) numbers of each beam, as :meth:`TileSweep._table` lists them.
    beams: NDArray[np.float64]
    limit: float  # maximum range in cells
    cap: np.float32  # maximum range in metres


class Pictures(NamedTuple):
    """The pictures of all beams, one after the other."""

    pairs: NDArray[np.int32]  # (beams * bins,) lower and upper face of each bin
    edges: NDArray[np.float32]  # (beams * bins,) position of the edge between the two, 0 to 1


class Column(NamedTuple):
    """Working memory for the current column."""

    # (rows,) -1.5 - y of the tile's rows: minus the number -1 - Y of a lower side: the distance
    # Y - y - 0.5.
    rows: NDArray[np.float32]
    nodes: NDArray[np.int32]  # (rows,) output row of each cell, -1 for unwanted cells
    cells: NDArray[np.int32]  # (rows,) rows of the wanted cells; the rest is unused
    # (m, 2) begin and end of the stretches of cells that are looked up together.
    spans: NDArray[np.int32]
    readings: NDArray[np.float32]  # (beams * stride,) ranges
    starts: NDArray[np.int64]  # (beams,) first bin of the column
    fractions: NDArray[np.float32]  # (beams,) position in the first bin
    mixed: NDArray[np.bool_]  # (beams,) whether some range is ambiguous in the picture


class SweepOutput(NamedTuple):
    """The output array of ranges."""

    ranges: NDArray[np.float32]  # (cells * n_all,)
    first_beam: int  # index of the group's first beam in a row
    n_all: int  # number of beams in a row


LARGEST_REGION = 32_000
"""Largest sum of rows, columns and reach, in cells, for 16-bit face numbers."""

_LOG_BINS = (
    4  # bins for each cell of u: 2 to this power; half as many leave 5 times more rays MIXED
)
_LOG_BINS_SHALLOW = 5
_SHALLOW = 0.06  # below this slope a lower side is narrower than a bin of the coarser kind
_LONGEST_GROUP = 48  # beams swept together: more fill whole cache lines of the output, ...
_GROUPS_PER_THREAD = 4  # ... fewer keep many threads equally busy


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The faces that beams meet in a region, by columns along a major axis."""

    blocked: NDArray[np.uint8]  # (rows, columns) the region with its rim, in the map's orientation
    n_rows: int  # length of a column
    # met_forward, met_backward: begin and end of the runs of faces at the borders of columns
    met_forward: Listed
    met_backward: Listed
    solid: Listed  # begin and end of the runs of blocked cells

    @classmethod
    def of(cls, blocked: NDArray[np.uint8], x_is_major: bool) -> "Surroundings":
        """The faces of the region ``blocked``."""
        solid = np.ascontiguousarray(blocked.T if x_is_major else blocked)
        mask = _row_mask(solid.shape)
        cells = mask[:, : solid.shape[1]]
        # The region's rim has no faces.
        np.greater(solid[1:], solid[:-1], out=cells[1:].view(np.bool_))
        met_forward = _runs(mask)
        cells[-1] = 0
        np.greater(solid[:-1], solid[1:], out=cells[:-1].view(np.bool_))
        met_backward = _runs(mask)
        cells[:] = solid
        return cls(blocked, solid.shape[1], met_forward, met_backward, _runs(mask))

    def faces(self, backward: bool, downward: bool) -> tuple[Listed, Listed]:
        """Near sides (begin and end of runs) and lower sides (rows) in the frame of an octant.

        If ``downward``, columns and rows are mirrored, so that rows go up.
        """
        near = self.met_backward if backward else self.met_forward
        solid = self.solid
        if downward:
            near, solid = _mirrored(near, self.n_rows), _mirrored(solid, self.n_rows)
        starts, runs = solid
        inside = runs[:, 0] > 0  # faces on the region's rim are not visible
        before = np.concatenate(([0], np.cumsum(inside)))
        return near, Listed(before[starts], runs[inside, 0])


def _mirrored(listed: Listed, n_rows: int) -> Listed:
    """Runs mirrored: columns in opposite order, rows counted from the other end."""
    starts, runs = listed
    mirrored = np.ascontiguousarray(n_rows - runs[::-1, ::-1], np.int32)
    return Listed(len(runs) - starts[::-1], mirrored)


def tile_cells(nodes: NDArray[np.int32], x_is_major: bool) -> TileCells:
    """The cells of a tile whose entry in ``nodes`` (rows, columns), -1 for none, is at least 0."""
    nodes = np.ascontiguousarray(nodes.T if x_is_major else nodes)
    mask = _row_mask(nodes.shape)
    np.greater_equal(nodes, 0, out=mask[:, : nodes.shape[1]].view(np.bool_))
    return TileCells(nodes, _runs(mask))


def _row_mask(shape: tuple[int, int]) -> NDArray[np.uint8]:
    """A zero buffer for rows of a length plus at least one entry, in multiples of eight."""
    return np.zeros((shape[0], (shape[1] + 8) // 8 * 8), np.uint8)


def _runs(mask: NDArray[np.uint8]) -> Listed:
    """Begin and end of the runs of ones in the rows of a mask."""
    starts = np.empty(len(mask) + 1, np.int64)
    words = mask.view(np.uint64)
    n_runs = list_runs(words, mask, starts, np.empty((0, 2), np.int32))
    runs = np.empty((n_runs, 2), np.int32)
    list_runs(words, mask, starts, runs)
    return Listed(starts, runs)


@dataclass(frozen=True)
class BeamGroup:
    """Beams ``first`` to ``last - 1`` of one octant, which are swept together."""

    octant: Octant
    first: int
    last: int


def work_bytes(height: int, width: int) -> int:
    """Upper bound of the working memory for one group of beams over a tile of some cells."""
    places = height + width + 6 + BLOCK
    return _LONGEST_GROUP * (8 * (places << _LOG_BINS_SHALLOW) + 4 * (places + 2 * BLOCK))


def beam_groups(beams: Beams, n_threads: int) -> list[BeamGroup]:
    """All beams in groups, few but enough for the threads."""
    groups = []
    parts = max(1, ceil(n_threads * _GROUPS_PER_THREAD / 8))
    for index, octant in enumerate(OCTANTS):
        begin, end = (int(i) for i in np.searchsorted(beams.octant, (index, index + 1)))
        if begin == end:
            continue
        n_groups = max(ceil((end - begin) / _LONGEST_GROUP), min(parts, end - begin))
        cuts = [begin + (end - begin) * i // n_groups for i in range(n_groups + 1)]
        groups += [BeamGroup(octant, a, b) for a, b in pairwise(cuts)]
    return groups


class Work:
    """Reusable working memory of a sweep, which grows as needed."""

    def __init__(self) -> None:
        self._memory = np.empty(0, np.int32)

    def fit(self, n_beams: int, n_bins: int, n_rows: int, tile_row: int) -> tuple[Pictures, Column]:
        """Room for ``n_beams`` pictures of ``n_bins`` bins and a column of ``n_rows`` rows.

        The tile begins at ``tile_row``.
        """
        stride = (n_rows + 15) // 32 * 32 + 16  # odd in cache lines: beams do not collide
        n_spans = n_rows // BLOCK + 1
        sizes = (n_beams * n_bins, n_beams * n_bins, n_beams * stride, n_rows, n_rows, 2 * n_spans)
        if len(self._memory) < sum(sizes):
            self._memory = np.empty(sum(sizes), np.int32)
        parts = np.split(self._memory[: sum(sizes)], np.cumsum(sizes)[:-1])
        pairs, edges, readings, nodes, cells, spans = parts
        column = Column(
            rows=(-1.5 - tile_row - np.arange(n_rows)).astype(np.float32),
            nodes=nodes,
            cells=cells,
            spans=spans.reshape(n_spans, 2),
            readings=readings.view(np.float32),
            starts=np.empty(n_beams, np.int64),
            fractions=np.empty(n_beams, np.float32),
            mixed=np.empty(n_beams, np.bool_),
        )
        return Pictures(pairs, edges.view(np.float32)), column


@dataclass(frozen=True)
class Extent:
    """A tile and its region along one axis of the map."""

    tile_begin: int
    tile_end: int
    begin: int
    end: int
    of_map: int

    @property
    def length(self) -> int:
        """Cells of the tile."""
        return self.tile_end - self.tile_begin

    def before_tile(self, mirrored: bool) -> int:
        """Cells of the region before the tile."""
        return self.end - self.tile_end if mirrored else self.tile_begin - self.begin

    def on_map(self, mirrored: bool) -> int:
        """Start of the region in the map, from the map's other end if mirrored."""
        return self.of_map - self.end if mirrored else self.begin


@dataclass(frozen=True, eq=False)
class TileSweep:
    """A sensor's beams swept over a map's tile; ``surroundings`` and ``tiles`` per major axis."""

    surroundings: dict[bool, Surroundings]
    tiles: dict[bool, TileCells]
    x: Extent
    y: Extent
    beams: Beams
    ways: Ways
    resolution_m: float
    max_range_m: float

    def sweep(self, group: BeamGroup, work: Work, out: NDArray[np.float32]) -> None:
        """Write the ranges along a group's beams to its columns of ``out`` (rows, all beams)."""
        assert out.flags.c_contiguous  # otherwise the kernel would write to a copy
        octant = group.octant
        around, tile = self.surroundings[octant.x_is_major], self.tiles[octant.x_is_major]
        columns, rows = (self.x, self.y) if octant.x_is_major else (self.y, self.x)
        backward, downward = octant.step_x < 0, octant.step_y < 0
        if not octant.x_is_major:
            backward, downward = downward, backward
        frame = SweepFrame(
            octant.x_is_major,
            backward,
            downward,
            tile_column=columns.before_tile(backward),
            tile_row=rows.before_tile(downward),
            map_column=columns.on_map(backward),
        )
        table, n_bins = self._table(group, frame, columns.length, rows.length)
        reach = self.max_range_m / self.resolution_m
        rays = Rays(table, reach, np.float32(self.max_range_m))
        region = SweepRegion(around.blocked, *around.faces(backward, downward))
        pictures, column = work.fit(len(table), n_bins, rows.length + BLOCK, frame.tile_row)
        output = SweepOutput(out.reshape(-1), group.first, out.shape[1])
        sweep(region, tile, frame, rays, pictures, column, output)

    def _table(
        self, group: BeamGroup, frame: SweepFrame, n_columns: int, n_rows: int
    ) -> tuple[NDArray[np.float64], int]:
        """(n, 14) numbers of each beam for kernels, and the largest number of bins of a beam."""
        part = slice(group.first, group.last)
        major, minor = self.beams.major[part], self.beams.minor[part]
        slope = minor / major
        log_bins = np.where(slope < _SHALLOW, _LOG_BINS_SHALLOW, _LOG_BINS)
        log_bins[(slope == 0) | (slope == 1)] = 0  # all edges lie at integer u
        n_places = n_rows + np.floor(slope * n_columns) + 6 + BLOCK
        shift = np.floor(slope * (self.x.of_map + self.y.of_map)) + 2
        end = frame.tile_column + n_columns
        lowest = np.floor(shift - slope * (frame.map_column + end))
        reach = min(self.max_range_m / self.resolution_m, LARGEST_REGION)
        with np.errstate(divide="ignore"):
            metres_major, metres_minor = self.resolution_m / major, self.resolution_m / minor
        numbers = (  # in the octant's frame, then in the map's, for following single rays
            slope,  # rows a column
            log_bins,  # 2 to this power bins for each cell of u
            shift,  # integer origin of u, so that u is positive on the map
            lowest + frame.tile_row - 2,  # place of u = 0 below the first place of a plane
            n_places,  # length of a plane
            end + np.ceil(reach * major) + 1,  # furthest column that is reached from the tile
            metres_major,  # length of ray for each column
            metres_minor,  # and for each row
            *(numbers[part] for numbers in self.ways),
        )
        return np.column_stack(numbers), int((n_places * 2.0**log_bins).max())
