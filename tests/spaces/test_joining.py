"""Joining segments to places: against all partitions of small graphs, and what must not matter."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places.spaces.places import join
from tests.strategies import edge_lists


def cost(group: np.ndarray, pairs: np.ndarray, weights: np.ndarray) -> float:
    """What joining gives away: the weights between groups."""
    return float(weights[group[pairs[:, 0]] != group[pairs[:, 1]]].sum())


def connected(group: np.ndarray, pairs: np.ndarray) -> bool:
    """Whether every group hangs together by its own pairs."""
    inside = pairs[group[pairs[:, 0]] == group[pairs[:, 1]]]
    return join(len(group), inside, np.full(len(inside), np.inf)).max() == group.max()


def lowest_cost(count: int, pairs: np.ndarray, weights: np.ndarray) -> float:
    every = (np.array(each) for each in itertools.product(range(count), repeat=count))
    return min(cost(group, pairs, weights) for group in every)


@st.composite
def weighed_graphs(draw: st.DrawFn, *, forest: bool) -> tuple[int, np.ndarray, np.ndarray]:
    count = draw(st.integers(2, 5))
    pairs = draw(edge_lists(count, forest=forest)).reshape(-1, 2)
    weights = draw(st.lists(st.integers(-9, 9), min_size=len(pairs), max_size=len(pairs)))
    return count, pairs, np.array(weights, np.float64)


@given(graph=weighed_graphs(forest=True))
def test_without_rings_every_pair_is_judged_by_itself(
    graph: tuple[int, np.ndarray, np.ndarray],
) -> None:
    count, pairs, weights = graph
    group = join(count, pairs, weights)
    assert (group[pairs[:, 0]] == group[pairs[:, 1]]).tolist() == (weights >= 0).tolist()
    assert cost(group, pairs, weights) == lowest_cost(count, pairs, weights)


@given(graph=weighed_graphs(forest=False), order=st.permutations(range(5)))
def test_groups_hang_together_and_cost_no_more_than_none(
    graph: tuple[int, np.ndarray, np.ndarray], order: list[int]
) -> None:
    count, pairs, weights = graph
    group = join(count, pairs, weights)
    assert connected(group, pairs)
    assert lowest_cost(count, pairs, weights) <= cost(group, pairs, weights)
    number = np.argsort([k for k in order if k < count])  # other numbers of the same nodes
    again = join(count, number[pairs], weights)[number]
    assert len({*zip(group.tolist(), again.tolist(), strict=True)}) == group.max() + 1


@pytest.mark.parametrize(
    ("weights", "groups"),
    [
        ([2.0, -1.0, 1.0], [0, 0, 0]),  # joined by 2, then 1 outweighs -1
        ([2.0, -1.0, 0.5], [0, 0, 1]),  # -1 outweighs the other way into the third
        ([np.inf, -9.0, 2.0], [0, 0, 1]),
        ([np.inf, -9.0, np.inf], [0, 0, 0]),  # certain both ways
        ([3.0, -np.inf, 9.0], [0, 1, 0]),  # -inf outweighs all that is less than certain
    ],
)
def test_a_ring_is_one_or_cut_twice(weights: list[float], groups: list[int]) -> None:
    ring = np.array([[0, 1], [1, 2], [0, 2]])
    assert join(3, ring, np.array(weights)).tolist() == groups
    assert join(3, ring[::-1, ::-1], np.array(weights[::-1])).tolist() == groups


def test_nodes_without_pairs_stay_alone() -> None:
    none = np.empty((0, 2), np.int32)
    assert join(3, none, np.empty(0)).tolist() == [0, 1, 2]
    assert join(0, none, np.empty(0)).tolist() == []
