"""Scores of regions and connections on a floor where every error is put in by hand."""

import numpy as np
import pytest

from experiments.paper.region_scores import RegionScores, fill_labels, score_regions
from pgm_places.errors import InputError
from pgm_places.topology.from_labels import topological_map
from tests.topology.floors import NAMES, floor_grid, floor_labels, floor_map


def scored(labels: np.ndarray) -> RegionScores:
    grid = floor_grid(floor_labels())
    return score_regions(topological_map(grid, labels, NAMES, correct=False), floor_map())


def test_the_truth_is_perfect() -> None:
    scores = scored(floor_labels())
    for score in scores.classes.values():
        assert score.hit == score.n_true == score.n_found
        assert (score.missed, score.merged, score.split, score.invented) == (0, 0, 0, 0)
        assert (score.recall, score.precision) == (1.0, 1.0)
    assert scores.purity == 1.0
    assert (scores.connections_true, scores.connections_hit) == (3, 3)


def test_a_missed_doorway_and_its_connection() -> None:
    labels = floor_labels()
    labels[4, 3:6] = -1
    scores = scored(labels)
    assert scores.classes["doorway"].missed == 1
    assert scores.classes["doorway"].recall == pytest.approx(2 / 3)
    assert (scores.connections_hit, scores.connections_missed) == (2, 1)
    assert (scores.connections_found, scores.connections_invented) == (2, 0)


def test_a_room_called_corridor_merges_nothing_but_is_missed() -> None:
    labels = floor_labels()
    labels[5:10, 1:8] = 0
    scores = scored(labels)
    assert scores.classes["room"].missed == 1
    assert scores.classes["corridor"].invented == 1
    assert scores.classes["corridor"].hit == 1
    assert scores.connections_hit == 3  # the places are there, whatever they are called


def test_merged_rooms() -> None:
    true = floor_labels()
    true[7, 8] = 2  # a doorway between the first two rooms
    found = true.copy()
    found[7, 8] = 1  # that is taken for a room
    grid = floor_grid(true)
    scores = score_regions(
        topological_map(grid, found, NAMES, correct=False),
        topological_map(grid, true, NAMES, correct=False),
    )
    room = scores.classes["room"]
    assert (room.hit, room.merged, room.missed) == (1, 2, 0)
    assert scores.classes["doorway"].missed == 1
    assert scores.purity < 1
    assert scores.connections_missed == 2


def test_a_split_room_and_an_invented_doorway() -> None:
    labels = floor_labels()
    labels[7, 17:24] = 2
    scores = scored(labels)
    assert scores.classes["room"].split == 1
    assert scores.classes["doorway"].invented == 1
    assert scores.classes["doorway"].precision == pytest.approx(3 / 4)


def test_a_window_leaves_the_rest_out() -> None:
    labels = floor_labels()
    labels[4, 3:6] = -1
    window = np.zeros(labels.shape, np.bool_)
    window[:, 8:] = True
    grid = floor_grid(floor_labels())
    found = topological_map(grid, labels, NAMES)
    scores = score_regions(found, floor_map(), window=window)
    assert scores.classes["room"].n_true == 2
    assert scores.classes["doorway"].missed == 0
    with pytest.raises(InputError, match="window must have shape"):
        score_regions(found, floor_map(), window=np.ones((2, 2)))


def test_gaps_are_filled_from_the_nearest_label() -> None:
    grid = floor_grid(np.zeros((1, 7), np.int16), resolution_m=0.1)
    labels = np.array([[0, -1, -1, 1, -1, -1, -1]], np.int16)
    found = fill_labels(grid, labels, NAMES, reach_m=0.2)
    assert found.tolist() == [[0, 0, 1, 1, 1, 1, -1]]
    assert labels.tolist() == [[0, -1, -1, 1, -1, -1, -1]]
    labels[labels == 1] = -1
    assert fill_labels(grid, labels, NAMES, reach_m=0.2).tolist() == [[0, 0, 0, -1, -1, -1, -1]]
