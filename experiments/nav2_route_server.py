"""Where Nav2's Route Server enters and leaves a route graph, by its own sources.

``nav2_route/src/goal_intent_extractor.cpp`` takes, of the five nodes nearest to a pose, the first
if the costmap shows nothing on the straight line to it; else the one that a breadth-first search
over the costmap reaches first (``include/nav2_route/goal_intent_search.hpp``). It then leaves out
the first node where the pose is ahead of it on the first edge, and the last where the goal is
behind it on the last edge. Values are those of its default parameters.
"""

from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pgm_places.maps.clearance import squared_clearance

NEAREST_NODES = 5
MOST_STEPS_FROM_START = 10_000
FROM_START_M, FROM_GOAL_M = 0.10, 0.15
"""Nearer than this to a node, a pose is at the node, which stays."""
_AROUND = [(0, -1), (0, 1), (-1, 0), (1, 0), (-1, -1), (-1, 1), (1, -1), (1, 1)]


class Costmap:
    """What a costmap of a map shows: obstacles, and where the middle of the robot hits them.

    Unknown cells are no obstacles, as in the sources.
    """

    def __init__(self, occupied: NDArray[np.bool_], radius_cells: float) -> None:
        self.lethal = occupied
        self.inscribed = squared_clearance(occupied) <= radius_cells**2

    def sees(self, one: NDArray[np.int64], other: NDArray[np.int64]) -> bool:
        """Whether the straight line between two cells hits nothing."""
        n = int(np.abs(other - one).max())
        line = np.rint(one + np.linspace(0, 1, n + 1)[:, None] * (other - one)).astype(np.int64)
        return not self.inscribed[line[:, 0], line[:, 1]].any()

    def first_reached(
        self, start: NDArray[np.int64], goals: NDArray[np.int64], most_steps: float
    ) -> int | None:
        """Which of some cells a breadth-first search over cells without obstacles meets first."""
        number = {(int(r), int(c)): k for k, (r, c) in reversed([*enumerate(goals)])}
        queue = deque([(int(start[0]), int(start[1]))])
        seen = {queue[0]}
        steps = 0
        while queue and steps < most_steps:
            cell = queue.popleft()
            steps += 1
            if cell in number:
                return number[cell]
            for down, right in _AROUND:
                near = (cell[0] + down, cell[1] + right)
                inside = 0 <= near[0] < len(self.lethal) and 0 <= near[1] < self.lethal.shape[1]
                if inside and near not in seen and not self.lethal[near]:
                    seen.add(near)
                    queue.append(near)
        return None


def entry(
    costmap: Costmap,
    pose: NDArray[np.int64],
    nearest: NDArray[np.int64],
    cells: NDArray[np.int64],
    most_steps: float = np.inf,
) -> int:
    """The node that a pose, a cell, is joined to: one of the ``nearest``, whose first is nearest.

    ``cells`` (N, 2) are those of all nodes.
    """
    if costmap.sees(cells[nearest[0]], pose):
        return int(nearest[0])
    found = costmap.first_reached(pose, cells[nearest], most_steps)
    return int(nearest[found or 0])


def pruned(
    path: Sequence[int],
    nodes_m: NDArray[np.float64],
    start_m: NDArray[np.float64],
    goal_m: NDArray[np.float64],
) -> Sequence[int]:
    """The nodes of a route without the first and the last where the poses lie on their edges."""
    if len(path) > 1:
        offset = start_m - nodes_m[path[0]]
        ahead = (nodes_m[path[1]] - nodes_m[path[0]]) @ offset > 0
        if ahead and np.hypot(*offset) > FROM_START_M:
            path = path[1:]
    if len(path) > 1:
        offset = goal_m - nodes_m[path[-1]]
        behind = (nodes_m[path[-1]] - nodes_m[path[-2]]) @ offset < 0
        if behind and np.hypot(*offset) > FROM_GOAL_M:
            path = path[:-1]
    return path
