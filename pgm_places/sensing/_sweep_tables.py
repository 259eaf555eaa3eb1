"""Input and output arrays of the sweep kernels, as declared in ``_sweep_tables.hpp``.

Columns and rows are those of the octant: mirrored and swapped so that its beams go right and up.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

BLOCK = 32
"""Cells per look-up; buffers are padded by this number."""


class Listed(NamedTuple):
    """Entries in compressed columns: those of column i are ``starts[i]`` to ``starts[i + 1]``."""

    starts: NDArray[np.int64]
    """(columns + 1,)."""
    entries: NDArray[np.int32]
    """(n, ...)."""


class SweepRegion(NamedTuple):
    """The region that beams from a tile can reach, with a blocked rim.

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
    """The wanted cells of a tile, by columns along a major axis, not mirrored."""

    nodes: NDArray[np.int32]
    """(columns, rows) output row of each cell, -1 for unwanted cells."""
    runs: Listed
    """Begin and end (n, 2) of the runs of wanted cells."""


class SweepFrame(NamedTuple):
    """Orientation of an octant, and position of a tile, in the map."""

    x_is_major: bool
    """Whether the octant's columns are the map's columns."""
    backward: bool
    """Whether its columns count down along the map's axis."""
    downward: bool
    """Whether its rows count down along the map's axis."""
    tile_column: int
    """Start of the tile in the mirrored region."""
    tile_row: int
    map_column: int
    """Start column of the region in the mirrored map."""


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
    """Working memory for the current column."""

    rows: NDArray[np.float32]
    """(rows,) -1.5 - y of the tile's rows: less a lower side's number -1 - Y that is the distance
    Y - y - 0.5."""
    nodes: NDArray[np.int32]
    """(rows,) output row of each cell, -1 for unwanted cells."""
    cells: NDArray[np.int32]
    """(rows,) rows of the wanted cells; the rest is unused."""
    spans: NDArray[np.int32]
    """(m, 2) begin and end of the stretches of cells that are looked up together."""
    readings: NDArray[np.float32]
    """(beams * stride,) ranges."""
    starts: NDArray[np.int64]
    """(beams,) first bin of the column."""
    fractions: NDArray[np.float32]
    """(beams,) position in the first bin."""
    mixed: NDArray[np.bool_]
    """(beams,) whether some range is ambiguous in the picture."""


class SweepOutput(NamedTuple):
    """The output array of ranges."""

    ranges: NDArray[np.float32]
    """(cells * n_all,)."""
    first_beam: int
    """Index of the group's first beam in a row."""
    n_all: int
    """Number of beams in a row."""
