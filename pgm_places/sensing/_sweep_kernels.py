"""Ranges from all cells of a tile along the beams of one octant, swept column by column.

**The idea.** All cells share the same directions. Mirror and swap axes so that a direction goes
right and up with slope ``m`` from 0 to 1. A ray keeps its ``u = y - m x`` all the way, so a picture
of what a viewer far to the left sees is one-dimensional: for every ``u``, the first face. Columns
are swept from right to left. The cells of a column look their faces up in the picture of all that
lies to the right of them, then the column's own blocked cells are painted over it:

    near side of cell (X, Y), facing left      u from Y - m X        to Y + 1 - m X
    lower side, facing down                    u from Y - m (X + 1)  to Y - m X

A near side is ``(X - x) / major`` away from a cell centre at x, a lower side ``(Y - y) / minor``.

**The picture** has ``K`` bins for each cell of ``u`` (K a power of two). A bin holds one face, or
two with the exact position of the edge between them; where a third would be needed it says
``MIXED``, and the few rays that look there are followed cell by cell instead. Bin ``b`` lies in
plane ``b mod K`` at place ``b // K``: the cell centres of a column all have the same fraction of u,
so they look into neighbouring places of one plane, and the look-up is a vector operation.

**Faces** are 16-bit numbers: X > 0 for a near side, -1 - Y for a lower side. A bin packs its lower
face in the low half of a 32-bit word and its upper face in the high half.

**Coordinates.** Columns and rows are counted in the tile's region, a window of the map that holds
all that its beams can reach; but fractions of u are computed from columns counted in the whole map,
so that every tile sees the same bins and the tiling does not change a bit of the result.
"""

import numpy as np
from numpy.typing import NDArray

from pgm_places._jit import inlined, njit, prefetch
from pgm_places.sensing._dda_kernels import centre_range
from pgm_places.sensing._sweep_tables import (
    BLOCK,
    LAST_COLUMN,
    LIFT,
    LOG_BINS,
    METRES_MAJOR,
    METRES_MINOR,
    METRES_X,
    METRES_Y,
    N_PLACES,
    PER_X,
    PER_Y,
    SHIFT,
    SLOPE,
    STEP_X,
    STEP_Y,
)

__all__ = ["sweep"]

MIXED = 0  # as a near side it would lie behind every viewer: what is read off it is negative

_PREFETCH_AHEAD = 16  # cells between fetching a line of the output and writing it; measured
_LONG_RUN = 12  # cells of a near side from which on its planes are filled one by one; measured
_BEFORE_TIE = 1e-9  # a ray through a corner passes below it: it steps along the major axis first


@njit
def _lower_face(pair: int) -> int:
    return ((pair & 0xFFFF) ^ 0x8000) - 0x8000


@inlined
def _prefetch_bin(pairs: NDArray[np.int32], edges: NDArray[np.float32], at: int) -> None:
    prefetch(pairs, at)
    prefetch(edges, at)


@njit
def _cover_upper_part(
    pairs: NDArray[np.int32], edges: NDArray[np.float32], at: int, face: int, edge: np.float32
) -> None:
    """Paint a bin from ``edge`` (0 to 1) to its end."""
    pair, old_edge = pairs[at], edges[at]
    lower, upper = _lower_face(pair), pair >> 16
    if lower == upper:
        old_edge = np.float32(2.0)  # one face: there is no edge yet
    # Painting from above the old edge leaves a stretch of the old upper face in between.
    kept = MIXED if (edge > old_edge) & (upper != face) else face
    edges[at] = edge if edge < old_edge else old_edge
    pairs[at] = (kept << 16) | (lower & 0xFFFF)


@njit
def _cover_lower_part(
    pairs: NDArray[np.int32], edges: NDArray[np.float32], at: int, face: int, edge: np.float32
) -> None:
    """Paint a bin from its beginning to ``edge`` (0 to 1)."""
    pair, old_edge = pairs[at], edges[at]
    lower, upper = _lower_face(pair), pair >> 16
    if lower == upper:
        old_edge = np.float32(-1.0)
    kept = MIXED if (edge < old_edge) & (lower != face) else face
    edges[at] = edge if edge > old_edge else old_edge
    pairs[at] = (upper << 16) | (kept & 0xFFFF)


@njit
def _cover_inside(
    pairs: NDArray[np.int32],
    edges: NDArray[np.float32],
    at: int,
    face: int,
    begin: np.float32,
    end: np.float32,
) -> None:
    """Paint a bin from ``begin`` to ``end``, both inside it."""
    pair, edge = pairs[at], edges[at]
    lower, upper = _lower_face(pair), pair >> 16
    if lower == upper:
        if lower != face:  # what lies above ``end`` is kept in no bin: MIXED from ``begin`` on
            pairs[at] = (MIXED << 16) | (lower & 0xFFFF)
            edges[at] = begin
    elif end <= edge:
        if lower != face:
            pairs[at] = (upper << 16) | (MIXED & 0xFFFF)
    elif lower == face and begin <= edge:
        edges[at] = end
    elif begin >= edge:
        if upper != face:
            pairs[at] = (MIXED << 16) | (lower & 0xFFFF)
    elif upper == face:
        edges[at] = begin
    else:
        pairs[at] = (MIXED << 16) | (MIXED & 0xFFFF)


@njit
def _paint_column(
    near_sides: NDArray[np.int32],
    first_near: int,
    last_near: int,
    lower_sides: NDArray[np.int32],
    first_lower: int,
    last_lower: int,
    x: int,
    map_x: int,
    beams: NDArray[np.float64],
    pairs: NDArray[np.int32],
    edges: NDArray[np.float32],
) -> None:
    """Paint one column's faces over the pictures of all beams.

    Faces are cut to the places that a picture has.
    """
    n_beams = len(beams)
    for beam in range(n_beams):
        if x > beams[beam, LAST_COLUMN]:
            continue
        log_bins, n_places = int(beams[beam, LOG_BINS]), int(beams[beam, N_PLACES])
        n_bins = 1 << log_bins
        # Bins and places in them of the corners at row 0: on the column's left border ...
        u = (beams[beam, SHIFT] - beams[beam, SLOPE] * map_x) * n_bins
        left_bin = int(u)
        left_edge = np.float32(u - left_bin)
        plane = left_bin & (n_bins - 1)
        lift = (left_bin >> log_bins) - int(beams[beam, LIFT])
        origin = beam * (len(pairs) // n_beams) + lift
        left = origin + plane * n_places
        for k in range(first_near, last_near):  # fetch all, so that none is waited for alone
            _prefetch_bin(pairs, edges, left + near_sides[k, 0])
            _prefetch_bin(pairs, edges, left + near_sides[k, 1])
        for k in range(first_near, last_near):
            begin, end = int(near_sides[k, 0]), int(near_sides[k, 1])
            begin = begin if begin + lift >= 1 else 1 - lift
            end = end if end + lift <= n_places - 2 else n_places - 2 - lift
            if begin >= end:
                continue
            word = (x << 16) | x
            if end - begin < _LONG_RUN:
                for b in range(plane + 1, plane + (end - begin) * n_bins):
                    pairs[origin + (b & (n_bins - 1)) * n_places + (b >> log_bins) + begin] = word
            else:
                for p in range(n_bins):
                    # Planes beyond the corner's own begin in the first place, others one later.
                    first = origin + p * n_places + begin + (1 if p <= plane else 0)
                    last = origin + p * n_places + end + (1 if p < plane else 0)
                    for at in range(first, last):
                        pairs[at] = word
            _cover_upper_part(pairs, edges, left + begin, x, left_edge)
            _cover_lower_part(pairs, edges, left + end, x, left_edge)
        if first_lower == last_lower or beams[beam, SLOPE] == 0.0:
            continue
        # ... and on its right border.
        u = (beams[beam, SHIFT] - beams[beam, SLOPE] * (map_x + 1)) * n_bins
        right_bin = int(u)
        right_edge = np.float32(u - right_bin)
        right_place = (right_bin >> log_bins) - (left_bin >> log_bins)
        plane = right_bin & (n_bins - 1)
        right = origin + plane * n_places + right_place
        for k in range(first_lower, last_lower):
            _prefetch_bin(pairs, edges, right + lower_sides[k])
            _prefetch_bin(pairs, edges, left + lower_sides[k])
        for k in range(first_lower, last_lower):
            y = int(lower_sides[k])
            if y + lift < 1 or y + lift > n_places - 2:
                continue
            face = -1 - y
            if right_bin < left_bin:
                word = (face << 16) | (face & 0xFFFF)
                for b in range(plane + 1, plane + left_bin - right_bin):
                    place = right_place + (b >> log_bins) + y
                    pairs[origin + (b & (n_bins - 1)) * n_places + place] = word
                _cover_upper_part(pairs, edges, right + y, face, right_edge)
                _cover_lower_part(pairs, edges, left + y, face, left_edge)
            else:
                _cover_inside(pairs, edges, right + y, face, right_edge, left_edge)


@njit
def _look_up(
    pairs: NDArray[np.int32],
    edges: NDArray[np.float32],
    at: int,
    rows: NDArray[np.float32],
    nodes: NDArray[np.int32],
    begin: int,
    n: int,
    fraction: np.float32,
    centre: np.float32,
    metres_major: np.float32,
    metres_minor: np.float32,
    cap: np.float32,
    readings: NDArray[np.float32],
    to: int,
) -> bool:
    """Read the ranges of n rows from ``begin`` on off the picture, from bin ``at`` on.

    They are written from ``readings[to]`` on. Returns whether a wanted one is not known; it reads
    negative. Whole blocks are read, so that no loop over a rest is needed; the buffers are long
    enough.
    """
    n = (n + BLOCK - 1) // BLOCK * BLOCK
    faces_here, edges_here = pairs[at : at + n], edges[at : at + n]
    rows_here, nodes_here = rows[begin : begin + n], nodes[begin : begin + n]
    out = readings[to : to + n]
    mixed = np.int32(0)
    for i in range(n):
        pair = faces_here[i]
        face = np.int32(pair >> 16) if fraction >= edges_here[i] else np.int32(_lower_face(pair))
        to_near = (np.float32(face) - centre) * metres_major
        to_lower = (rows_here[i] - np.float32(face)) * metres_minor
        reading = to_near if face >= 0 else to_lower
        out[i] = reading if reading < cap else cap
        mixed |= np.int32(nodes_here[i] >= 0) & np.int32(face == MIXED)
    return mixed != 0


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
    nodes[:] = -1
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
def _answer_column(
    spans: NDArray[np.int32],
    n_spans: int,
    nodes: NDArray[np.int32],
    rows: NDArray[np.float32],
    tile_row: int,
    x: int,
    map_x: int,
    beams: NDArray[np.float64],
    cap: np.float32,
    pairs: NDArray[np.int32],
    edges: NDArray[np.float32],
    readings: NDArray[np.float32],
    starts: NDArray[np.int64],
    fractions: NDArray[np.float32],
    mixed: NDArray[np.bool_],
) -> None:
    """Read one column's spans off the pictures of all beams.

    ``mixed`` notes for which beams some reading is not known.
    """
    n_beams = len(beams)
    for beam in range(n_beams):
        log_bins = int(beams[beam, LOG_BINS])
        n_bins = 1 << log_bins
        u = (beams[beam, SHIFT] + 0.5 - beams[beam, SLOPE] * (map_x + 0.5)) * n_bins
        b = int(u - _BEFORE_TIE)
        fractions[beam] = u - _BEFORE_TIE - b
        place = (b >> log_bins) - int(beams[beam, LIFT]) + tile_row
        plane = beam * (len(pairs) // n_beams) + (b & (n_bins - 1)) * int(beams[beam, N_PLACES])
        starts[beam] = plane + place
    for beam in range(n_beams):
        if beam + 1 < n_beams:
            for k in range(n_spans):
                for y in range(spans[k, 0], spans[k, 1], 16):
                    _prefetch_bin(pairs, edges, starts[beam + 1] + y)
        mixed[beam] = False
        for k in range(n_spans):
            mixed[beam] |= _look_up(
                pairs,
                edges,
                starts[beam] + spans[k, 0],
                rows,
                nodes,
                spans[k, 0],
                spans[k, 1] - spans[k, 0],
                fractions[beam],
                np.float32(x + 0.5),
                np.float32(beams[beam, METRES_MAJOR]),
                np.float32(beams[beam, METRES_MINOR]),
                cap,
                readings,
                beam * (len(readings) // n_beams) + spans[k, 0],
            )


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
    out: NDArray[np.float32],
) -> None:
    """Turn one column's readings (beams, rows) into parts of rows of the output (cells, beams)."""
    flat = out.reshape(-1)
    stride = len(readings) // n_beams
    for i in range(n_cells):
        if i + _PREFETCH_AHEAD < n_cells:
            begin = np.int64(nodes[cells[i + _PREFETCH_AHEAD]]) * out.shape[1] + first_beam
            for beam in range(0, n_beams, 16):
                prefetch(flat, begin + beam)
            prefetch(flat, begin + n_beams - 1)
        source = np.uint64(cells[i])
        target = np.uint64(np.int64(nodes[cells[i]]) * out.shape[1] + first_beam)
        for _ in range(n_beams):
            flat[target] = readings[source]
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
        Begin and end of runs of exposed near sides in each column of the region, mirrored.
    lower_starts, lower_sides
        Rows of exposed lower sides, mirrored.
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
    first_beam, out : (cells, all beams)
        The beams are ``first_beam`` and the following.
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
            _answer_column(
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
            _write_column(nodes, cells, n_cells, readings, n_beams, first_beam, out)
        if near_starts[i] < near_starts[i + 1] or lower_starts[i] < lower_starts[i + 1]:
            _paint_column(
                near_sides,
                near_starts[i],
                near_starts[i + 1],
                lower_sides,
                lower_starts[i],
                lower_starts[i + 1],
                x,
                map_x,
                beams,
                pairs,
                edges,
            )
