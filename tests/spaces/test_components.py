"""Components, neighbours and distances of small graphs and sets of gates, against SciPy."""

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from scipy import sparse
from scipy.spatial import cKDTree

from pgm_places.spaces.gates import Gates, _others
from pgm_places.spaces.segment_features import components, neighbour_lists


@pytest.mark.parametrize("n_edges", [0, 1, 10, 40, 200])
def test_components_and_neighbours_are_those_of_scipy(n_edges: int) -> None:
    generator = np.random.default_rng(n_edges)
    count = 50
    pairs = generator.integers(0, count, (n_edges, 2))
    pairs = np.unique(np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1), axis=0)
    pairs = pairs[generator.permutation(len(pairs))]
    flipped = generator.random(len(pairs)) < 0.5
    pairs[flipped] = pairs[flipped, ::-1]
    i, j = np.concatenate([pairs, pairs[:, ::-1]]).T
    matrix = sparse.csr_array((np.ones(len(i)), (i, j)), shape=(count, count))
    _, wanted = sparse.csgraph.connected_components(matrix, directed=False)
    start, neighbour = neighbour_lists(pairs, count)
    np.testing.assert_array_equal(components(start, neighbour), wanted)
    np.testing.assert_array_equal(start, matrix.indptr)
    np.testing.assert_array_equal(neighbour, matrix.indices)


class _Points(SimpleNamespace):
    def __len__(self) -> int:
        return len(self.centre_m)


@pytest.mark.parametrize("side_m", [0.0, 2.0, 12.0, 45.0, 300.0])
@pytest.mark.parametrize("count", [0, 1, 2, 70])
def test_distances_between_gates_are_those_of_a_tree(count: int, side_m: float) -> None:
    points = np.random.default_rng(count).random((count, 2)) * side_m
    points[: count // 2] = np.round(points[: count // 2])  # some at the same place
    nearest, near = _others(cast(Gates, _Points(centre_m=points)))
    if not count:
        assert len(nearest) == len(near) == 0
        return
    tree = cKDTree(points)
    apart = np.asarray(tree.query(points, k=[2])[0])[:, 0]  # infinite where there is no other
    np.testing.assert_array_equal(nearest, np.minimum(apart, 10.0))
    within = np.asarray(tree.query_ball_point(points, 3.0, return_length=True))
    np.testing.assert_array_equal(near, within - 1)
