import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places.errors import InputError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.raster_edges import EdgeKind
from pgm_places.trajectories.path import WAY_RATIO, PathSegments, loop_links


def obvious_links(positions: np.ndarray, within_m: float) -> set[tuple[int, int]]:
    """Step by step: the nearest step of each earlier run of steps within reach."""
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(positions, axis=0).T))])
    found = set()
    for late in range(len(positions)):
        distance = np.hypot(*(positions - positions[late]).T)
        near = [
            early
            for early in range(late)
            if distance[early] <= within_m and way[late] - way[early] > WAY_RATIO * within_m
        ]
        passes: list[list[int]] = []
        for early in near:
            if passes and passes[-1][-1] == early - 1:
                passes[-1].append(early)
            else:
                passes.append([early])
        found |= {(min(steps, key=lambda step: (distance[step], step)), late) for steps in passes}
    return found


@given(st.integers(2, 40), st.integers(0, 200), st.sampled_from([0.3, 1.0, 2.0]))
def test_links_are_those_found_step_by_step(n_steps: int, seed: int, within_m: float) -> None:
    positions = np.random.default_rng(seed).normal(scale=0.7, size=(n_steps, 2)).cumsum(axis=0)
    found = loop_links(positions, within_m)
    assert len(found) == len({tuple(pair) for pair in found.tolist()})
    assert {tuple(pair) for pair in found.tolist()} == obvious_links(positions, within_m)


def test_a_robot_that_turns_on_the_spot_closes_no_loop() -> None:
    trembling = 0.001 * np.random.default_rng(0).normal(size=(200, 2))
    assert len(loop_links(trembling, 0.5)) == 0


def test_an_earlier_pass_counts_once_however_slow_it_was() -> None:
    lap = np.linspace(0, 2 * np.pi, 80)[:-1]
    circle = 5 * np.column_stack([np.cos(lap), np.sin(lap)])
    slow = circle.repeat(10, axis=0)
    links = loop_links(np.concatenate([slow, circle]), 0.1)
    assert links[:, 1].tolist() == list(range(len(slow), len(slow) + len(circle)))


@pytest.mark.parametrize("within_m", [-0.1, float("nan")])
def test_a_distance_of_at_least_zero_is_needed(within_m: float) -> None:
    with pytest.raises(InputError, match="within_m must be at least 0"):
        loop_links(np.zeros((2, 2)), within_m)


def test_segments_of_two_passes_are_joined_in_a_graph_of_its_own_kind_of_edges() -> None:
    there = np.arange(6.0)
    way = np.column_stack([np.append(there, there[::-1]), np.zeros(12)])
    segments = PathSegments(way, 0.5)
    chain, looped = segments.graph(), segments.graph(loop_m=0.1)
    assert chain.is_chain and not looped.is_chain
    assert looped.edge_kind is not None
    loops = looped.edges[looped.edge_kind == EdgeKind.LOOP]
    np.testing.assert_array_equal(
        way[segments.first][loops[:, 0]], way[segments.first][loops[:, 1]]
    )
    in_time = looped.edges[looped.edge_kind == EdgeKind.TIME]
    np.testing.assert_array_equal(in_time, chain.edges)


def test_no_loops_leave_a_chain() -> None:
    assert LabelGraph.from_trajectory(np.zeros((3, 2)), loops=np.empty((0, 2), int)).is_chain
