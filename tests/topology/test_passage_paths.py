"""Paths lead from anchors to passages without leaving the two regions."""

import numpy as np
import pytest

from pgm_places.datasets import generate_building
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.passage_paths import passage_paths
from pgm_places.topology.topological_map import TopologicalMap
from tests.topology.floors import NAMES, floor_grid, floor_map


def check(topology: TopologicalMap) -> None:
    found = passage_paths(topology)
    assert len(found) == 2 * len(topology.connections)
    for k, path in enumerate(found):
        connection = topology.connections[k // 2]
        assert path.region == (connection.first, connection.second)[k % 2]
        assert path.points_m[0] == topology.place(path.region).anchor_m
        assert path.points_m[-1] == connection.point_m
        for start, end in zip(path.points_m, path.points_m[1:], strict=False):
            for t in np.linspace(0.01, 0.99, 60):
                at = topology.region_at(*(np.asarray(start) * (1 - t) + np.asarray(end) * t))
                assert at is not None
                assert at.id in (connection.first, connection.second)


@pytest.mark.parametrize("yaw_rad", [0.0, 1.1])
def test_paths_stay_inside_on_a_floor(yaw_rad: float) -> None:
    check(floor_map(yaw_rad=yaw_rad, origin_xy_m=(2.0, 5.0)))


def test_paths_stay_inside_in_a_building() -> None:
    building = generate_building(size="small")
    check(topological_map(building.grid, building.labels, building.label_names))


def test_a_path_round_a_corner_has_a_corner() -> None:
    labels = np.full((22, 22), -1, np.int16)
    labels[1:21, 1:5] = 0  # an L-shaped corridor
    labels[1:5, 1:21] = 0
    labels[21, 1:5] = 2
    labels[1:5, 21] = 2
    topology = topological_map(floor_grid(labels), labels, NAMES, correct=False)
    check(topology)
    assert max(len(path.points_m) for path in passage_paths(topology)) >= 3
