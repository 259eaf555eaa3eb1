"""Kernel of the exact Fourier series of a scan's outline: f16 to f19_2.

With ``u_k`` the unit vector along edge ``k``, ``a_k = u_{k-1} - u_k`` the turn at vertex ``k``, and
``w_k = exp(-i theta_k)``, ``theta_k = 2 pi t_k / L`` the vertex's place along the outline,

    c_n = L / (2 pi n)^2 * sum_k a_k w_k^n .

Orders are reached from ten centres ``c = +-10.5, +-30.5, ... +-90.5`` by steps
``s = 0.5, 1.5, ... 9.5``: with ``a_k w_k^c = A_k`` the four real sums of the products of
``Re A, Im A`` with ``cos(s theta), sin(s theta)`` give both ``c_{c+s}`` and ``c_{c-s}``, and all 200
orders need 400 products a vertex. A pair (centre, step) is a *cell*. Vertices are handled in chunks
that stay in the first-level cache. Positions along the outline and the first powers are float64,
the cells' sums float32; orders 1 and -1, by which the others are divided, are summed in float64.
"""

import math
from typing import Any

import numpy as np

from pgm_places._jit import inlined, njit
from pgm_places._lanes import (
    absolute,
    fma,
    load,
    narrow,
    select,
    splat,
    square_root,
    store,
    widen,
)
from pgm_places.features.laser import CANONICAL_BEAMS, LASER_FEATURES, first_column

N_BEAMS = CANONICAL_BEAMS
N_FEATURES = len(LASER_FEATURES)
CHUNK = 24
LEAST_EDGE_M = 1e-12
LEAST_LENGTH_M = 1e-9
FIRST_CENTRE, BETWEEN_CENTRES, N_CENTRES, N_STEPS = 10.5, 20, 5, 10
BLOCK = 5
"""Cells of one centre that are summed in one pass over a chunk."""

F17 = first_column("f17")

# Rows of float32 planes to work in: turns, steps, one centre and its mirror image, its power
TURNS = 0
STEPS = TURNS + 2 * N_BEAMS
CENTRES = STEPS + 2 * N_STEPS * CHUNK
POWER = CENTRES + 4 * CHUNK
STRIDE = POWER + 2 * CHUNK
WORK_ROWS = STRIDE + 2 * CHUNK


@inlined
def _turns(rho: Any, top: int, directions: Any, edges: Any, work: Any) -> None:
    """Write real and imaginary part of a_k to rows k and 360 + k."""
    before = load(rho, top)
    x_before = before * directions[0, 0]
    y_before = before * directions[0, 1]
    u_before = narrow(splat(0.0))
    v_before = narrow(splat(0.0))
    for beam in range(N_BEAMS):
        other = beam + 1 if beam < N_BEAMS - 1 else 0
        after = load(rho, top + other)
        x = after * directions[other, 0]
        y = after * directions[other, 1]
        edge = load(edges, top + beam)
        seen = edge > LEAST_EDGE_M
        scale = narrow(select(seen, splat(1.0), splat(0.0))) / narrow(
            select(seen, edge, splat(1.0))
        )
        u = narrow(x - x_before) * scale
        v = narrow(y - y_before) * scale
        store(work, TURNS + beam, u_before - u)
        store(work, TURNS + N_BEAMS + beam, v_before - v)
        x_before = x
        y_before = y
        u_before = u
        v_before = v
    store(work, TURNS, u_before + load(work, TURNS))
    store(work, TURNS + N_BEAMS, v_before + load(work, TURNS + N_BEAMS))


@inlined
def _powers(
    edges: Any, top: int, start: int, inverse_length: Any, n_steps: int, first: Any, work: Any
) -> None:
    """Fill the tables of a chunk; add its vertices to the sums of orders 1 and -1.

    Rows of ``first`` (float64): the place along the outline, then sums of Re a cos, Im a sin,
    Im a cos, Re a sin of theta.
    """
    place = load(first, 0)
    s1 = load(first, 1)
    s2 = load(first, 2)
    s3 = load(first, 3)
    s4 = load(first, 4)
    for i in range(CHUNK):
        # g in [-1/2, 1/2], sin and cos of pi g by polynomials with errors below 1e-12
        g = fma(place, inverse_length, splat(-0.5))
        place = place + load(edges, top + start + i)
        g2 = g * g
        sine = fma(g2, splat(0.00044749407097697256), splat(-0.007364006876014174))
        sine = fma(g2, sine, splat(0.08214479503403711))
        sine = fma(g2, sine, splat(-0.5992644339768505))
        sine = fma(g2, sine, splat(2.5501640359085505))
        sine = fma(g2, sine, splat(-5.16771277998797))
        half_cos = g * fma(g2, sine, splat(3.141592653589635)) * -1.0  # cos(theta / 2)
        cosine = fma(g2, splat(0.0018400045111775399), splat(-0.025776327680796393))
        cosine = fma(g2, cosine, splat(0.23532543973196876))
        cosine = fma(g2, cosine, splat(-1.3352623156650678))
        cosine = fma(g2, cosine, splat(4.058712107560673))
        cosine = fma(g2, cosine, splat(-4.934802200250329))
        half_sin = fma(g2, cosine, splat(0.9999999999992494))  # sin(theta / 2)
        cos1 = fma(half_sin * -2.0, half_sin, splat(1.0))
        sin1 = 2.0 * half_sin * half_cos
        turn_re = widen(load(work, TURNS + start + i))
        turn_im = widen(load(work, TURNS + N_BEAMS + start + i))
        s1 = fma(turn_re, cos1, s1)
        s2 = fma(turn_im, sin1, s2)
        s3 = fma(turn_im, cos1, s3)
        s4 = fma(turn_re, sin1, s4)
        if n_steps > 0:
            cos2 = fma(sin1 * -2.0, sin1, splat(1.0))
            sin2 = 2.0 * sin1 * cos1
            cos4 = fma(sin2 * -2.0, sin2, splat(1.0))
            sin4 = 2.0 * sin2 * cos2
            cos8 = fma(sin4 * -2.0, sin4, splat(1.0))
            sin8 = 2.0 * sin4 * cos4
            cos10 = fma(cos8, cos2, sin8 * sin2 * -1.0)
            sin10 = fma(sin8, cos2, cos8 * sin2)
            store(work, STRIDE + i, narrow(fma(sin10 * -2.0, sin10, splat(1.0))))
            store(work, STRIDE + CHUNK + i, narrow(2.0 * sin10 * cos10))
            store(work, POWER + i, narrow(fma(cos10, half_cos, sin10 * half_sin * -1.0)))
            store(work, POWER + CHUNK + i, narrow(fma(sin10, half_cos, cos10 * half_sin)))
            c = narrow(half_cos)
            s = narrow(half_sin)
            c1 = narrow(cos1)
            s1_ = narrow(sin1)
            for step in range(n_steps):
                store(work, STEPS + 2 * step * CHUNK + i, c)
                store(work, STEPS + (2 * step + 1) * CHUNK + i, s)
                t = fma(s, c1, c * s1_)
                c = fma(c, c1, s * s1_ * np.float32(-1.0))
                s = t
    store(first, 0, place)
    store(first, 1, s1)
    store(first, 2, s2)
    store(first, 3, s3)
    store(first, 4, s4)


@inlined
def _centre(start: int, work: Any) -> None:
    """Write a_k w_k^c and a_k w_k^-c of a chunk; move the power on to the next centre."""
    minus = np.float32(-1.0)
    for i in range(CHUNK):
        turn_re = load(work, TURNS + start + i)
        turn_im = load(work, TURNS + N_BEAMS + start + i)
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
        store(work, POWER + i, fma(c, c1, s * s1 * minus))
        store(work, POWER + CHUNK + i, fma(s, c1, c * s1))


@inlined
def _add_to(sums: Any, cell: int, p: Any, q: Any, u: Any, v: Any) -> None:
    store(sums, 4 * cell, load(sums, 4 * cell) + p)
    store(sums, 4 * cell + 1, load(sums, 4 * cell + 1) + q)
    store(sums, 4 * cell + 2, load(sums, 4 * cell + 2) + u)
    store(sums, 4 * cell + 3, load(sums, 4 * cell + 3) + v)


@inlined
def _sum_block(work: Any, centre: int, cell: int, steps: Any, sums: Any) -> None:
    """Add a chunk to five cells of one centre; twenty sums stay in registers."""
    zero = narrow(splat(0.0))
    p0, q0, u0, v0 = zero, zero, zero, zero
    p1, q1, u1, v1 = zero, zero, zero, zero
    p2, q2, u2, v2 = zero, zero, zero, zero
    p3, q3, u3, v3 = zero, zero, zero, zero
    p4, q4, u4, v4 = zero, zero, zero, zero
    row0 = STEPS + 2 * CHUNK * steps[cell]
    row1 = STEPS + 2 * CHUNK * steps[cell + 1]
    row2 = STEPS + 2 * CHUNK * steps[cell + 2]
    row3 = STEPS + 2 * CHUNK * steps[cell + 3]
    row4 = STEPS + 2 * CHUNK * steps[cell + 4]
    for i in range(CHUNK):
        re = load(work, centre + i)
        im = load(work, centre + CHUNK + i)
        c = load(work, row0 + i)
        s = load(work, row0 + CHUNK + i)
        p0, q0, u0, v0 = fma(re, c, p0), fma(im, s, q0), fma(im, c, u0), fma(re, s, v0)
        c = load(work, row1 + i)
        s = load(work, row1 + CHUNK + i)
        p1, q1, u1, v1 = fma(re, c, p1), fma(im, s, q1), fma(im, c, u1), fma(re, s, v1)
        c = load(work, row2 + i)
        s = load(work, row2 + CHUNK + i)
        p2, q2, u2, v2 = fma(re, c, p2), fma(im, s, q2), fma(im, c, u2), fma(re, s, v2)
        c = load(work, row3 + i)
        s = load(work, row3 + CHUNK + i)
        p3, q3, u3, v3 = fma(re, c, p3), fma(im, s, q3), fma(im, c, u3), fma(re, s, v3)
        c = load(work, row4 + i)
        s = load(work, row4 + CHUNK + i)
        p4, q4, u4, v4 = fma(re, c, p4), fma(im, s, q4), fma(im, c, u4), fma(re, s, v4)
    _add_to(sums, cell, p0, q0, u0, v0)
    _add_to(sums, cell + 1, p1, q1, u1, v1)
    _add_to(sums, cell + 2, p2, q2, u2, v2)
    _add_to(sums, cell + 3, p3, q3, u3, v3)
    _add_to(sums, cell + 4, p4, q4, u4, v4)


@inlined
def _sum_cell(work: Any, centre: int, cell: int, step: int, sums: Any) -> None:
    """Add a chunk to one cell."""
    zero = narrow(splat(0.0))
    p, q, u, v = zero, zero, zero, zero
    row = STEPS + 2 * CHUNK * step
    for i in range(CHUNK):
        re = load(work, centre + i)
        im = load(work, centre + CHUNK + i)
        c = load(work, row + i)
        s = load(work, row + CHUNK + i)
        p, q, u, v = fma(re, c, p), fma(im, s, q), fma(im, c, u), fma(re, s, v)
    _add_to(sums, cell, p, q, u, v)


@njit
def _sum_cells(start: int, bounds: Any, steps: Any, work: Any, sums: Any) -> None:
    """Add a chunk to all cells: those of centre row ``j`` are ``bounds[j]..bounds[j + 1] - 1``.

    Rows alternate between a centre and its mirror image.
    """
    n_rows = bounds.size - 1
    for row in range(n_rows):
        if row % 2 == 0:
            _centre(start, work)
        centre = CENTRES + 2 * CHUNK * (row % 2)
        cell = bounds[row]
        while cell + BLOCK <= bounds[row + 1]:
            _sum_block(work, centre, cell, steps, sums)
            cell += BLOCK
        while cell < bounds[row + 1]:
            _sum_cell(work, centre, cell, steps[cell], sums)
            cell += 1


@njit
def _write_orders(
    shape_row: int, row: int, shape: Any, first: Any, sums: Any, orders: Any, values: Any
) -> None:
    """Write f16 to f19_2 of a tile from its sums; ``orders`` (O, 4): see ``fourier_features``."""
    length = load(shape, shape_row)
    s1 = load(first, 1)
    s2 = load(first, 2)
    s3 = load(first, 3)
    s4 = load(first, 4)
    plus_re, plus_im = s1 + s2, s3 - s4
    minus_re, minus_im = s1 - s2, s3 + s4
    plus = square_root(plus_re * plus_re + plus_im * plus_im)
    minus = square_root(minus_re * minus_re + minus_im * minus_im)
    scale = length * (0.25 / (math.pi * math.pi))
    usable = plus * scale > LEAST_LENGTH_M
    safe = select(usable, plus, splat(1.0))
    zero = splat(0.0)
    major = plus + minus
    minor = absolute(plus - minus)
    axes = narrow(select(usable, minor / select(usable, major, splat(1.0)), zero))
    store(values, row + F17, narrow(major * scale))
    store(values, row + F17 + 1, narrow(minor * scale))
    store(values, row + F17 + 2, axes)
    store(values, row + F17 + 3, narrow(select(usable, major / safe, zero)))
    store(values, row + F17 + 4, narrow(select(usable, minor / safe, zero)))
    store(values, row + F17 + 5, axes)
    inverse = narrow(select(usable, 1.0 / safe, zero))
    for o in range(orders.shape[0]):
        n = orders[o, 0]
        if n == -1:
            store(values, row + orders[o, 3], narrow(select(usable, minus / safe, zero)))
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


@njit
def fourier_features(
    rho: Any,
    n_tiles: int,
    directions: Any,
    edges: Any,
    shape: Any,
    n_steps: int,
    bounds: Any,
    steps: Any,
    orders: Any,
    first: Any,
    work: Any,
    sums: Any,
    values: Any,
) -> None:
    """Write f17 to f19_2, and f16 for each of the ``orders``.

    ``edges`` and ``shape`` come from ``outline_features``. The cells of centre row ``j`` are
    ``bounds[j]..bounds[j + 1] - 1``, ``steps`` their steps, all below ``n_steps``. A row of
    ``orders`` holds an order, its cell, 1 for centre + step or -1 for centre - step, its column.
    ``first`` (5 rows of float64), ``work`` and ``sums`` (float32) are planes to work in.
    """
    for tile in range(n_tiles):
        top = tile * N_BEAMS
        _turns(rho, top, directions, edges, work)
        for row in range(5):
            store(first, row, splat(0.0))
        for row in range(4 * steps.size):
            store(sums, row, narrow(splat(0.0)))
        length = load(shape, 4 * tile + 1)
        inverse_length = 1.0 / select(length > LEAST_LENGTH_M, length, splat(1.0))
        for start in range(0, N_BEAMS, CHUNK):
            _powers(edges, top, start, inverse_length, n_steps, first, work)
            _sum_cells(start, bounds, steps, work, sums)
        _write_orders(4 * tile + 1, tile * N_FEATURES, shape, first, sums, orders, values)
