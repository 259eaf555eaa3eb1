"""The picture that a sweep paints and reads: for each u the first face, seen from the left.

See :mod:`pgm_places.sensing._sweep_kernels` for what u is. A picture has K bins for each cell of u
(K a power of two). A bin holds one face, or two with the exact position of the edge between them;
where a third would be needed it says ``MIXED``, and the few rays that look there are followed cell
by cell instead.

Bin b lies in plane ``b mod K`` at place ``b // K``. The cell centres of a column all have the same
fraction of u, so they look into neighbouring places of one plane, and the look-up is a vector
operation. The pictures of several beams lie one after the other in flat arrays.

Faces are 16-bit numbers: X > 0 for a near side at column X, -1 - Y for a lower side at row Y. A bin
packs its lower face in the low half of a 32-bit word and its upper face in the high half.
"""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import inlined, njit, prefetch
from pgm_places.sensing._sweep_tables import (
    BLOCK,
    LAST_COLUMN,
    LIFT,
    LOG_BINS,
    METRES_MAJOR,
    METRES_MINOR,
    N_PLACES,
    SHIFT,
    SLOPE,
    Column,
    Frame,
    Pictures,
    Rays,
    Region,
)

__all__ = ["answer_column", "paint_column"]

MIXED = 0  # as a near side it would lie behind every viewer: what is read off it is negative

_LONG_RUN = 12  # cells of a near side from which on its planes are filled one by one; measured
_BEFORE_TIE = 1e-9  # a ray through a corner passes below it: it steps along the major axis first


@njit
def _lower_face(pair: int) -> int:
    return ((pair & 0xFFFF) ^ 0x8000) - 0x8000


@inlined
def _prefetch_bin(pictures: Pictures, at: int) -> None:
    prefetch(pictures.pairs, at)
    prefetch(pictures.edges, at)


@njit
def _cover_upper_part(pictures: Pictures, at: int, face: int, edge: np.float32) -> None:
    """Paint a bin from ``edge`` (0 to 1) to its end."""
    pairs, edges = pictures
    pair, old_edge = pairs[at], edges[at]
    lower, upper = _lower_face(pair), pair >> 16
    if lower == upper:
        old_edge = np.float32(2.0)  # one face: there is no edge yet
    # Painting from above the old edge leaves a stretch of the old upper face in between.
    kept = MIXED if (edge > old_edge) & (upper != face) else face
    edges[at] = edge if edge < old_edge else old_edge
    pairs[at] = (kept << 16) | (lower & 0xFFFF)


@njit
def _cover_lower_part(pictures: Pictures, at: int, face: int, edge: np.float32) -> None:
    """Paint a bin from its beginning to ``edge`` (0 to 1)."""
    pairs, edges = pictures
    pair, old_edge = pairs[at], edges[at]
    lower, upper = _lower_face(pair), pair >> 16
    if lower == upper:
        old_edge = np.float32(-1.0)
    kept = MIXED if (edge < old_edge) & (lower != face) else face
    edges[at] = edge if edge > old_edge else old_edge
    pairs[at] = (upper << 16) | (kept & 0xFFFF)


@njit
def _cover_inside(
    pictures: Pictures, at: int, face: int, begin: np.float32, end: np.float32
) -> None:
    """Paint a bin from ``begin`` to ``end``, both inside it."""
    pairs, edges = pictures
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
def paint_column(
    region: Region, column: int, x: int, map_x: int, beams: NDArray[np.float64], pictures: Pictures
) -> None:
    """Paint the faces of one column of the region's lists over the pictures of all beams.

    It is column ``x`` of the octant, ``map_x`` counted in the whole map. Faces are cut to the
    places that a picture has.
    """
    pairs = pictures.pairs
    near_sides, lower_sides = region.near.entries, region.lower.entries
    near_starts, lower_starts = region.near.starts, region.lower.starts
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
        lowest, highest = 1 - lift, n_places - 2 - lift  # rows whose corners the picture has
        first, last = near_starts[column], near_starts[column + 1]
        while first < last and near_sides[first, 1] <= lowest:
            first += 1
        while first < last and near_sides[last - 1, 0] >= highest:
            last -= 1
        for k in range(first, last):  # fetch all, so that none is waited for alone
            _prefetch_bin(pictures, left + near_sides[k, 0])
            _prefetch_bin(pictures, left + near_sides[k, 1])
        for k in range(first, last):
            begin, end = int(near_sides[k, 0]), int(near_sides[k, 1])
            begin = begin if begin > lowest else lowest
            end = end if end < highest else highest
            word = (x << 16) | x
            if end - begin < _LONG_RUN:
                for b in range(plane + 1, plane + (end - begin) * n_bins):
                    pairs[origin + (b & (n_bins - 1)) * n_places + (b >> log_bins) + begin] = word
            else:
                for p in range(n_bins):
                    # Planes beyond the corner's own begin in the first place, others one later.
                    row = origin + p * n_places
                    for at in range(
                        row + begin + (1 if p <= plane else 0), row + end + (1 if p < plane else 0)
                    ):
                        pairs[at] = word
            _cover_upper_part(pictures, left + begin, x, left_edge)
            _cover_lower_part(pictures, left + end, x, left_edge)
        first, last = lower_starts[column], lower_starts[column + 1]
        while first < last and lower_sides[first] < lowest:
            first += 1
        while first < last and lower_sides[last - 1] > highest:
            last -= 1
        if first == last or beams[beam, SLOPE] == 0.0:
            continue
        # ... and on its right border.
        u = (beams[beam, SHIFT] - beams[beam, SLOPE] * (map_x + 1)) * n_bins
        right_bin = int(u)
        right_edge = np.float32(u - right_bin)
        right_place = (right_bin >> log_bins) - (left_bin >> log_bins)
        plane = right_bin & (n_bins - 1)
        right = origin + plane * n_places + right_place
        for k in range(first, last):
            _prefetch_bin(pictures, right + lower_sides[k])
            _prefetch_bin(pictures, left + lower_sides[k])
        for k in range(first, last):
            y = int(lower_sides[k])
            face = -1 - y
            if right_bin < left_bin:
                word = (face << 16) | (face & 0xFFFF)
                for b in range(plane + 1, plane + left_bin - right_bin):
                    place = right_place + (b >> log_bins) + y
                    pairs[origin + (b & (n_bins - 1)) * n_places + place] = word
                _cover_upper_part(pictures, right + y, face, right_edge)
                _cover_lower_part(pictures, left + y, face, left_edge)
            else:
                _cover_inside(pictures, right + y, face, right_edge, left_edge)


@inlined
def _look_up(pictures: Pictures, column: Column, span: int, beam: int, x: int, rays: Rays) -> bool:
    """Read the ranges of one span of a column off the picture of one beam.

    Returns whether a wanted one is not known; it reads negative. Whole blocks are read, so that no
    loop over a rest is needed; the buffers are long enough.
    """
    begin, end = column.spans[span, 0], column.spans[span, 1]
    n = (end - begin + BLOCK - 1) // BLOCK * BLOCK
    at, to = column.starts[beam] + begin, beam * (len(column.readings) // len(rays.beams)) + begin
    fraction, centre, cap = column.fractions[beam], np.float32(x + 0.5), rays.cap
    metres_major = np.float32(rays.beams[beam, METRES_MAJOR])
    metres_minor = np.float32(rays.beams[beam, METRES_MINOR])
    faces_here, edges_here = pictures.pairs[at : at + n], pictures.edges[at : at + n]
    rows_here, nodes_here = column.rows[begin : begin + n], column.nodes[begin : begin + n]
    out = column.readings[to : to + n]
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
def answer_column(
    column: Column, n_spans: int, frame: Frame, x: int, rays: Rays, pictures: Pictures
) -> None:
    """Read the spans of column ``x`` off the pictures of all beams.

    ``column.mixed`` notes for which beams some reading is not known.
    """
    beams, spans, starts = rays.beams, column.spans, column.starts
    n_beams = len(beams)
    for beam in range(n_beams):
        log_bins = int(beams[beam, LOG_BINS])
        n_bins = 1 << log_bins
        u = beams[beam, SHIFT] + 0.5 - beams[beam, SLOPE] * (frame.map_column + x + 0.5)
        u *= n_bins
        b = int(u - _BEFORE_TIE)
        column.fractions[beam] = u - _BEFORE_TIE - b
        place = (b >> log_bins) - int(beams[beam, LIFT]) + frame.tile_row
        plane = (b & (n_bins - 1)) * int(beams[beam, N_PLACES])
        starts[beam] = beam * (len(pictures.pairs) // n_beams) + plane + place
    for beam in range(n_beams):
        if beam + 1 < n_beams:
            for k in range(n_spans):
                for y in range(spans[k, 0], spans[k, 1], 16):
                    _prefetch_bin(pictures, starts[beam + 1] + y)
        column.mixed[beam] = False
        for k in range(n_spans):
            column.mixed[beam] |= _look_up(pictures, column, k, beam, x, rays)
