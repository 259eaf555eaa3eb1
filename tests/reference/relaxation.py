"""Relaxation labelling cell by cell and label by label, and its statistics pair by pair."""

import numpy as np
from numpy.typing import NDArray

STEPS = [(dr, dc) for dr in (-1, 0, 1) for dc in (-1, 0, 1) if (dr, dc) != (0, 0)]


def relaxed_grid(
    beliefs: NDArray[np.float64],
    walls: NDArray[np.bool_],
    r: NDArray[np.float64],
    *,
    diagonal_weight: float = 1.0,
    damping: float = 0.0,
    max_iterations: int = 1,
) -> NDArray[np.float64]:
    """(H, W, K) beliefs after some iterations; NaN marks cells that are no nodes."""
    height, width, n_labels = beliefs.shape
    side = 1 / (4 + 4 * diagonal_weight)
    for _ in range(max_iterations):
        before = beliefs.copy()
        for y, x in np.ndindex(height, width):
            if np.isnan(before[y, x, 0]):
                continue
            q = np.zeros(n_labels)
            for d, (dy, dx) in enumerate(STEPS):
                if not (0 <= y + dy < height and 0 <= x + dx < width):
                    continue
                there = np.zeros(n_labels + 1)
                if walls[y + dy, x + dx]:
                    there[n_labels] = 1
                elif not np.isnan(before[y + dy, x + dx, 0]):
                    there[:n_labels] = before[y + dy, x + dx]
                c = side if 0 in (dy, dx) else diagonal_weight * side
                table = r[d] if len(r) == 8 else r[0]
                for label in range(n_labels):
                    for other in range(n_labels + 1):
                        q[label] += c * table[label, other] * there[other]
            grown = before[y, x] * np.maximum(1 + q, 0)
            if grown.sum() > 1e-12:
                beliefs[y, x] = (1 - damping) * grown / grown.sum() + damping * before[y, x]
    return beliefs


def relaxed_graph(
    beliefs: NDArray[np.float64],
    entries: list[tuple[int, int, float, int]],
    r: NDArray[np.float64],
    *,
    damping: float = 0.0,
    max_iterations: int = 1,
) -> NDArray[np.float64]:
    """(N, K) beliefs after some iterations; an entry is node, neighbour, weight, table."""
    beliefs = beliefs.copy()
    for _ in range(max_iterations):
        before = beliefs.copy()
        support = np.ones_like(beliefs)
        for i, j, weight, table in entries:
            support[i] += weight * r[table] @ before[j]
        for i, grown in enumerate(before * np.maximum(support, 0)):
            if grown.sum() > 1e-12:
                beliefs[i] = (1 - damping) * grown / grown.sum() + damping * before[i]
    return beliefs


def pair_counts(labels: NDArray[np.int64], n_labels: int) -> NDArray[np.int64]:
    """(8, L, L) ordered pairs of labelled neighbours, by direction."""
    counts = np.zeros((8, n_labels, n_labels), np.int64)
    height, width = labels.shape
    for y, x in np.ndindex(height, width):
        for d, (dy, dx) in enumerate(STEPS):
            if 0 <= y + dy < height and 0 <= x + dx < width:
                here, there = labels[y, x], labels[y + dy, x + dx]
                if here >= 0 and there >= 0:
                    counts[d, here, there] += 1
    return counts


def yamamoto(joint: NDArray[np.float64]) -> NDArray[np.float64]:
    """Equation 6, one pair of labels at a time."""
    p = joint.sum(axis=1) / joint.sum()
    r = np.zeros_like(joint)
    for here in range(len(joint)):
        for there in range(len(joint)):
            column = joint[:, there].sum()
            if p[here] in (0.0, 1.0) or column == 0:
                continue
            conditional = joint[here, there] / column
            if p[here] < conditional:
                r[here, there] = (1 - p[here] / conditional) / (1 - p[here])
            else:
                r[here, there] = conditional / p[here] - 1
    return r
