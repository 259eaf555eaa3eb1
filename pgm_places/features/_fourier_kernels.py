"""Kernel of the exact Fourier series of a scan's outline: f16 to f19_2.

With ``u_k`` the unit vector along edge ``k``, ``a_k = u_{k-1} - u_k`` the turn at vertex ``k``, and
``w_k = exp(-i theta_k)``, ``theta_k = 2 pi t_k / L`` the vertex's place along the outline,

    c_n = L / (2 pi n)^2 * sum_k a_k w_k^n .

Orders are reached from the centres ``c = 0, +-29, +-58, +-87`` by the steps ``s = 0..14``: with
``a_k w_k^c = A_k`` the four real sums of the products of ``Re A, Im A`` with ``cos(s theta)`` and
``sin(s theta)`` give both ``c_{c+s}`` and ``c_{c-s}``, so that an order costs two products a vertex
and little more than two powers are formed for ten orders. A pair (centre, step) is a *cell*.

Vertices are handled in chunks that stay in the first-level cache. Positions along the outline are
float64, as are the sums of the orders 1 and -1, by which all others are divided; the cells' sums
are float32.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from pgm_places.features._tiles import N_BEAMS, N_FEATURES, TILE_ROWS
from pgm_places.features.laser import first_column
from pgm_places.features.plan import FOURIER_BLOCK, FOURIER_REACH, FourierPlan
from pgm_places.kernels.deferred import by_registers
from pgm_places.kernels.jit import inlined, njit
from pgm_places.kernels.lanes import (
    LANES,
    absolute,
    add_to,
    fma,
    load,
    narrow,
    nearest_integer,
    select,
    square_root,
    store,
    widen,
)
from pgm_places.kernels.parts import PART, alike, part, room

CHUNK = 12
N_STEPS = FOURIER_REACH + 1
STRIDE_ORDER = 2.0 * FOURIER_REACH + 1.0
LEAST_EDGE_M = 1e-12
LEAST_LENGTH_M = 1e-9
ONE, MINUS_ONE, TWO = np.float32(1.0), np.float32(-1.0), np.float32(2.0)

F17 = first_column("f17")

# Rows of the float32 planes to work in, real parts or cosines before imaginary parts or sines: the
# sides u_k of the whole outline; of a chunk the turns a_k, the steps, the turns times one centre's
# power and times its conjugate, that power, and the power from centre to centre.
SIDES = 0
TURNS = SIDES + 2 * N_BEAMS
STEPS = TURNS + 2 * CHUNK
CENTRES = STEPS + 2 * N_STEPS * CHUNK
POWER = CENTRES + 4 * CHUNK
STRIDE = POWER + 2 * CHUNK
WORK_ROWS = STRIDE + 2 * CHUNK

SPARE_CELL = 7 * N_STEPS
SUM_ROWS = 4 * (SPARE_CELL + 1)
"""Four sums for each cell, seven centres reach order 100, and for one whose sums nobody wants."""


class Outline(NamedTuple):
    """Tiles as the kernels on polygons take them."""

    rho: Any
    """Planes of the beams."""
    directions: Any
    """(361, 2) unit vectors of the beams."""
    edges: Any
    """Planes of the polygon's edges, from ``outline_features``,"""
    shape: Any
    """and of its area, perimeter and centroid."""


class FourierRoom(NamedTuple):
    """Planes to work in."""

    first: Any
    """5 rows of float64."""
    work: Any
    """``WORK_ROWS`` of float32."""
    sums: Any
    """``SUM_ROWS`` of float32."""


@inlined
def _sides(rho: Any, top: int, directions: Any, edges: Any, work: Any) -> None:
    """Write the unit vectors along the edges; 0 for an edge without length."""
    before = load(rho, top)
    x_before = before * directions[0, 0]
    y_before = before * directions[0, 1]
    for beam in range(N_BEAMS):
        other = beam + 1
        after = load(rho, top + other)
        x = after * directions[other, 0]
        y = after * directions[other, 1]
        edge = load(edges, top + beam)
        seen = edge > LEAST_EDGE_M
        scale = ONE / narrow(select(seen, edge, 1e30))
        store(work, SIDES + beam, narrow(x - x_before) * scale)
        store(work, SIDES + N_BEAMS + beam, narrow(y - y_before) * scale)
        x_before = x
        y_before = y


@inlined
def _sine(x: Any) -> Any:
    """sin(pi x) for ``|x| <= 1/2``, float64, error below 3e-11."""
    y = x * x
    p = fma(y, -0.007028386369347573, 0.08205040178581838)
    p = fma(y, p, -0.599252197819169)
    p = fma(y, p, 2.5501633189466246)
    p = fma(y, p, -5.167712764624521)
    return x * fma(y, p, 3.14159265353629)


@inlined
def _cosine(x: Any) -> Any:
    """cos(pi x) for ``|x| <= 1/2``, float64, error below 3e-10."""
    y = x * x
    p = fma(y, -0.02439632429741323, 0.23493731378366647)
    p = fma(y, p, -1.3352120030432615)
    p = fma(y, p, 4.058709159555605)
    p = fma(y, p, -4.934802137078794)
    return fma(y, p, 0.9999999997799038)


@inlined
def _add_first_orders(
    edges: Any, top: int, start: int, inverse_length: Any, deep: bool, first: Any, work: Any
) -> None:
    """Write turns and first powers of a chunk, and the stride from centre to centre if deep.

    Rows of ``first`` (float64) go on from chunk to chunk: the place along the outline, then the
    sums of Re a cos, Im a sin, Im a cos, Re a sin of theta.
    """
    place = load(first, 0)
    re_cos = load(first, 1)
    im_sin = load(first, 2)
    im_cos = load(first, 3)
    re_sin = load(first, 4)
    before = start - 1 if start > 0 else N_BEAMS - 1
    u_before = load(work, SIDES + before)
    v_before = load(work, SIDES + N_BEAMS + before)
    for i in range(CHUNK):
        u = load(work, SIDES + start + i)
        v = load(work, SIDES + N_BEAMS + start + i)
        store(work, TURNS + i, u_before - u)
        store(work, TURNS + CHUNK + i, v_before - v)
        re = widen(u_before) - widen(u)
        im = widen(v_before) - widen(v)
        u_before = u
        v_before = v
        turns = place * inverse_length
        place = place + load(edges, top + start + i)
        # half of theta, less a quarter turn, lies between -1/2 and 1/2 times pi
        half_sin = _cosine(turns - 0.5)
        half_cos = _sine(turns - 0.5)  # its negative
        cosine = fma(half_sin * -2.0, half_sin, 1.0)
        sine = half_sin * half_cos * -2.0
        re_cos = fma(re, cosine, re_cos)
        im_sin = fma(im, sine, im_sin)
        im_cos = fma(im, cosine, im_cos)
        re_sin = fma(re, sine, re_sin)
        store(work, STEPS + 2 * CHUNK + i, narrow(cosine))
        store(work, STEPS + 3 * CHUNK + i, narrow(sine))
        if deep:
            x = turns * STRIDE_ORDER
            x = x - nearest_integer(x)
            half_sin_f = narrow(_sine(x))
            half_cos_f = narrow(_cosine(x))
            cosine_f = fma(half_sin_f * MINUS_ONE, half_sin_f * TWO, ONE)
            sine_f = half_sin_f * half_cos_f * TWO
            store(work, STRIDE + i, cosine_f)
            store(work, STRIDE + CHUNK + i, sine_f)
            store(work, POWER + i, cosine_f)
            store(work, POWER + CHUNK + i, sine_f)
    store(first, 0, place)
    store(first, 1, re_cos)
    store(first, 2, im_sin)
    store(first, 3, im_cos)
    store(first, 4, re_sin)


@inlined
def _steps(n_steps: int, work: Any) -> None:
    """Write cosine and sine of 2 theta to n_steps theta for a chunk."""
    for i in range(CHUNK):
        c1 = load(work, STEPS + 2 * CHUNK + i)
        s1 = load(work, STEPS + 3 * CHUNK + i)
        c = c1
        s = s1
        for step in range(2, n_steps + 1):
            t = fma(s, c1, c * s1)
            c = fma(c, c1, s * s1 * MINUS_ONE)
            s = t
            store(work, STEPS + 2 * step * CHUNK + i, c)
            store(work, STEPS + (2 * step + 1) * CHUNK + i, s)


@inlined
def _centre(work: Any) -> None:
    """Write a_k w_k^c and a_k w_k^-c of a chunk; move the power on to the next centre."""
    for i in range(CHUNK):
        turn_re = load(work, TURNS + i)
        turn_im = load(work, TURNS + CHUNK + i)
        c = load(work, POWER + i)
        s = load(work, POWER + CHUNK + i)
        re_cos = turn_re * c
        im_sin = turn_im * s
        im_cos = turn_im * c
        re_sin = turn_re * s
        store(work, CENTRES + i, re_cos + im_sin)
        store(work, CENTRES + CHUNK + i, im_cos - re_sin)
        store(work, CENTRES + 2 * CHUNK + i, re_cos - im_sin)
        store(work, CENTRES + 3 * CHUNK + i, im_cos + re_sin)
        c1 = load(work, STRIDE + i)
        s1 = load(work, STRIDE + CHUNK + i)
        store(work, POWER + i, fma(c, c1, s * s1 * MINUS_ONE))
        store(work, POWER + CHUNK + i, fma(s, c1, c * s1))


@inlined
def _sum_five(work: Any, centre: int, cell: int, steps: Any, sums: Any) -> None:
    """Add a chunk to five cells of one centre; twenty sums stay in 32 registers."""
    zero = alike(load(work, centre), 0.0)
    p0 = q0 = u0 = v0 = zero
    p1 = q1 = u1 = v1 = zero
    p2 = q2 = u2 = v2 = zero
    p3 = q3 = u3 = v3 = zero
    p4 = q4 = u4 = v4 = zero
    cos0 = STEPS + 2 * CHUNK * steps[cell]
    cos1 = STEPS + 2 * CHUNK * steps[cell + 1]
    cos2 = STEPS + 2 * CHUNK * steps[cell + 2]
    cos3 = STEPS + 2 * CHUNK * steps[cell + 3]
    cos4 = STEPS + 2 * CHUNK * steps[cell + 4]
    for i in range(CHUNK):
        re = load(work, centre + i)
        im = load(work, centre + CHUNK + i)
        row = cos0 + i
        c = load(work, row)
        s = load(work, row + CHUNK)
        p0 = fma(re, c, p0)
        q0 = fma(im, s, q0)
        u0 = fma(im, c, u0)
        v0 = fma(re, s, v0)
        row = cos1 + i
        c = load(work, row)
        s = load(work, row + CHUNK)
        p1 = fma(re, c, p1)
        q1 = fma(im, s, q1)
        u1 = fma(im, c, u1)
        v1 = fma(re, s, v1)
        row = cos2 + i
        c = load(work, row)
        s = load(work, row + CHUNK)
        p2 = fma(re, c, p2)
        q2 = fma(im, s, q2)
        u2 = fma(im, c, u2)
        v2 = fma(re, s, v2)
        row = cos3 + i
        c = load(work, row)
        s = load(work, row + CHUNK)
        p3 = fma(re, c, p3)
        q3 = fma(im, s, q3)
        u3 = fma(im, c, u3)
        v3 = fma(re, s, v3)
        row = cos4 + i
        c = load(work, row)
        s = load(work, row + CHUNK)
        p4 = fma(re, c, p4)
        q4 = fma(im, s, q4)
        u4 = fma(im, c, u4)
        v4 = fma(re, s, v4)
    row = 4 * cell
    add_to(sums, row, p0)
    add_to(sums, row + 1, q0)
    add_to(sums, row + 2, u0)
    add_to(sums, row + 3, v0)
    add_to(sums, row + 4, p1)
    add_to(sums, row + 5, q1)
    add_to(sums, row + 6, u1)
    add_to(sums, row + 7, v1)
    add_to(sums, row + 8, p2)
    add_to(sums, row + 9, q2)
    add_to(sums, row + 10, u2)
    add_to(sums, row + 11, v2)
    add_to(sums, row + 12, p3)
    add_to(sums, row + 13, q3)
    add_to(sums, row + 14, u3)
    add_to(sums, row + 15, v3)
    add_to(sums, row + 16, p4)
    add_to(sums, row + 17, q4)
    add_to(sums, row + 18, u4)
    add_to(sums, row + 19, v4)


@inlined
def _sum_three(
    work: Any, centre: int, step0: int, step1: int, step2: int, sums: Any, cell: int, last: int
) -> None:
    """Add a chunk to the cells ``cell``, ``cell + 1`` and ``last``; all stays in 16 registers."""
    zero = alike(load(work, centre), 0.0)
    p0 = q0 = u0 = v0 = zero
    p1 = q1 = u1 = v1 = zero
    p2 = q2 = u2 = v2 = zero
    cos0 = STEPS + 2 * CHUNK * step0
    cos1 = STEPS + 2 * CHUNK * step1
    cos2 = STEPS + 2 * CHUNK * step2
    for i in range(CHUNK):
        re = load(work, centre + i)
        im = load(work, centre + CHUNK + i)
        row = cos0 + i
        c = load(work, row)
        s = load(work, row + CHUNK)
        p0 = fma(re, c, p0)
        q0 = fma(im, s, q0)
        u0 = fma(im, c, u0)
        v0 = fma(re, s, v0)
        row = cos1 + i
        c = load(work, row)
        s = load(work, row + CHUNK)
        p1 = fma(re, c, p1)
        q1 = fma(im, s, q1)
        u1 = fma(im, c, u1)
        v1 = fma(re, s, v1)
        row = cos2 + i
        c = load(work, row)
        s = load(work, row + CHUNK)
        p2 = fma(re, c, p2)
        q2 = fma(im, s, q2)
        u2 = fma(im, c, u2)
        v2 = fma(re, s, v2)
    row = 4 * cell
    add_to(sums, row, p0)
    add_to(sums, row + 1, q0)
    add_to(sums, row + 2, u0)
    add_to(sums, row + 3, v0)
    add_to(sums, row + 4, p1)
    add_to(sums, row + 5, q1)
    add_to(sums, row + 6, u1)
    add_to(sums, row + 7, v1)
    add_to(sums, 4 * last, p2)
    add_to(sums, 4 * last + 1, q2)
    add_to(sums, 4 * last + 2, u2)
    add_to(sums, 4 * last + 3, v2)


@inlined
def _sum_cell(work: Any, centre: int, cell: int, step: int, sums: Any) -> None:
    """Add a chunk to one cell."""
    zero = alike(load(work, centre), 0.0)
    p = q = u = v = zero
    first = STEPS + 2 * CHUNK * step
    for i in range(CHUNK):
        re = load(work, centre + i)
        im = load(work, centre + CHUNK + i)
        row = first + i
        c = load(work, row)
        s = load(work, row + CHUNK)
        p = fma(re, c, p)
        q = fma(im, s, q)
        u = fma(im, c, u)
        v = fma(re, s, v)
    add_to(sums, 4 * cell, p)
    add_to(sums, 4 * cell + 1, q)
    add_to(sums, 4 * cell + 2, u)
    add_to(sums, 4 * cell + 3, v)


@inlined
def _cells_by_fives(work: Any, centre: int, cell: int, end: int, steps: Any, sums: Any) -> None:
    """Add a chunk to the cells ``cell..end - 1`` of one centre."""
    while cell + FOURIER_BLOCK <= end:
        _sum_five(work, centre, cell, steps, sums)
        cell += FOURIER_BLOCK
    while cell < end:
        _sum_cell(work, centre, cell, steps[cell], sums)
        cell += 1


@inlined
def _cells_by_threes(work: Any, centre: int, cell: int, end: int, steps: Any, sums: Any) -> None:
    """The same; of three cells, the last may be a spare one."""
    while cell + 1 < end:
        last = cell + 2 if cell + 2 < end else SPARE_CELL
        third = steps[min(cell + 2, end - 1)]
        _sum_three(work, centre, steps[cell], steps[cell + 1], third, sums, cell, last)
        cell += 3
    if cell < end:
        _sum_cell(work, centre, cell, steps[cell], sums)


_add_to_cells = by_registers(many=_cells_by_fives, few=_cells_by_threes)


@njit
def _sum_cells(bounds: Any, steps: Any, planes: Any, sum_planes: Any) -> None:
    """Add a chunk to all cells: those of centre row ``r`` are ``bounds[r]..bounds[r + 1] - 1``."""
    work = room(planes)
    sums = room(sum_planes)
    n_rows = bounds.size - 1
    for row in range(n_rows):
        if row % 2 == 1:
            _centre(work)
        centre = CENTRES + (0 if row % 2 == 1 else 2 * CHUNK) if row > 0 else TURNS
        _add_to_cells(work, centre, bounds[row], bounds[row + 1], steps, sums)


@inlined
def _write_orders(
    shape_row: int, row: int, shape: Any, first: Any, sums: Any, orders: Any, values: Any
) -> None:
    """Write f16 to f19_2 of a tile from its sums; ``orders`` (O, 4): see the plan."""
    length = load(shape, shape_row)
    s1 = load(first, 1)
    s2 = load(first, 2)
    s3 = load(first, 3)
    s4 = load(first, 4)
    plus_re = s1 + s2
    plus_im = s3 - s4
    minus_re = s1 - s2
    minus_im = s3 + s4
    plus = square_root(plus_re * plus_re + plus_im * plus_im)
    minus = square_root(minus_re * minus_re + minus_im * minus_im)
    scale = length * (0.25 / (math.pi * math.pi))
    usable = plus * scale > LEAST_LENGTH_M
    safe = select(usable, plus, 1.0)
    major = plus + minus
    minor = absolute(plus - minus)
    axes = narrow(select(usable, minor / select(usable, major, 1.0), 0.0))
    store(values, row + F17, narrow(major * scale))
    store(values, row + F17 + 1, narrow(minor * scale))
    store(values, row + F17 + 2, axes)
    store(values, row + F17 + 3, narrow(select(usable, major / safe, 0.0)))
    store(values, row + F17 + 4, narrow(select(usable, minor / safe, 0.0)))
    store(values, row + F17 + 5, axes)
    inverse = narrow(select(usable, 1.0 / safe, 0.0))
    for o in range(orders.shape[0]):
        n = orders[o, 0]
        if n == -1:
            store(values, row + orders[o, 3], narrow(select(usable, minus / safe, 0.0)))
            continue
        cell = 4 * orders[o, 1]
        p = load(sums, cell)
        q = load(sums, cell + 1)
        u = load(sums, cell + 2)
        v = load(sums, cell + 3)
        sign = np.float32(orders[o, 2])
        re = p + q * sign
        im = u - v * sign
        size = square_root(fma(re, re, im * im))
        store(values, row + orders[o, 3], size * (inverse * np.float32(1.0 / (n * n))))


@inlined
def _clear(planes: Any, first: int, end: int, value: float) -> None:
    number = alike(load(planes, first), value)
    for row in range(first, end):
        store(planes, row, number)


@inlined
def _one_part(
    lane: int, tile: int, outline: Outline, plan: FourierPlan, space: FourierRoom, values: Any
) -> None:
    """The series of a part of a tile."""
    n_steps, bounds, steps, orders = plan
    rho = part(outline.rho, lane)
    edges = part(outline.edges, lane)
    shape = part(outline.shape, lane)
    first = room(space.first)
    work = room(space.work)
    sums = room(space.sums)
    top = tile * TILE_ROWS
    _sides(rho, top, outline.directions, edges, work)
    _clear(first, 0, 5, 0.0)
    _clear(sums, 0, 4 * steps.size, 0.0)
    length = load(shape, 4 * tile + 1)
    inverse_length = 1.0 / select(length > LEAST_LENGTH_M, length, 1.0)
    for start in range(0, N_BEAMS, CHUNK):
        _add_first_orders(edges, top, start, inverse_length, bounds.size > 2, first, work)
        _steps(n_steps, work)
        _sum_cells(bounds, steps, space.work, space.sums)
    row = tile * N_FEATURES
    _write_orders(4 * tile + 1, row, shape, first, sums, orders, part(values, lane))


@njit
def fourier_features(
    outline: Outline, n_tiles: int, plan: FourierPlan, space: FourierRoom, values: Any
) -> None:
    """Write f17 to f19_2, and f16 for each of the plan's orders."""
    work = room(space.work)
    _clear(work, STEPS, STEPS + CHUNK, 1.0)
    _clear(work, STEPS + CHUNK, STEPS + 2 * CHUNK, 0.0)
    for tile in range(n_tiles):
        for lane in range(0, LANES, PART):
            _one_part(lane, tile, outline, plan, space, values)
