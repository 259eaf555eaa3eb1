"""Pictures of topological maps: right way up, every place drawn, rotated and large maps too."""

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.palette import LABEL_COLOURS, rgb_of
from pgm_places.pictures.topology_pictures import count_line, topology_drawing
from pgm_places.topology.from_labels import topological_map
from tests.topology.floors import NAMES, floor_map, gated_floor_map


def drawn(**frame: object) -> np.ndarray:
    topology = floor_map(**frame)
    data = topology_drawing(topology.grid, topology, title="a floor").png()
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))


def test_rooms_are_drawn_above_the_corridor_twice() -> None:
    picture = drawn()
    middle = picture.shape[0] // 2
    for part in (picture[:middle], picture[middle:]):
        rows = {}
        for label, colour in (("room", LABEL_COLOURS[1]), ("doorway", LABEL_COLOURS[2])):
            hit = (part == rgb_of(colour)).all(axis=2)
            assert hit.sum() > 100  # the nodes
            rows[label] = np.argwhere(hit)[:, 0].mean()
        assert rows["room"] < rows["doorway"]


def test_a_rotated_map_is_drawn_on_its_own_raster() -> None:
    plain, turned = drawn(), drawn(yaw_rad=0.7, origin_xy_m=(3.0, 4.0))
    # Rounding may shade the edge of a node differently, no more.
    assert np.abs(plain.astype(int) - turned).mean() < 0.05


@pytest.mark.parametrize("shape", [(1, 3), (3, 1), (1200, 1500)])
@pytest.mark.parametrize("first", [0, -1])
def test_any_shape_with_and_without_places(shape: tuple[int, int], first: int) -> None:
    labels = np.full(shape, first, np.int16)
    labels[:, shape[1] // 2 :] += 1 + first
    grid = OccupancyGrid(np.zeros(shape, np.int8), 0.05)
    found = topological_map(grid, labels, NAMES, correct=first < 0)
    assert topology_drawing(grid, found).png()[1:4] == b"PNG"


def test_gates_are_drawn_over_the_map() -> None:
    topology = gated_floor_map()
    bare = replace(
        topology, regions=tuple(replace(region, gate=None) for region in topology.regions)
    )
    with_gate, without = (
        np.asarray(Image.open(io.BytesIO(topology_drawing(item.grid, item).png())).convert("RGB"))
        for item in (topology, bare)
    )
    changed = np.argwhere((with_gate != without).any(axis=2))
    assert len(changed) > 20
    assert np.ptp(changed[:, 0]) > np.ptp(changed[:, 1])  # the door stands upright


def test_one_connection_is_counted_in_the_singular() -> None:
    found = floor_map()
    one = replace(found, connections=found.connections[:1])
    assert count_line(one).endswith("3 doorways; 1 connection")
    assert count_line(replace(found, connections=())).endswith("; 0 connections")
    assert count_line(found).endswith("; 6 connections")
