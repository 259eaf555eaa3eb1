"""Pieces of free space and their borders, cell by cell."""

from collections import deque

import numpy as np

STEPS = ((0, 1), (0, -1), (1, 0), (-1, 0))


def sums(
    piece: np.ndarray, is_open: np.ndarray, cells: np.ndarray, values: np.ndarray, reach: int
) -> np.ndarray:
    """(5, P) sides at walls, at unknown space, at other pieces; free cells; largest value."""
    found = np.zeros((5, piece.max() + 1), np.int64)
    for r, c in np.argwhere(piece >= 0):
        p = piece[r, c]
        found[3, p] += cells[r, c] == 0
        found[4, p] = max(found[4, p], values[r, c])
        for dr, dc in STEPS:
            if is_open[r + dr, c + dc]:
                found[2, p] += piece[r + dr, c + dc] != p
                continue
            behind = []
            for k in range(1, reach + 1):
                if is_open[r + k * dr, c + k * dc]:
                    break
                behind.append(cells[r + k * dr, c + k * dc])
            found[0 if 100 in behind else 1, p] += 1
    return found


def steps_to(is_open: np.ndarray, sources: np.ndarray) -> np.ndarray:
    """(H, W) steps over sides through open cells to the nearest source, -1 where there is none."""
    height, width = is_open.shape
    away = np.full((height, width), -1)
    queue = deque((int(r), int(c)) for r, c in np.argwhere(sources))
    away[sources] = 0
    while queue:
        r, c = queue.popleft()
        for dr, dc in STEPS:
            s, d = r + dr, c + dc
            inside = 0 <= s < height and 0 <= d < width
            if inside and is_open[s, d] and away[s, d] < 0:
                away[s, d] = away[r, c] + 1
                queue.append((s, d))
    return away
