"""Ranges from all cells of a tile along the beams of one octant, swept column by column.

All cells share the same directions. Mirror and swap axes so that a direction goes right and up with
slope m from 0 to 1. A ray keeps its ``u = y - m x`` all the way, so a picture of what a viewer far
to the left sees is one-dimensional: for every u, the first face. Columns are swept from right to
left. The cells of a column look their faces up in the picture of all that lies to the right of
them, then the column's own blocked cells are painted over it:

    near side of cell (X, Y), facing left      u from Y - m X        to Y + 1 - m X
    lower side, facing down                    u from Y - m (X + 1)  to Y - m X

A near side is ``(X - x) / major`` away from a cell centre at x, a lower side ``(Y - y) / minor``.

Columns and rows are counted in the tile's region, a window of the map that holds all that its beams
can reach; but fractions of u are computed from columns counted in the whole map, so that every tile
sees the same bins and the tiling does not change a bit of the result.
"""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit, prefetch
from pgm_places.sensing._dda_kernels import centre_range
from pgm_places.sensing._picture_kernels import answer_column, paint_column
from pgm_places.sensing._sweep_tables import (
    BLOCK,
    METRES_X,
    METRES_Y,
    PER_X,
    PER_Y,
    STEP_X,
    STEP_Y,
)

__all__ = ["sweep"]

_PREFETCH_AHEAD = 16  # cells between fetching a line of the output and writing it; measured


@njit
def _open_column(
    runs: NDArray[np.int32],
    first: int,
    last: int,
    nodes_of_column: NDArray[np.int32],
    downward: bool,
    nodes: NDArray[np.int32],
    cells: NDArray[np.int32],
    spans: NDArray[np.int32],
) -> tuple[int, int]:
    """Note one column's wanted cells; returns how many cells and spans there are.

    ``nodes`` gets the output's row of each wanted cell and -1 elsewhere, ``cells`` the rows of the
    wanted cells, ``spans`` the begin and end of stretches of cells that are looked up together.
    """
    n_rows = len(nodes_of_column)
    for y in range(len(nodes)):
        nodes[y] = -1
    n_cells = n_spans = 0
    for k in range(last - first):
        run = last - 1 - k if downward else first + k  # upside down the last run comes first
        begin, end = runs[run, 0], runs[run, 1]
        if downward:
            begin, end = n_rows - end, n_rows - begin
        for y in range(begin, end):
            nodes[y] = nodes_of_column[n_rows - 1 - y if downward else y]
            cells[n_cells] = y
            n_cells += 1
        if n_spans > 0 and begin - spans[n_spans - 1, 1] < BLOCK:
            spans[n_spans - 1, 1] = end
        else:
            spans[n_spans, 0] = begin
            spans[n_spans, 1] = end
            n_spans += 1
    return n_cells, n_spans


@njit
def _follow_mixed(
    mixed: NDArray[np.bool_],
    cells: NDArray[np.int32],
    n_cells: int,
    blocked: NDArray[np.uint8],
    x_is_major: bool,
    column: int,
    tile_row: int,
    flip: int,
    beams: NDArray[np.float64],
    limit: float,
    cap: np.float32,
    readings: NDArray[np.float32],
) -> None:
    """Follow those rays of one column cell by cell whose readings are negative: not known."""
    for beam in range(len(beams)):
        if not mixed[beam]:
            continue
        first = beam * (len(readings) // len(beams))
        for k in range(n_cells):
            if readings[first + cells[k]] >= 0.0:
                continue
            row = tile_row + cells[k]
            if flip:
                row = flip - 1 - row
            readings[first + cells[k]] = centre_range(
                blocked,
                row if x_is_major else column,
                column if x_is_major else row,
                int(beams[beam, STEP_X]),
                int(beams[beam, STEP_Y]),
                beams[beam, PER_X],
                beams[beam, PER_Y],
                np.float32(beams[beam, METRES_X]),
                np.float32(beams[beam, METRES_Y]),
                limit,
                cap,
            )


@njit
def _write_column(
    nodes: NDArray[np.int32],
    cells: NDArray[np.int32],
    n_cells: int,
    readings: NDArray[np.float32],
    n_beams: int,
    first_beam: int,
    n_all: int,
    out: NDArray[np.float32],
) -> None:
    """Turn one column's readings (beams, rows) into parts of the output's rows (cells, n_all)."""
    stride = len(readings) // n_beams
    for i in range(n_cells):
        if i + _PREFETCH_AHEAD < n_cells:
            begin = np.int64(nodes[cells[i + _PREFETCH_AHEAD]]) * n_all + first_beam
            for beam in range(0, n_beams, 16):
                prefetch(out, begin + beam)
            prefetch(out, begin + n_beams - 1)
        source = np.uint64(cells[i])
        target = np.uint64(np.int64(nodes[cells[i]]) * n_all + first_beam)
        for _ in range(n_beams):
            out[target] = readings[source]
            target += np.uint64(1)
            source += np.uint64(stride)


@njit
def sweep(
    blocked: NDArray[np.uint8],
    near_starts: NDArray[np.int64],
    near_sides: NDArray[np.int32],
    lower_starts: NDArray[np.int64],
    lower_sides: NDArray[np.int32],
    wanted_starts: NDArray[np.int64],
    wanted_runs: NDArray[np.int32],
    nodes_of_tile: NDArray[np.int32],
    x_is_major: bool,
    backward: bool,
    downward: bool,
    tile_column: int,
    tile_row: int,
    map_column: int,
    beams: NDArray[np.float64],
    limit: float,
    cap: np.float32,
    pairs: NDArray[np.int32],
    edges: NDArray[np.float32],
    readings: NDArray[np.float32],
    rows: NDArray[np.float32],
    nodes: NDArray[np.int32],
    cells: NDArray[np.int32],
    spans: NDArray[np.int32],
    starts: NDArray[np.int64],
    fractions: NDArray[np.float32],
    mixed: NDArray[np.bool_],
    first_beam: int,
    n_all: int,
    out: NDArray[np.float32],
) -> None:
    """Write the ranges of a tile's wanted cells along neighbouring beams of one octant.

    Lists are in compressed columns, those of column i are ``starts[i]:starts[i + 1]``, counted from
    the map's own end even if ``backward``.

    Parameters
    ----------
    blocked : (rows, columns) of the map, not swapped
        The region that the tile's beams can reach, with a blocked rim.
    near_starts, near_sides
        Begin and end of runs of exposed near sides in each column of the region. If ``downward``
        the whole list is mirrored, its columns and its rows, so that rows go up in any case.
    lower_starts, lower_sides
        Rows of exposed lower sides, likewise.
    wanted_starts, wanted_runs, nodes_of_tile
        Runs of wanted cells in each column of the tile and the row of ``out`` of each cell, not
        mirrored.
    x_is_major, backward, downward
        How the octant lies in the map: whether its columns are the map's, whether they count down
        along the map's axis, and whether its rows do.
    tile_column, tile_row
        Where the tile begins in the region, mirrored.
    map_column
        Column of the map, mirrored, where the region begins.
    beams : (n, N_FIELDS)
        See the fields in `_sweep_tables`.
    limit, cap
        Maximum range in cells and in metres.
    pairs, edges, readings, rows, nodes, cells, spans, starts, fractions, mixed
        Working memory; ``rows`` holds -1.5 - y of the tile's rows: less a lower side's number
        -1 - Y that is the way Y - y - 0.5.
    first_beam, n_all, out : (cells * n_all,)
        The beams are ``first_beam`` and the following of the ``n_all`` in a row of the output.
    """
    n_beams = len(beams)
    n_columns, n_rows = len(near_starts) - 1, blocked.size // (len(near_starts) - 1)
    flip = n_rows if downward else 0
    tile_end = tile_column + len(nodes_of_tile)
    # Where nothing gets painted, the face is so far away that the range is the maximum.
    far = tile_end + int(limit) + 2
    pairs[:] = (far << 16) | far
    for x in range(min(tile_end + int(limit) + 1, n_columns - 1), tile_column - 1, -1):
        i = n_columns - 1 - x if backward else x
        n_cells = n_spans = 0
        if x < tile_end:
            k = tile_end - 1 - x if backward else x - tile_column
            n_cells, n_spans = _open_column(
                wanted_runs,
                wanted_starts[k],
                wanted_starts[k + 1],
                nodes_of_tile[k],
                downward,
                nodes,
                cells,
                spans,
            )
        map_x = map_column + x
        if n_cells > 0:
            answer_column(
                spans,
                n_spans,
                nodes,
                rows,
                tile_row,
                x,
                map_x,
                beams,
                cap,
                pairs,
                edges,
                readings,
                starts,
                fractions,
                mixed,
            )
            _follow_mixed(
                mixed,
                cells,
                n_cells,
                blocked,
                x_is_major,
                i,
                tile_row,
                flip,
                beams,
                limit,
                cap,
                readings,
            )
            _write_column(nodes, cells, n_cells, readings, n_beams, first_beam, n_all, out)
        k = n_columns - 1 - i if downward else i
        if near_starts[k] < near_starts[k + 1] or lower_starts[k] < lower_starts[k + 1]:
            paint_column(
                near_sides,
                near_starts[k],
                near_starts[k + 1],
                lower_sides,
                lower_starts[k],
                lower_starts[k + 1],
                x,
                map_x,
                beams,
                pairs,
                edges,
            )
