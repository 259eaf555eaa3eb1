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
from pgm_places.sensing._dda_kernels import BeamSteps, centre_range
from pgm_places.sensing._picture_kernels import answer_column, paint_column
from pgm_places.sensing._sweep_tables import (
    BLOCK,
    METRES_X,
    METRES_Y,
    PER_X,
    PER_Y,
    STEP_X,
    STEP_Y,
    Column,
    Frame,
    Output,
    Pictures,
    Rays,
    Region,
    TileCells,
)

__all__ = ["sweep"]

_PREFETCH_AHEAD = 16  # cells between fetching a line of the output and writing it; measured


@njit
def _open_column(tile: TileCells, k: int, downward: bool, column: Column) -> tuple[int, int]:
    """Note the wanted cells of column ``k`` of the tile; returns how many cells and spans it has.

    ``column.nodes`` gets the output's row of each wanted cell and -1 elsewhere, ``column.cells``
    the rows of the wanted cells, ``column.spans`` the stretches of cells looked up together.
    """
    nodes, cells, spans = column.nodes, column.cells, column.spans
    first, last = tile.runs.starts[k], tile.runs.starts[k + 1]
    runs, nodes_of_column = tile.runs.entries, tile.nodes[k]
    n_rows = len(nodes_of_column)
    for y in range(len(nodes)):
        nodes[y] = -1
    n_cells = n_spans = 0
    for j in range(last - first):
        run = last - 1 - j if downward else first + j  # upside down the last run comes first
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
    column: Column, n_cells: int, blocked: NDArray[np.uint8], frame: Frame, at: int, rays: Rays
) -> None:
    """Follow cell by cell those rays of a column whose readings are negative: not known.

    The column is column ``at`` of the region, counted along the map's axis.
    """
    beams, cells, readings = rays.beams, column.cells, column.readings
    flip = len(blocked) if frame.x_is_major else blocked.shape[1]
    for beam in range(len(beams)):
        if not column.mixed[beam]:
            continue
        first = beam * (len(readings) // len(beams))
        steps = BeamSteps(
            int(beams[beam, STEP_X]),
            int(beams[beam, STEP_Y]),
            beams[beam, PER_X],
            beams[beam, PER_Y],
            np.float32(beams[beam, METRES_X]),
            np.float32(beams[beam, METRES_Y]),
        )
        for k in range(n_cells):
            if readings[first + cells[k]] >= 0.0:
                continue
            row = frame.tile_row + cells[k]
            if frame.downward:
                row = flip - 1 - row
            start_row, start_column = (row, at) if frame.x_is_major else (at, row)
            readings[first + cells[k]] = centre_range(
                blocked, start_row, start_column, steps, rays.limit, rays.cap
            )


@njit
def _write_column(column: Column, n_cells: int, n_beams: int, output: Output) -> None:
    """Turn one column's readings (beams, rows) into parts of the output's rows (cells, n_all)."""
    nodes, cells, readings, out = column.nodes, column.cells, column.readings, output.ranges
    stride = len(readings) // n_beams
    for i in range(n_cells):
        if i + _PREFETCH_AHEAD < n_cells:
            begin = np.int64(nodes[cells[i + _PREFETCH_AHEAD]]) * output.n_all + output.first_beam
            for beam in range(0, n_beams, 16):
                prefetch(out, begin + beam)
            prefetch(out, begin + n_beams - 1)
        source = np.uint64(cells[i])
        target = np.uint64(np.int64(nodes[cells[i]]) * output.n_all + output.first_beam)
        for _ in range(n_beams):
            out[target] = readings[source]
            target += np.uint64(1)
            source += np.uint64(stride)


@njit
def sweep(
    region: Region,
    tile: TileCells,
    frame: Frame,
    rays: Rays,
    pictures: Pictures,
    column: Column,
    output: Output,
) -> None:
    """Write the ranges of a tile's wanted cells along neighbouring beams of one octant.

    ``pictures`` and ``column`` are working memory.
    """
    near_starts, lower_starts = region.near.starts, region.lower.starts
    n_columns = len(near_starts) - 1
    tile_end = frame.tile_column + len(tile.nodes)
    # Where nothing gets painted, the face is so far away that the range is the maximum.
    far = tile_end + int(rays.limit) + 2
    pictures.pairs[:] = (far << 16) | far
    for x in range(min(tile_end + int(rays.limit) + 1, n_columns - 1), frame.tile_column - 1, -1):
        i = n_columns - 1 - x if frame.backward else x
        n_cells = n_spans = 0
        if x < tile_end:
            k = tile_end - 1 - x if frame.backward else x - frame.tile_column
            n_cells, n_spans = _open_column(tile, k, frame.downward, column)
        if n_cells > 0:
            answer_column(column, n_spans, frame, x, rays, pictures)
            _follow_mixed(column, n_cells, region.blocked, frame, i, rays)
            _write_column(column, n_cells, len(rays.beams), output)
        k = n_columns - 1 - i if frame.downward else i
        if near_starts[k] < near_starts[k + 1] or lower_starts[k] < lower_starts[k + 1]:
            paint_column(region, k, x, frame.map_column + x, rays.beams, pictures)
