"""Kernel of the Fourier series of one scan alone, a lane for each of sixteen beams or steps.

A tile of one scan costs as much as one of sixteen. Here what concerns each vertex is done for
sixteen vertices at a time, and the sums of sixteen steps from a centre stay in one vector. Every
number comes from the same operations in the same order as in ``_fourier_kernels``, whose names are
used here, and so has the same bits.
"""

from typing import Any, NamedTuple

from pgm_places.features._fourier_kernels import (
    CHUNK,
    LEAST_EDGE_M,
    LEAST_LENGTH_M,
    MINUS_ONE,
    ONE,
    STRIDE_ORDER,
    TWO,
    Outline,
    _cosine,
    _sine,
    _write_orders,
)
from pgm_places.features._tiles import N_BEAMS
from pgm_places.features.plan import FourierPlan
from pgm_places.kernels.jit import inlined, njit
from pgm_places.kernels.lane_access import load_at, store_at
from pgm_places.kernels.lanes import (
    LANES,
    add_to,
    fma,
    load,
    narrow,
    nearest_integer,
    select,
    splat,
    store,
    transpose_block,
    widen,
)
from pgm_places.kernels.parts import part

VERTICES = -(-(N_BEAMS + 1) // LANES) * LANES
"""Columns of the rows that hold a number for each vertex, and a little more."""

# Rows of float64: end points, edges, places along the outline, powers and turns.
X, Y, EDGE, PLACE, COSINE, SINE, TURN_RE, TURN_IM = range(8)
EXACT_ROWS = 8

# Rows of float32: the sides u_k from column 1 on, the power of the stride, that of a centre, the
# turns times a centre's power and times its conjugate, for centre after centre.
SIDE_X, SIDE_Y, STRIDE, POWER, TURNS = 0, 1, 2, 4, 6
SINGLE_ROWS = TURNS + 2 * 7


class LoneRoom(NamedTuple):
    """Room to work in."""

    first: Any
    """5 planes of float64,"""
    sums: Any
    """and ``SUM_ROWS`` of float32, as for tiles."""
    exact: Any
    """(EXACT_ROWS, VERTICES + 16) float64."""
    single: Any
    """(SINGLE_ROWS, VERTICES + 16) float32."""
    powers: Any
    """(32, VERTICES) float32: cosines and sines of the steps, a column a vertex; 1 and 0 first."""
    by_vertex: Any
    """(2 VERTICES, 16) float32: the same, a row a vertex."""
    cells: Any
    """28 planes of float32: four sums for each centre, a lane a step."""
    rows: Any
    """(2 VERTICES) integers, counting from 0."""


@inlined
def _lone_sides(rho: Any, edges: Any, directions: Any, exact: Any, single: Any) -> None:
    for k in range(N_BEAMS + 1):
        exact[X, k] = rho[k, 0] * directions[k, 0]
        exact[Y, k] = rho[k, 0] * directions[k, 1]
    place = 0.0
    for k in range(N_BEAMS):
        exact[EDGE, k] = edges[k, 0]
        exact[PLACE, k] = place
        place += edges[k, 0]
    for k in range(0, N_BEAMS, LANES):
        edge = load_at(exact, EDGE, k)
        scale = ONE / narrow(select(edge > LEAST_EDGE_M, edge, splat(1e30)))
        x = load_at(exact, X, k + 1) - load_at(exact, X, k)
        y = load_at(exact, Y, k + 1) - load_at(exact, Y, k)
        store_at(single, SIDE_X, k + 1, narrow(x) * scale)
        store_at(single, SIDE_Y, k + 1, narrow(y) * scale)
    single[SIDE_X, 0] = single[SIDE_X, N_BEAMS]
    single[SIDE_Y, 0] = single[SIDE_Y, N_BEAMS]


@inlined
def _lone_powers(inverse_length: float, exact: Any, single: Any, powers: Any) -> None:
    """Write turns, first powers, and the stride from centre to centre."""
    for k in range(0, N_BEAMS, LANES):
        u_before = load_at(single, SIDE_X, k)
        v_before = load_at(single, SIDE_Y, k)
        u = load_at(single, SIDE_X, k + 1)
        v = load_at(single, SIDE_Y, k + 1)
        store_at(single, TURNS, k, u_before - u)
        store_at(single, TURNS + 1, k, v_before - v)
        store_at(exact, TURN_RE, k, widen(u_before) - widen(u))
        store_at(exact, TURN_IM, k, widen(v_before) - widen(v))
        turns = load_at(exact, PLACE, k) * inverse_length
        half_sin = _cosine(turns - 0.5)
        half_cos = _sine(turns - 0.5)
        cosine = fma(half_sin * -2.0, half_sin, splat(1.0))
        sine = half_sin * half_cos * -2.0
        store_at(exact, COSINE, k, cosine)
        store_at(exact, SINE, k, sine)
        store_at(powers, 1, k, narrow(cosine))
        store_at(powers, LANES + 1, k, narrow(sine))
        x = turns * STRIDE_ORDER
        x = x - nearest_integer(x)
        half_sin_f = narrow(_sine(x))
        half_cos_f = narrow(_cosine(x))
        cosine_f = fma(half_sin_f * MINUS_ONE, half_sin_f * TWO, narrow(splat(1.0)))
        sine_f = half_sin_f * half_cos_f * TWO
        store_at(single, STRIDE, k, cosine_f)
        store_at(single, STRIDE + 1, k, sine_f)
        store_at(single, POWER, k, cosine_f)
        store_at(single, POWER + 1, k, sine_f)


@inlined
def _lone_first_orders(exact: Any, first: Any) -> None:
    re_cos = splat(0.0)
    im_sin = splat(0.0)
    im_cos = splat(0.0)
    re_sin = splat(0.0)
    for k in range(N_BEAMS):
        re = splat(exact[TURN_RE, k])
        im = splat(exact[TURN_IM, k])
        cosine = splat(exact[COSINE, k])
        sine = splat(exact[SINE, k])
        re_cos = fma(re, cosine, re_cos)
        im_sin = fma(im, sine, im_sin)
        im_cos = fma(im, cosine, im_cos)
        re_sin = fma(re, sine, re_sin)
    store(first, 1, re_cos)
    store(first, 2, im_sin)
    store(first, 3, im_cos)
    store(first, 4, re_sin)


@inlined
def _lone_steps(n_steps: int, powers: Any, by_vertex: Any, rows: Any) -> None:
    """Write cosine and sine of 2 theta to n_steps theta, and all steps of a vertex to its row."""
    for k in range(0, N_BEAMS, LANES):
        c1 = load_at(powers, 1, k)
        s1 = load_at(powers, LANES + 1, k)
        c = c1
        s = s1
        for step in range(2, n_steps + 1):
            t = fma(s, c1, c * s1)
            c = fma(c, c1, s * s1 * MINUS_ONE)
            s = t
            store_at(powers, step, k, c)
            store_at(powers, LANES + step, k, s)
        transpose_block(powers, rows, k, by_vertex, rows[k:], 0)
        transpose_block(powers, rows[LANES:], k, by_vertex, rows[VERTICES + k :], 0)


@inlined
def _lone_centres(n_rows: int, single: Any) -> None:
    """Write a_k w_k^c and a_k w_k^-c of centre after centre."""
    for k in range(0, N_BEAMS, LANES):
        turn_re = load_at(single, TURNS, k)
        turn_im = load_at(single, TURNS + 1, k)
        c1 = load_at(single, STRIDE, k)
        s1 = load_at(single, STRIDE + 1, k)
        c = c1
        s = s1
        for row in range(1, n_rows, 2):
            re_cos = turn_re * c
            im_sin = turn_im * s
            im_cos = turn_im * c
            re_sin = turn_re * s
            at = TURNS + 2 * row
            store_at(single, at, k, re_cos + im_sin)
            store_at(single, at + 1, k, im_cos - re_sin)
            store_at(single, at + 2, k, re_cos - im_sin)
            store_at(single, at + 3, k, im_cos + re_sin)
            t = fma(s, c1, c * s1)
            c = fma(c, c1, s * s1 * MINUS_ONE)
            s = t


@inlined
def _lone_sums(n_rows: int, single: Any, by_vertex: Any, cells: Any) -> None:
    """Write the four sums of each centre; chunk by chunk, as they are rounded in tiles."""
    zero = narrow(splat(0.0))
    for row in range(4 * n_rows):
        store(cells, row, zero)
    for start in range(0, N_BEAMS, CHUNK):
        for row in range(n_rows):
            p = q = u = v = zero
            for k in range(start, start + CHUNK):
                re = splat(single[TURNS + 2 * row, k])
                im = splat(single[TURNS + 2 * row + 1, k])
                c = load(by_vertex, k)
                s = load(by_vertex, VERTICES + k)
                p = fma(re, c, p)
                q = fma(im, s, q)
                u = fma(im, c, u)
                v = fma(re, s, v)
            add_to(cells, 4 * row, p)
            add_to(cells, 4 * row + 1, q)
            add_to(cells, 4 * row + 2, u)
            add_to(cells, 4 * row + 3, v)


@njit
def lone_fourier_features(outline: Outline, plan: FourierPlan, room: LoneRoom, values: Any) -> None:
    """Write f17 to f19_2, and f16 for each of the plan's orders, of the scan in the first lane."""
    rho, directions, edges, shape = outline
    n_steps, bounds, steps, orders = plan
    first, sums, exact, single, powers, by_vertex, cells, rows = room
    n_rows = bounds.size - 1
    length = shape[1, 0]
    inverse_length = 1.0 / (length if length > LEAST_LENGTH_M else 1.0)
    _lone_sides(rho, edges, directions, exact, single)
    _lone_powers(inverse_length, exact, single, powers)
    _lone_first_orders(exact, first)
    if n_rows > 0:
        _lone_steps(n_steps, powers, by_vertex, rows)
        _lone_centres(n_rows, single)
        _lone_sums(n_rows, single, by_vertex, cells)
    for row in range(n_rows):
        for cell in range(bounds[row], bounds[row + 1]):
            for k in range(4):
                sums[4 * cell + k, 0] = cells[4 * row + k, steps[cell]]
    sizes, beginning, cell_sums = part(shape, 0), part(first, 0), part(sums, 0)
    _write_orders(1, 0, sizes, beginning, cell_sums, orders, part(values, 0))
