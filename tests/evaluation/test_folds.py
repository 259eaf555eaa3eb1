"""Folds: whole buildings, or stripes of one."""

import dataclasses

import numpy as np
import pytest

from pgm_places import LabelGraph, LabelledMap, OccupancyGrid
from pgm_places.errors import InputError
from pgm_places.evaluation.folds import building_folds, contiguous_blocks, contiguous_parts
from tests.refusals import refused


@pytest.fixture
def known() -> LabelledMap:
    grid = OccupancyGrid(np.zeros((4, 30), np.int8), 0.05)
    return LabelledMap(grid, np.zeros(grid.shape, np.int16))


def test_buildings_are_held_out_whole_and_a_single_one_in_blocks(known: LabelledMap) -> None:
    def folds(*buildings: str | None) -> list[list[int]]:
        maps = [dataclasses.replace(known, building=name) for name in buildings]
        masks = [item.labelled_cells for item in maps]
        found = np.split(building_folds(maps, masks, 3), len(maps))
        return [np.unique(part).tolist() for part in found]

    assert folds("a", "b", "a", "c", "d") == [[0], [1], [0], [2], [0]]
    assert folds(None, None) == [[0], [1]]
    assert folds("a", "a") == [[0, 1, 2], [0, 1, 2]]
    assert folds(None) == [[0, 1, 2]]


def test_blocks_are_stripes_of_equal_size() -> None:
    cells = np.argwhere(np.ones((4, 30), np.bool_))
    blocks = contiguous_blocks(cells, 3)
    assert np.bincount(blocks).tolist() == [40, 40, 40]
    assert (np.diff(blocks[cells[:, 0] == 0]) >= 0).all()


def test_blocks_are_stripes_across_the_longer_side() -> None:
    graph = LabelGraph.from_grid(np.ones((3, 8), np.bool_))
    parts = contiguous_parts(graph, 4).reshape(3, 8)
    np.testing.assert_array_equal(parts, np.tile(np.repeat(np.arange(4), 2), (3, 1)))
    chain = LabelGraph.from_edges(4, [(0, 1)])
    assert contiguous_parts(chain, 2).tolist() == [0, 0, 1, 1]


def test_places_at_one_position_are_in_one_block_whatever_their_type() -> None:
    cells = np.argwhere(np.ones((3, 7), np.bool_))
    blocks = contiguous_blocks(cells, 3)
    assert all(len(np.unique(blocks[cells[:, 1] == column])) == 1 for column in range(7))
    graph = LabelGraph.from_points(0.05 * cells[:, ::-1])
    assert (contiguous_parts(graph, 3) == blocks).all()
    assert len(contiguous_blocks(np.zeros((0, 2)), 3)) == 0
    refused(InputError, "n_blocks must be at least 1, got 0", contiguous_blocks, cells, 0)


def test_nodes_without_a_layout_are_cut_label_by_label() -> None:
    """Every part has its share of every label, as consecutive nodes; a chain is cut as it runs."""
    labels = np.repeat([0, 1, -1, 2], [10, 5, 15, 20])
    ring = LabelGraph.from_edges(50, [(i, (i + 1) % 50) for i in range(50)])
    parts = contiguous_parts(ring, 5, labels)
    for label, share in ((0, 2), (1, 1), (-1, 3), (2, 4)):
        assert parts[labels == label].tolist() == np.repeat(np.arange(5), share).tolist()
    chain = LabelGraph.from_lattice((50,))
    assert contiguous_parts(chain, 5, labels).tolist() == np.repeat(np.arange(5), 10).tolist()
