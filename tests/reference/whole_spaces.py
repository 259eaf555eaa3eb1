"""The best labels of the parts of segments, by trying all of them."""

from itertools import product

import numpy as np
from numpy.typing import NDArray

INSIDE, OPENING = 4.0, 1.0


def parts_of(label: NDArray[np.int64], segment: NDArray[np.int64]) -> NDArray[np.int64]:
    """(H, W) the connected cells of one segment and one label 0 or 1, others -1."""

    def same(i: int, j: int, r: int, c: int) -> bool:
        return bool(label[i, j] == label[r, c] and segment[i, j] == segment[r, c])

    part, count = np.full(label.shape, -1), 0
    for start in zip(*np.nonzero((label == 0) | (label == 1)), strict=True):
        if part[start] >= 0:
            continue
        part[start], waiting = count, [start]
        while waiting:
            r, c = waiting.pop()
            for i, j in product((r - 1, r, r + 1), (c - 1, c, c + 1)):
                inside = 0 <= i < label.shape[0] and 0 <= j < label.shape[1]
                if inside and part[i, j] < 0 and same(i, j, r, c):
                    part[i, j] = count
                    waiting.append((i, j))
        count += 1
    return part


def best_labels(
    odds: NDArray[np.float64],
    label: NDArray[np.int64],
    segment: NDArray[np.int64],
    resolution_m: float,
) -> NDArray[np.int64]:
    """(H, W) labels of the cells; ``odds`` (H, W) speak for label 0 rather than 1."""
    part = parts_of(label, segment)
    best, highest = label, -np.inf
    for chosen in product((0, 1), repeat=int(part.max()) + 1):
        now = np.where(part >= 0, np.array([*chosen, -1])[part], label)
        total = resolution_m**2 * (odds[now == 0].sum() - odds[now == 1].sum()) / 2
        for one, other, near, far in (
            (now[1:], now[:-1], segment[1:], segment[:-1]),
            (now[:, 1:], now[:, :-1], segment[:, 1:], segment[:, :-1]),
        ):
            border = (one + other == 1) & (np.minimum(one, other) == 0)
            cost = np.where(near == far, INSIDE, OPENING)
            total -= resolution_m * np.pi / 4 * cost[border].sum()
        if total > highest:
            best, highest = now, total
    return best
