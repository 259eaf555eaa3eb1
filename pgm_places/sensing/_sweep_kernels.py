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
    edges[at] = min(edge, old_edge)
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
    edges[at] = max(edge, old_edge)
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


@inlined
def _paint_near_sides(
    pairs: NDArray[np.int32],
    edges: NDArray[np.float32],
    origin: int,
    sides: NDArray[np.int32],
    first: int,
    last: int,
    flip: int,
    face: int,
    log_bins: int,
    n_places: int,
    lift: int,
    bin_number: int,
    edge: np.float32,
) -> None:
    """Paint runs of near sides of one column.

    u of the corner at row y is bin ``bin_number + K y`` plus the fraction ``edge`` of a bin; place
    p of plane 0 is at ``origin + p``. Runs are cut to the places from ``lift`` on that there are.
    """
    n_bins = 1 << log_bins
    in_plane = bin_number & (n_bins - 1)
    place = bin_number >> log_bins
    word = (face << 16) | face
    for run in range(first, last):
        low, high = sides[run, 0], sides[run, 1]
        if flip:
            low, high = flip - high, flip - low
        low = max(low + place, lift + 1)
        high = min(high + place, lift + n_places - 2)
        if low >= high:
            continue
        if high - low < _LONG_RUN:
            for b in range(in_plane + 1, in_plane + (high - low) * n_bins):
                pairs[origin + (b & (n_bins - 1)) * n_places + (b >> log_bins) + low] = word
        else:
            for plane in range(n_bins):
                # Planes beyond the corner's own begin in the first place, the others one later.
                begin = origin + plane * n_places + low + (1 if plane <= in_plane else 0)
                n = high - low - (1 if plane == in_plane else 0)
                for at in range(begin, begin + n):
                    pairs[at] = word
        corner = origin + in_plane * n_places
        _cover_upper_part(pairs, edges, corner + low, face, edge)
        _cover_lower_part(pairs, edges, corner + high, face, edge)


@inlined
def _paint_lower_sides(
    pairs: NDArray[np.int32],
    edges: NDArray[np.float32],
    origin: int,
    runs: NDArray[np.int32],
    first: int,
    last: int,
    flip: int,
    log_bins: int,
    n_places: int,
    lift: int,
    low_bin: int,
    low_edge: np.float32,
    high_bin: int,
    high_edge: np.float32,
) -> None:
    """Paint the lower sides of one column's blocked runs, from ``low_bin`` to ``high_bin``."""
    in_plane = (1 << log_bins) - 1
    low_at = origin + (low_bin & in_plane) * n_places + (low_bin >> log_bins)
    high_at = origin + (high_bin & in_plane) * n_places + (high_bin >> log_bins)
    lowest = max(lift + 1 - (high_bin >> log_bins), 1)  # the region's own rim faces nobody
    highest = lift + n_places - 2 - (high_bin >> log_bins)
    for run in range(first, last):
        y = flip - runs[run, 1] if flip else runs[run, 0]
        if y < lowest or y > highest:
            continue
        face = -1 - y
        if low_bin < high_bin:
            word = (face << 16) | (face & 0xFFFF)
            for b in range(low_bin + 1, high_bin):
                pairs[origin + (b & in_plane) * n_places + (b >> log_bins) + y] = word
            _cover_upper_part(pairs, edges, low_at + y, face, low_edge)
            _cover_lower_part(pairs, edges, high_at + y, face, high_edge)
        else:
            _cover_inside(pairs, edges, low_at + y, face, low_edge, high_edge)


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
        out[i] = min(to_near if face >= 0 else to_lower, cap)
        mixed |= np.int32(nodes_here[i] >= 0) & np.int32(face == MIXED)
    return mixed != 0


@njit
def _follow_mixed(
    readings: NDArray[np.float32],
    at: int,
    nodes: NDArray[np.int32],
    begin: int,
    end: int,
    blocked: NDArray[np.uint8],
    x_is_major: bool,
    column: int,
    row_of_tile: int,
    flip: int,
    beams: NDArray[np.float64],
    beam: int,
    limit: float,
    cap: np.float32,
) -> None:
    """Follow the rays of one column cell by cell whose readings are negative: not known.

    Row 0 of the tile reads ``readings[at]``.
    """
    for y in range(begin, end):
        if readings[at + y] >= 0.0 or nodes[y] < 0:
            continue
        row = row_of_tile + y
        if flip:
            row = flip - 1 - row
        readings[at + y] = centre_range(
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
    of_beams = readings.reshape(n_beams, -1)
    for i in range(n_cells):
        if i + _PREFETCH_AHEAD < n_cells:
            begin = np.int64(nodes[cells[i + _PREFETCH_AHEAD]]) * out.shape[1] + first_beam
            for beam in range(0, n_beams, 16):
                prefetch(flat, begin + beam)
            prefetch(flat, begin + n_beams - 1)
        y = cells[i]
        scan = out[nodes[y], first_beam : first_beam + n_beams]
        for beam in range(n_beams):
            scan[beam] = of_beams[beam, y]


@njit
def sweep(
    blocked: NDArray[np.uint8],
    near_starts: NDArray[np.int64],
    near_sides: NDArray[np.int32],
    run_starts: NDArray[np.int64],
    blocked_runs: NDArray[np.int32],
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
    first_beam: int,
    out: NDArray[np.float32],
) -> None:
    """Write the ranges of a tile's wanted cells along neighbouring beams of one octant.

    Lists are in compressed columns, those of column i are ``starts[i]:starts[i + 1]``; they are not
    mirrored, they are mirrored as they are read.

    Parameters
    ----------
    blocked : (rows, columns) of the map, not swapped
        The region that the tile's beams can reach, with a blocked rim.
    near_starts, near_sides
        Runs of exposed near sides in each column of the region.
    run_starts, blocked_runs
        Runs of blocked cells.
    wanted_starts, wanted_runs, nodes_of_tile
        Runs of wanted cells in each column of the tile, and the row of ``out`` of each cell.
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
    pairs, edges, readings, rows, nodes, cells, spans
        Working memory; ``rows`` holds -1.5 - y of the tile's rows: less a lower side's number
        -1 - Y that is the way Y - y - 0.5.
    first_beam, out : (cells, all beams)
        The beams are ``first_beam`` and the following.
    """
    n_beams = len(beams)
    n_bins_of_beam, n_rows_of_beam = len(pairs) // n_beams, len(readings) // n_beams
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
        near_first, near_last = near_starts[i], near_starts[i + 1]
        run_first, run_last = run_starts[i], run_starts[i + 1]
        for beam in range(n_beams):
            if x > beams[beam, LAST_COLUMN]:
                continue
            slope = beams[beam, SLOPE]
            log_bins = int(beams[beam, LOG_BINS])
            n_bins = 1 << log_bins
            n_places = int(beams[beam, N_PLACES])
            # Where in the flat arrays place 0 of the tile's plane 0 and row 0's reading are.
            origin = beam * n_bins_of_beam - int(beams[beam, LIFT])
            first_reading = beam * n_rows_of_beam
            if n_spans > 0:
                u = (beams[beam, SHIFT] + 0.5 - slope * (map_column + x + 0.5)) * n_bins
                b = int(u - _BEFORE_TIE)
                fraction = np.float32(u - _BEFORE_TIE - b)
                at = origin + (b & (n_bins - 1)) * n_places + (b >> log_bins) + tile_row
                for s in range(n_spans):
                    begin, end = spans[s, 0], spans[s, 1]
                    mixed = _look_up(
                        pairs,
                        edges,
                        at + begin,
                        rows,
                        nodes,
                        begin,
                        end - begin,
                        fraction,
                        np.float32(x + 0.5),
                        np.float32(beams[beam, METRES_MAJOR]),
                        np.float32(beams[beam, METRES_MINOR]),
                        cap,
                        readings,
                        first_reading + begin,
                    )
                    if mixed:
                        _follow_mixed(
                            readings,
                            first_reading,
                            nodes,
                            begin,
                            end,
                            blocked,
                            x_is_major,
                            i,
                            tile_row,
                            flip,
                            beams,
                            beam,
                            limit,
                            cap,
                        )
            if near_first == near_last and run_first == run_last:
                continue
            u = (beams[beam, SHIFT] - slope * (map_column + x)) * n_bins
            left_bin = int(u)
            left_edge = np.float32(u - left_bin)
            _paint_near_sides(
                pairs,
                edges,
                origin,
                near_sides,
                near_first,
                near_last,
                flip,
                x,
                log_bins,
                n_places,
                int(beams[beam, LIFT]),
                left_bin,
                left_edge,
            )
            if slope > 0.0:
                u = (beams[beam, SHIFT] - slope * (map_column + x + 1)) * n_bins
                right_bin = int(u)
                _paint_lower_sides(
                    pairs,
                    edges,
                    origin,
                    blocked_runs,
                    run_first,
                    run_last,
                    flip,
                    log_bins,
                    n_places,
                    int(beams[beam, LIFT]),
                    right_bin,
                    np.float32(u - right_bin),
                    left_bin,
                    left_edge,
                )
        if n_cells > 0:
            _write_column(nodes, cells, n_cells, readings, n_beams, first_beam, out)
