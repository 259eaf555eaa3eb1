"""Kernels of the features on the polygon of a scan, its Fourier coefficients apart.

The polygon is star-shaped about the sensor, so that sums over the triangles (sensor, vertex, next
vertex) do not cancel; moments are taken about the sensor and shifted to the centroid in float64.
``directions`` (360, 2) holds cosine and sine of the beams' angles.
"""

import math
from typing import Any

from pgm_places.features._tiles import N_BEAMS, N_FEATURES, TILE_ROWS
from pgm_places.features.laser import first_column
from pgm_places.kernels.jit import inlined, njit
from pgm_places.kernels.lanes import (
    LANES,
    any_lane,
    fma,
    largest,
    load,
    narrow,
    select,
    splat,
    square_root,
    store,
)
from pgm_places.kernels.parts import PART, alike, part

STEP_RAD = 2.0 * math.pi / N_BEAMS
SINE = math.sin(STEP_RAD)
CHORD_SQUARED = 4.0 * math.sin(STEP_RAD / 2.0) ** 2
LEAST_AREA_M2 = 1e-9
LEAST_LENGTH_M = 1e-9
HU_SCALE = 1e-12

AREA, PERIMETER, CENTRE_X, CENTRE_Y = 0, 1, 2, 3
SHAPE_ROWS = 4
"""Rows a tile has in ``shape``: float64 results that later kernels need."""

F5, F9, F21, F29, F31 = (first_column(id) for id in ("f5", "f9", "f21", "f29", "f31"))


@njit
def outline_features(
    rho: Any, n_tiles: int, directions: Any, edges: Any, shape: Any, values: Any
) -> None:
    """Write f5, f6, f7, f31, the lengths of the ``edges`` and area, perimeter and centroid."""
    for tile in range(n_tiles):
        top = tile * TILE_ROWS
        before = load(rho, top)
        x_before = before * directions[0, 0]
        y_before = before * directions[0, 1]
        products = splat(0.0)
        first_x = splat(0.0)
        first_y = splat(0.0)
        length = splat(0.0)
        for beam in range(N_BEAMS):
            other = beam + 1
            after = load(rho, top + other)
            x = after * directions[other, 0]
            y = after * directions[other, 1]
            product = before * after
            step = before - after
            edge = square_root(fma(step, step, product * CHORD_SQUARED))
            store(edges, top + beam, edge)
            length = length + edge
            products = products + product
            first_x = fma(product, x_before + x, first_x)
            first_y = fma(product, y_before + y, first_y)
            before = after
            x_before = x
            y_before = y
        zero = splat(0.0)
        area = products * (SINE / 2.0)
        solid = area > LEAST_AREA_M2
        thirds = select(solid, products * 3.0, splat(1.0))
        centre_x = first_x / thirds
        centre_y = first_y / thirds
        if any_lane(area <= LEAST_AREA_M2):
            sum_x = splat(0.0)
            sum_y = splat(0.0)
            for beam in range(N_BEAMS):
                sum_x = fma(load(rho, top + beam), splat(directions[beam, 0]), sum_x)
                sum_y = fma(load(rho, top + beam), splat(directions[beam, 1]), sum_y)
            centre_x = select(solid, centre_x, sum_x / N_BEAMS)
            centre_y = select(solid, centre_y, sum_y / N_BEAMS)
        store(shape, tile * SHAPE_ROWS + AREA, area)
        store(shape, tile * SHAPE_ROWS + PERIMETER, length)
        store(shape, tile * SHAPE_ROWS + CENTRE_X, centre_x)
        store(shape, tile * SHAPE_ROWS + CENTRE_Y, centre_y)
        long_enough = length > LEAST_LENGTH_M
        roundness = (4.0 * math.pi) * area / select(long_enough, length * length, splat(1.0))
        row = tile * N_FEATURES
        store(values, row + F5, narrow(area))
        store(values, row + F5 + 1, narrow(length))
        ratio = select(solid, length / select(solid, area, splat(1.0)), zero)
        store(values, row + F5 + 2, narrow(ratio))
        store(values, row + F31, narrow(select(long_enough, roundness, zero)))


@njit
def centroid_features(rho: Any, n_tiles: int, directions: Any, shape: Any, values: Any) -> None:
    """Write f9, f9_sd, f29 and f29_sd; ``shape`` comes from ``outline_features``."""
    for tile in range(n_tiles):
        top = tile * TILE_ROWS
        centre_x = load(shape, tile * SHAPE_ROWS + CENTRE_X)
        centre_y = load(shape, tile * SHAPE_ROWS + CENTRE_Y)
        pivot = splat(0.0)
        farthest = splat(0.0)
        total = splat(0.0)
        squares = splat(0.0)
        for beam in range(N_BEAMS):
            length = load(rho, top + beam)
            x = length * directions[beam, 0] - centre_x
            y = length * directions[beam, 1] - centre_y
            distance = square_root(fma(x, x, y * y))
            if beam == 0:
                pivot = distance
            farthest = largest(farthest, distance)
            apart = distance - pivot
            total = total + apart
            squares = fma(apart, apart, squares)
        shift = total / N_BEAMS
        mean = pivot + shift
        std = square_root(largest(squares / N_BEAMS - shift * shift, splat(0.0)))
        spread = farthest > LEAST_LENGTH_M
        scale = select(spread, farthest, splat(1.0))
        zero = splat(0.0)
        row = tile * N_FEATURES
        store(values, row + F9, narrow(mean))
        store(values, row + F9 + 1, narrow(std))
        store(values, row + F29, narrow(select(spread, mean / scale, zero)))
        store(values, row + F29 + 1, narrow(select(spread, std / scale, zero)))


@njit
def moment_features(
    rho: Any, n_tiles: int, directions: Any, shape: Any, work: Any, values: Any
) -> None:
    """Write f21[1..7], f22 and f23; ``work`` has seven rows of float64 to work in."""
    for tile in range(n_tiles):
        row = tile * N_FEATURES
        for lane in range(0, LANES, PART):
            moments = part(work, lane)
            _moments_about_sensor(part(rho, lane), tile * TILE_ROWS, directions, moments)
            _invariants(part(shape, lane), tile * SHAPE_ROWS, moments, row, part(values, lane))
        for k in range(7):
            for lane in range(LANES):
                h = work[k, lane]
                level = math.log10(1.0 + abs(h) / HU_SCALE)
                values[row + F21 + k, lane] = level if h >= 0.0 else -level


@inlined
def _moments_about_sensor(rho: Any, top: int, directions: Any, work: Any) -> None:
    """Write m20, m02, m11, m30, m03, m21, m12 of the area about the sensor to ``work``.

    For a triangle with corners 0, (x, y), (x', y') of doubled area c: m20 = c/12 (x^2 + x x' +
    x'^2), m30 = c/20 (x + x') (x^2 + x'^2), m21 = c/60 ((x + x')^2 (y + y') + 2 (x^2 y + x'^2 y')),
    and so on; c is the product of the two lengths times the sine of the angle between them.
    """
    before = load(rho, top)
    x_before = before * directions[0, 0]
    y_before = before * directions[0, 1]
    xx_before = x_before * x_before
    yy_before = y_before * y_before
    xy_before = x_before * y_before
    xxy_before = xx_before * y_before
    xyy_before = x_before * yy_before
    m20 = m02 = m11 = m30 = m03 = m21 = m12 = alike(before, 0.0)
    for beam in range(N_BEAMS):
        other = beam + 1
        after = load(rho, top + other)
        x = after * directions[other, 0]
        y = after * directions[other, 1]
        xx = x * x
        yy = y * y
        xy = x * y
        xxy = xx * y
        xyy = x * yy
        c = before * after
        sx = x_before + x
        sy = y_before + y
        sxx = sx * sx
        syy = sy * sy
        xx_both = xx_before + xx
        yy_both = yy_before + yy
        m20 = fma(c, sxx + xx_both, m20)
        m02 = fma(c, syy + yy_both, m02)
        m11 = fma(c, fma(sx, sy, xy_before + xy), m11)
        m30 = fma(c * sx, xx_both, m30)
        m03 = fma(c * sy, yy_both, m03)
        m21 = fma(c, fma(sxx, sy, 2.0 * (xxy_before + xxy)), m21)
        m12 = fma(c, fma(syy, sx, 2.0 * (xyy_before + xyy)), m12)
        before = after
        x_before = x
        y_before = y
        xx_before = xx
        yy_before = yy
        xy_before = xy
        xxy_before = xxy
        xyy_before = xyy
    store(work, 0, m20 * (SINE / 24.0))
    store(work, 1, m02 * (SINE / 24.0))
    store(work, 2, m11 * (SINE / 24.0))
    store(work, 3, m30 * (SINE / 20.0))
    store(work, 4, m03 * (SINE / 20.0))
    store(work, 5, m21 * (SINE / 60.0))
    store(work, 6, m12 * (SINE / 60.0))


@inlined
def _invariants(shape: Any, shape_row: int, work: Any, row: int, values: Any) -> None:
    """Replace the moments in ``work`` by Hu's seven invariants; write f22 and f23."""
    area = load(shape, shape_row + AREA)
    cx = load(shape, shape_row + CENTRE_X)
    cy = load(shape, shape_row + CENTRE_Y)
    solid = area > LEAST_AREA_M2
    safe = select(solid, area, 1.0)
    m20 = load(work, 0)
    m02 = load(work, 1)
    m11 = load(work, 2)
    second = safe * safe
    third = second * square_root(safe)
    e20 = (m20 - area * cx * cx) / second
    e02 = (m02 - area * cy * cy) / second
    e11 = (m11 - area * cx * cy) / second
    e30 = (load(work, 3) - cx * (3.0 * m20 - 2.0 * area * cx * cx)) / third
    e03 = (load(work, 4) - cy * (3.0 * m02 - 2.0 * area * cy * cy)) / third
    e21 = (load(work, 5) - 2.0 * cx * (m11 - area * cx * cy) - cy * m20) / third
    e12 = (load(work, 6) - 2.0 * cy * (m11 - area * cx * cy) - cx * m02) / third
    p = e30 + e12
    q = e21 + e03
    r = e30 - 3.0 * e12
    s = 3.0 * e21 - e03
    pp = p * p
    qq = q * q
    apart = e20 - e02
    spread = apart * apart + 4.0 * e11 * e11
    u = p * (pp - 3.0 * qq)
    v = q * (3.0 * pp - qq)
    store(work, 0, select(solid, e20 + e02, 0.0))
    store(work, 1, select(solid, spread, 0.0))
    store(work, 2, select(solid, r * r + s * s, 0.0))
    store(work, 3, select(solid, pp + qq, 0.0))
    store(work, 4, select(solid, r * u + s * v, 0.0))
    store(work, 5, select(solid, apart * (pp - qq) + 4.0 * e11 * p * q, 0.0))
    store(work, 6, select(solid, s * u - r * v, 0.0))
    trace = select(solid, e20 + e02, 1.0)
    compactness = (1.0 / (2.0 * math.pi)) / trace
    store(values, row + F21 + 7, narrow(select(solid, compactness, 0.0)))
    store(values, row + F21 + 8, narrow(select(solid, square_root(spread) / trace, 0.0)))
