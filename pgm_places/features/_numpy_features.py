"""The 321 laser features in vectorised NumPy."""

from math import comb

import numpy as np
from numpy.typing import NDArray

from pgm_places.features.laser import (
    CUT_LENGTHS_M,
    GAP_LENGTHS_M,
    GAP_RATIOS,
    PROMINENCES_M,
)

Array = NDArray[np.float64]

TINY = 1e-9


def features(ranges: Array) -> Array:
    """(N, 321) features of (N, 360) clean ranges in metres, as float64."""
    angles = 2 * np.pi * np.arange(ranges.shape[1]) / ranges.shape[1]
    return np.hstack([_beam_features(ranges, angles), _polygon_features(ranges, angles)])


def _columns(*values: Array) -> Array:
    return np.column_stack(values)


def _beam_features(rho: Array, angles: Array) -> Array:
    n_beams = rho.shape[1]
    after = np.roll(rho, -1, axis=1)
    jump = np.abs(rho - after)
    mean = rho.mean(axis=1)
    std = rho.std(axis=1)
    cuts = [
        np.abs(np.minimum(rho, cut) - np.minimum(after, cut)).mean(axis=1) for cut in CUT_LENGTHS_M
    ]
    gaps = [(jump > gap).sum(axis=1) for gap in GAP_LENGTHS_M]
    a, b = rho + 1e-4, after + 1e-4
    ratio = np.minimum(a, b) / np.maximum(a, b)
    low = [(ratio < bound).sum(axis=1) for bound in GAP_RATIOS]
    longest = rho.max(axis=1)
    safe = np.where(longest > TINY, longest, 1.0)
    fourth = ((rho - mean[:, None]) ** 4).mean(axis=1)
    varied = std > 1e-6
    kurtosis = np.where(varied, fourth / np.where(varied, std, 1.0) ** 4, 0.0)
    distance, angle = _two_minima(rho, angles)
    return _columns(
        jump.mean(axis=1),
        jump.std(axis=1),
        *cuts,
        mean,
        std,
        *gaps,
        *(count / (n_beams - 1) for count in gaps),
        *low,
        *(count / (n_beams - 1) for count in low),
        ratio.mean(axis=1),
        ratio.std(axis=1),
        np.where(longest > TINY, mean / safe, 0.0),
        np.where(longest > TINY, std / safe, 0.0),
        kurtosis,
        *distance.T,
        *angle.T,
    )


def _first_minimum(rho: Array) -> tuple[NDArray[np.int64], Array]:
    """Index of the first lowest beam, and the centre of its circular run of ties relative to it."""
    n_beams = rho.shape[1]
    first = rho.argmin(axis=1)
    rolled = np.take_along_axis(rho, (first[:, None] + np.arange(n_beams)) % n_beams, axis=1)
    tied = rolled == rolled[:, :1]
    ahead = np.where(tied.all(axis=1), n_beams, (~tied).argmax(axis=1))
    behind = np.where(tied.all(axis=1), 0, (~tied[:, ::-1]).argmax(axis=1))
    return first, (ahead - 1 - behind) / 2.0


def _two_minima(rho: Array, angles: Array) -> tuple[Array, Array]:
    n_scans, n_beams = rho.shape
    first, centre = _first_minimum(rho)
    rolled = np.take_along_axis(rho, (first[:, None] + np.arange(n_beams)) % n_beams, axis=1)
    forward = np.maximum.accumulate(rolled, axis=1)
    wrapped = np.concatenate([rolled, rolled[:, :1]], axis=1)
    backward = np.maximum.accumulate(wrapped[:, ::-1], axis=1)[:, :0:-1]
    barrier = np.minimum(forward, backward) - rolled
    offset = np.abs(np.arange(n_beams) - centre[:, None])
    offset = np.minimum(offset, n_beams - offset)
    lowest = rolled[:, 0]
    distances = np.zeros((n_scans, len(PROMINENCES_M)))
    turns = np.zeros_like(distances)
    for column, prominence in enumerate(PROMINENCES_M):
        candidate = np.where(barrier >= prominence, rolled, np.inf)
        second = candidate.min(axis=1)
        found = np.isfinite(second)
        near = np.where(candidate == second[:, None], offset, np.inf).min(axis=1)
        angle = np.where(found, near, 0.0) * angles[1]
        second = np.where(found, second, 0.0)
        square = (second - lowest) ** 2 + 4.0 * lowest * second * np.sin(angle / 2.0) ** 2
        distances[:, column] = np.where(found, np.sqrt(square), 0.0)
        turns[:, column] = angle
    return distances, turns


def _polygon_features(rho: Array, angles: Array) -> Array:
    x, y = rho * np.cos(angles), rho * np.sin(angles)
    x_after, y_after = np.roll(x, -1, axis=1), np.roll(y, -1, axis=1)
    cross = x * y_after - x_after * y
    area = cross.sum(axis=1) / 2
    edge = np.hypot(x_after - x, y_after - y)
    length = edge.sum(axis=1)
    solid = area > TINY
    safe_area = np.where(solid, area, 1.0)
    centre_x = np.where(solid, ((x + x_after) * cross).sum(1) / (6 * safe_area), x.mean(1))
    centre_y = np.where(solid, ((y + y_after) * cross).sum(1) / (6 * safe_area), y.mean(1))
    x, y = x - centre_x[:, None], y - centre_y[:, None]
    distance = np.hypot(x, y)
    farthest = distance.max(axis=1)
    spread = farthest > TINY
    safe_farthest = np.where(spread, farthest, 1.0)
    mean, std = distance.mean(axis=1), distance.std(axis=1)
    safe_length = np.where(length > TINY, length, 1.0)
    return _columns(
        area,
        length,
        np.where(solid, length / safe_area, 0.0),
        mean,
        std,
        np.where(spread, mean / safe_farthest, 0.0),
        np.where(spread, std / safe_farthest, 0.0),
        np.where(length > TINY, 4 * np.pi * area / safe_length**2, 0.0),
        _fourier_features(x, y, edge, safe_length),
        _moment_features(x, y, area, solid),
    )


def _fourier_features(x: Array, y: Array, edge: Array, length: Array) -> Array:
    outline = x + 1j * y
    long_enough = edge > 1e-12
    side = np.where(
        long_enough, (np.roll(outline, -1, axis=1) - outline) / np.where(long_enough, edge, 1), 0
    )
    turn = np.roll(side, 1, axis=1) - side
    start = np.cumsum(edge, axis=1) - edge
    step = np.exp(-2j * np.pi * start / length[:, None])
    power = np.ones_like(step)
    plus, minus = np.empty((2, len(x), 100))
    for n in range(1, 101):
        power = power * step
        scale = length / (2 * np.pi * n) ** 2
        plus[:, n - 1] = np.abs((turn * power).sum(axis=1)) * scale
        minus[:, n - 1] = np.abs((turn * power.conj()).sum(axis=1)) * scale
    first = plus[:, :1]
    usable = first > TINY
    safe = np.where(usable, first, 1.0)
    major, minor = plus[:, :1] + minus[:, :1], np.abs(plus[:, :1] - minus[:, :1])
    axes = np.where(usable, minor / np.where(usable, major, 1.0), 0.0)
    return np.hstack(
        [
            np.where(usable, minus[:, ::-1] / safe, 0.0),
            np.where(usable, plus[:, 1:] / safe, 0.0),
            major,
            minor,
            axes,
            np.where(usable, major / safe, 0.0),
            np.where(usable, minor / safe, 0.0),
            axes,
        ]
    )


def _moment(x: Array, y: Array, p: int, q: int) -> Array:
    x_after, y_after = np.roll(x, -1, axis=1), np.roll(y, -1, axis=1)
    total = np.zeros_like(x)
    for i in range(p + 1):
        for j in range(q + 1):
            weight = comb(i + j, j) * comb(p + q - i - j, q - j)
            total += weight * x_after**i * x ** (p - i) * y_after**j * y ** (q - j)
    cross = x * y_after - x_after * y
    return (cross * total).sum(axis=1) / ((p + q + 2) * (p + q + 1) * comb(p + q, p))


def _moment_features(x: Array, y: Array, area: Array, solid: NDArray[np.bool_]) -> Array:
    safe = np.where(solid, area, 1.0)

    def eta(p: int, q: int) -> Array:
        return np.where(solid, _moment(x, y, p, q) / safe ** (1 + (p + q) / 2), 0.0)

    e20, e02, e11 = eta(2, 0), eta(0, 2), eta(1, 1)
    e30, e03, e21, e12 = eta(3, 0), eta(0, 3), eta(2, 1), eta(1, 2)
    p, q, r, s = e30 + e12, e21 + e03, e30 - 3 * e12, 3 * e21 - e03
    invariants = [
        e20 + e02,
        (e20 - e02) ** 2 + 4 * e11**2,
        r**2 + s**2,
        p**2 + q**2,
        r * p * (p**2 - 3 * q**2) + s * q * (3 * p**2 - q**2),
        (e20 - e02) * (p**2 - q**2) + 4 * e11 * p * q,
        s * p * (p**2 - 3 * q**2) - r * q * (3 * p**2 - q**2),
    ]
    trace = np.where(solid, e20 + e02, 1.0)
    return _columns(
        *(np.sign(h) * np.log10(1 + np.abs(h) / 1e-12) for h in invariants),
        np.where(solid, 1 / (2 * np.pi * trace), 0.0),
        np.where(solid, np.sqrt((e20 - e02) ** 2 + 4 * e11**2) / trace, 0.0),
    )
