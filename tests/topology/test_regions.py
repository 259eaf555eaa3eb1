"""Regions and passages of small floors, rotated ones included, worked out by hand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pgm_places.maps.components import connected_components, squared_clearance
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, OccupancyGrid
from pgm_places.topology.regions import (
    Region,
    contacts,
    describe_regions,
    edges,
    extent,
    find_passages,
)
from tests.strategies import varied_arrays

NAMES = ("corridor", "room", "doorway")


def described(labels: np.ndarray, **frame: object) -> tuple[OccupancyGrid, list[Region]]:
    grid = OccupancyGrid(
        np.where(labels >= 0, FREE, OCCUPIED).astype(np.int8),
        **{"resolution_m": 0.5, **frame},  # type: ignore[arg-type]
    )
    pieces = connected_components(labels)
    numbers = range(1, pieces.count + 1)
    regions = describe_regions(
        pieces,
        grid,
        NAMES,
        squared_clearance(~grid.free),
        ids=list(numbers),
        names=[f"place {n}" for n in numbers],
    )
    return grid, regions


def test_a_room_of_three_by_five_cells() -> None:
    labels = np.full((5, 7), -1, np.int16)
    labels[1:4, 1:6] = 1
    _, [room] = described(labels)
    assert room.label == "room"
    assert room.area_m2 == pytest.approx(15 * 0.25)
    assert room.perimeter_m == pytest.approx(16 * 0.5)
    assert room.box_m == pytest.approx((0.5, 0.5, 3.0, 2.0))
    assert room.anchor_m == pytest.approx((1.25, 1.25))  # the first of three equal cells
    assert room.clearance_m == pytest.approx(0.75)  # a cell and a half to the wall's face
    assert room.confidence is None


def test_a_region_prints_on_one_line() -> None:
    labels = np.full((5, 7), -1, np.int16)
    labels[1:4, 1:6] = 1
    _, [room] = described(labels)
    assert repr(room) == "Region(id=1, name='place 1', label='room', area_m2=3.8)"
    assert extent(room) == "x 0.50 to 3.00 m, y 0.50 to 2.00 m"


def test_everything_turns_with_the_map() -> None:
    labels = np.full((6, 9), -1, np.int16)
    labels[1:5, 1:4] = 1
    labels[2:4, 4] = 2
    labels[1:5, 5:8] = 0
    _, plain = described(labels)
    yaw, origin = 0.7, (3.0, -2.0)
    _, turned = described(labels, yaw_rad=yaw, origin_xy_m=origin)
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    for before, after in zip(plain, turned, strict=True):
        assert after.area_m2 == pytest.approx(before.area_m2)
        assert after.perimeter_m == pytest.approx(before.perimeter_m)
        assert after.anchor_m == pytest.approx(tuple(turn @ before.anchor_m + origin))
        for rings_before, rings_after in zip(before.polygons, after.polygons, strict=True):
            for ring_before, ring_after in zip(rings_before, rings_after, strict=True):
                np.testing.assert_allclose(
                    ring_after, ring_before @ turn.T + origin, rtol=0, atol=1e-12
                )
        xs, ys = after.polygons[0][0].T
        assert after.box_m == pytest.approx((xs.min(), ys.min(), xs.max(), ys.max()))


@settings(deadline=None)
@given(
    labels=varied_arrays(
        np.int16, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=st.integers(-1, 1)
    )
)
def test_anchors_are_deepest_then_farthest_from_walls_then_first(labels: np.ndarray) -> None:
    grid, regions = described(labels, yaw_rad=0.3)
    pieces = connected_components(labels)
    depth, clearance = (squared_clearance(part) for part in (edges(pieces.piece), labels < 0))
    assert len(regions) == pieces.count
    for number, region in enumerate(regions):
        cells = np.argwhere(pieces.piece == number)
        best = max(cells.tolist(), key=lambda cell: (depth[*cell], clearance[*cell]))
        assert grid.cells_at_m([region.anchor_m]).tolist() == [best]


def test_a_doorway_five_cells_wide() -> None:
    labels = np.full((9, 9), -1, np.int16)
    labels[1:4, 1:8] = 0
    labels[4, 2:7] = 2
    labels[5:8, 1:8] = 1
    pieces = connected_components(labels)
    found = find_passages(pieces.piece, pieces.count, squared_clearance(labels < 0))
    assert found.pairs.tolist() == [[0, 1], [1, 2]]
    assert found.sides.tolist() == [5, 5]
    assert found.middle_rc.tolist() == [[3.5, 4.0], [4.5, 4.0]]
    assert found.width == pytest.approx([5.0, 5.0])


@settings(deadline=None)
@given(
    labels=varied_arrays(
        np.int16, st.tuples(st.integers(1, 7), st.integers(1, 7)), elements=st.integers(-1, 2)
    )
)
def test_passages_lie_on_the_borders_of_their_pairs(labels: np.ndarray) -> None:
    pieces = connected_components(labels)
    found = find_passages(pieces.piece, pieces.count, squared_clearance(labels < 0))
    assert (found.pairs == contacts(pieces.piece, pieces.count).pairs).all()
    for (i, j), (row, column) in zip(found.pairs, found.middle_rc, strict=True):
        around = {
            int(pieces.piece[int(r), int(c)])
            for r in (np.floor(row), np.ceil(row))
            for c in (np.floor(column), np.ceil(column))
        }
        assert {int(i), int(j)} <= around
