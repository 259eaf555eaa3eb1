"""The best labels of the parts of segments, by trying all of them."""

from itertools import product

import numpy as np
from numpy.typing import NDArray

INSIDE, RIBBON, OPENING = 4.0, 2.0, 1.0
ROOM_IN_RIBBON = 0.1


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
    ribbons: set[int],
    resolution_m: float,
) -> NDArray[np.int64]:
    """(H, W) labels of the cells; ``odds`` (H, W) speak for label 0 rather than 1."""
    part = parts_of(label, segment)
    count = int(part.max()) + 1
    evidence = [odds[part == p].sum() * resolution_m**2 for p in range(count)]
    for p in range(count):
        if segment[part == p][0] in ribbons and evidence[p] < 0:
            evidence[p] *= ROOM_IN_RIBBON
    cost = border_cost(part, segment, ribbons) * resolution_m * np.pi / 4
    best, highest = label, -np.inf
    for chosen in product((0, 1), repeat=count):
        signs = 1 - 2 * np.array(chosen)
        total = float(np.dot(signs, evidence)) / 2
        differ = np.not_equal.outer(chosen, chosen)
        total -= cost[differ].sum() / 2 if count else 0.0
        if total > highest:
            best, highest = np.where(part >= 0, np.array([*chosen, -1])[part], label), total
    return best


def border_cost(
    part: NDArray[np.int64], segment: NDArray[np.int64], ribbons: set[int]
) -> NDArray[np.float64]:
    """(P, P) what the sides of cells between two parts cost."""
    count = int(part.max()) + 1
    cost = np.zeros((count, count))
    for r, c in np.ndindex(part.shape):
        for i, j in ((r + 1, c), (r, c + 1)):
            if i < part.shape[0] and j < part.shape[1] and min(part[r, c], part[i, j]) >= 0:
                each = {int(segment[r, c]), int(segment[i, j])}
                side = INSIDE if len(each) == 1 else RIBBON if each & ribbons else OPENING
                cost[part[r, c], part[i, j]] += side
                cost[part[i, j], part[r, c]] += side
    return cost
