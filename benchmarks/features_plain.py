"""Two families of features as plain compiled loops over one scan at a time, without lanes."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["fourier_orders", "spreads"]


@njit
def spreads(scans: NDArray[np.float32], out: NDArray[np.float32]) -> None:
    """Write f2, f2_sd, f8, f8_sd, f28, f28_sd and f32 of scans (N, 360) to ``out`` (N, 7)."""
    n_beams = scans.shape[1]
    for n in range(len(scans)):
        scan = scans[n]
        pivot = np.float64(scan[0])
        jump_pivot = abs(pivot - scan[1])
        longest = jump_1 = jump_2 = power_1 = power_2 = power_3 = power_4 = 0.0
        before = pivot
        for beam in range(n_beams):
            after = np.float64(scan[beam + 1 if beam + 1 < n_beams else 0])
            jump = abs(before - after) - jump_pivot
            jump_1 += jump
            jump_2 += jump * jump
            y = after - pivot
            power_1 += y
            power_2 += y * y
            power_3 += y * y * y
            power_4 += y * y * y * y
            longest = after if after > longest else longest
            before = after
        jump_1, m1, m2 = jump_1 / n_beams, power_1 / n_beams, power_2 / n_beams
        m3, m4 = power_3 / n_beams, power_4 / n_beams
        variance = max(m2 - m1 * m1, 0.0)
        fourth = m4 - 4.0 * m1 * m3 + 6.0 * m1 * m1 * m2 - 3.0 * m1 * m1 * m1 * m1
        scale = longest if longest > 1e-9 else np.inf
        std = np.sqrt(variance)
        out[n, 0] = jump_pivot + jump_1
        out[n, 1] = np.sqrt(max(jump_2 / n_beams - jump_1 * jump_1, 0.0))
        out[n, 2], out[n, 3] = pivot + m1, std
        out[n, 4], out[n, 5] = (pivot + m1) / scale, std / scale
        out[n, 6] = max(fourth, 0.0) / (variance * variance) if std > 1e-6 else 0.0


@njit
def fourier_orders(
    scans: NDArray[np.float32],
    directions: NDArray[np.float64],
    orders: NDArray[np.int64],
    out: NDArray[np.float32],
) -> None:
    """Write f16 of scans (N, 360) for each of the orders to ``out`` (N, O); see the real kernel.

    Powers of ``w_k`` are formed one from the other, for a pair of orders n and -n together.
    """
    n_beams, highest = scans.shape[1], np.abs(orders).max()
    x, y = np.empty(n_beams + 1), np.empty(n_beams + 1)
    plus = np.empty((highest + 1, 2))
    minus = np.empty((highest + 1, 2))
    for n in range(len(scans)):
        length = 0.0
        for beam in range(n_beams + 1):
            x[beam] = scans[n, beam % n_beams] * directions[beam, 0]
            y[beam] = scans[n, beam % n_beams] * directions[beam, 1]
            if beam > 0:
                length += np.hypot(x[beam] - x[beam - 1], y[beam] - y[beam - 1])
        plus[:] = 0.0
        minus[:] = 0.0
        place = 0.0
        edge = np.hypot(x[n_beams] - x[n_beams - 1], y[n_beams] - y[n_beams - 1])
        u_before = (x[n_beams] - x[n_beams - 1]) / edge if edge > 1e-12 else 0.0
        v_before = (y[n_beams] - y[n_beams - 1]) / edge if edge > 1e-12 else 0.0
        for beam in range(n_beams):
            edge = np.hypot(x[beam + 1] - x[beam], y[beam + 1] - y[beam])
            u = (x[beam + 1] - x[beam]) / edge if edge > 1e-12 else 0.0
            v = (y[beam + 1] - y[beam]) / edge if edge > 1e-12 else 0.0
            re, im = u_before - u, v_before - v
            cosine, sine = np.cos(2 * np.pi * place / length), np.sin(2 * np.pi * place / length)
            c, s = 1.0, 0.0
            for order in range(1, highest + 1):
                c, s = c * cosine - s * sine, s * cosine + c * sine
                plus[order, 0] += re * c + im * s
                plus[order, 1] += im * c - re * s
                minus[order, 0] += re * c - im * s
                minus[order, 1] += im * c + re * s
            u_before, v_before = u, v
            place += edge
        first = np.hypot(plus[1, 0], plus[1, 1])
        for o in range(len(orders)):
            order = orders[o]
            side: Any = plus if order > 0 else minus
            size = np.hypot(side[abs(order), 0], side[abs(order), 1])
            out[n, o] = size / (first * order * order) if first > 0.0 else 0.0
