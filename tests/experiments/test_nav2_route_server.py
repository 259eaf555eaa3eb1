"""Nodes at which Nav2's Route Server enters and leaves a graph, by the rules of its sources."""

import numpy as np
import pytest

from experiments.nav2_route_server import Costmap, entry, pruned


def room_with_a_wall() -> Costmap:
    """A wall up to row 7 divides ten rows."""
    occupied = np.zeros((10, 11), np.bool_)
    occupied[:8, 5] = True
    return Costmap(occupied, radius_cells=1.0)


def test_the_nearest_node_in_sight_is_taken() -> None:
    cells = np.array([[2, 2], [2, 8]])
    assert entry(room_with_a_wall(), np.array([2, 3]), np.array([0, 1]), cells) == 0


def test_a_node_behind_a_wall_is_not() -> None:
    cells = np.array([[0, 7], [9, 1]])
    pose, nearest = np.array([0, 3]), np.array([0, 1])
    assert entry(room_with_a_wall(), pose, nearest, cells) == 1
    assert entry(room_with_a_wall(), pose, nearest, cells, most_steps=5) == 0  # given up


@pytest.mark.parametrize(
    ("start", "goal", "wanted"),
    [
        ((-1.0, 0.0), (7.0, 0.0), [0, 1, 2]),  # neither lies on an edge
        ((1.0, 1.0), (7.0, 0.0), [1, 2]),  # the start is past the first node
        ((-1.0, 0.0), (5.0, 1.0), [0, 1]),  # the goal is before the last
        ((0.05, 0.0), (5.9, 0.0), [0, 1, 2]),  # both are at their nodes
    ],
)
def test_ends_of_a_route_are_pruned(
    start: tuple[float, float], goal: tuple[float, float], wanted: list[int]
) -> None:
    nodes = np.array([[0.0, 0.0], [3.0, 0.0], [6.0, 0.0]])
    assert [*pruned([0, 1, 2], nodes, np.array(start), np.array(goal))] == wanted
