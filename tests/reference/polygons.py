"""Point in polygon, one point and one edge at a time (slow)."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np


def inside_even_odd(x: float, y: float, rings: Sequence[np.ndarray]) -> bool:
    """Whether a ray from the point towards smaller x crosses the rings an odd number of times."""
    odd = False
    for ring in rings:
        for start, end in pairwise(ring):
            low, high = (start, end) if start[1] <= end[1] else (end, start)
            if low[1] <= y < high[1]:
                crossing = low[0] + (y - low[1]) / (high[1] - low[1]) * (high[0] - low[0])
                odd ^= crossing <= x
    return odd


def distance_to_edges(x: float, y: float, rings: Sequence[np.ndarray]) -> float:
    """Distance of the point from the nearest edge."""
    point, nearest = np.array([x, y]), np.inf
    for ring in rings:
        for start, end in pairwise(ring):
            along = end - start
            length = float(along @ along)
            share = 0.0 if length == 0 else float(np.clip((point - start) @ along / length, 0, 1))
            nearest = min(nearest, float(np.linalg.norm(point - start - share * along)))
    return float(nearest)
