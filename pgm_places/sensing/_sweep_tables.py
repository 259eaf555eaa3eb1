"""What a sweep reads and writes: arrays that its kernels know by ``_sweep_tables.hpp``.

Columns and rows are those of the octant: mirrored and swapped so that its beams go right and up.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

BLOCK = 32
"""Cells looked up at a time; buffers are padded by as many."""


class Listed(NamedTuple):
    """Entries in compressed columns: those of column i are ``starts[i]`` to ``starts[i + 1]``."""

    starts: NDArray[np.int64]
    """(columns + 1,)."""
    entries: NDArray[np.int32]
    """(n, ...)."""


class Region(NamedTuple):
    """What the beams from a tile can reach, with a blocked rim.

    Lists of faces are by columns counted from the map's own end even if the frame is ``backward``;
    if it is ``downward`` they are mirrored, columns and rows, so that rows go up in any case.
    """

    blocked: NDArray[np.uint8]
    """(rows, columns) of the map, neither mirrored nor swapped."""
    near: Listed
    """Begin and end (n, 2) of the runs of exposed near sides."""
    lower: Listed
    """Rows (n,) of the exposed lower sides."""


class TileCells(NamedTuple):
    """The cells of a tile that want ranges, by columns along a major axis, not mirrored."""

    nodes: NDArray[np.int32]
    """(columns, rows) row of the output for each cell, -1 where none is wanted."""
    runs: Listed
    """Begin and end (n, 2) of the runs of wanted cells."""


class Frame(NamedTuple):
    """How an octant and a tile lie in the map."""

    x_is_major: bool
    """Whether the octant's columns are the map's columns."""
    backward: bool
    """Whether its columns count down along the map's axis,"""
    downward: bool
    """and whether its rows do."""
    tile_column: int
    """Where the tile begins in the region, mirrored."""
    tile_row: int
    map_column: int
    """Column of the map, mirrored, where the region begins."""


class Rays(NamedTuple):
    """Neighbouring beams of one octant, and how far they reach."""

    beams: NDArray[np.float64]
    """(n, 14) numbers of each beam, as :meth:`TileSweep._table` lists them."""
    limit: float
    """Maximum range in cells."""
    cap: np.float32
    """Maximum range in metres."""


class Pictures(NamedTuple):
    """The pictures of all beams, one after the other."""

    pairs: NDArray[np.int32]
    """(beams * bins,) lower and upper face of each bin."""
    edges: NDArray[np.float32]
    """(beams * bins,) position of the edge between the two, 0 to 1."""


class Column(NamedTuple):
    """Working memory for the column in hand."""

    rows: NDArray[np.float32]
    """(rows,) -1.5 - y of the tile's rows: less a lower side's number -1 - Y that is the distance
    Y - y - 0.5."""
    nodes: NDArray[np.int32]
    """(rows,) row of the output of each cell, -1 where none is wanted."""
    cells: NDArray[np.int32]
    """(rows,) rows of the wanted cells, as many as there are."""
    spans: NDArray[np.int32]
    """(m, 2) begin and end of the stretches of cells that are looked up together."""
    readings: NDArray[np.float32]
    """(beams * stride,) ranges."""
    starts: NDArray[np.int64]
    """(beams,) first bin that the column looks into,"""
    fractions: NDArray[np.float32]
    """(beams,) and where in it,"""
    mixed: NDArray[np.bool_]
    """(beams,) and whether some reading could not be told."""


class Output(NamedTuple):
    """Where ranges are written to."""

    ranges: NDArray[np.float32]
    """(cells * n_all,)."""
    first_beam: int
    """Place of the first of the beams in a row ..."""
    n_all: int
    """... of so many."""
