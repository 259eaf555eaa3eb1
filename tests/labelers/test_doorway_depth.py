"""Doorways at gates alone, and as deep as asked for."""

import numpy as np
import pytest

from pgm_places import trained_labeler
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.layout import GridLayout
from pgm_places.labelers.place_problem import doorway_zones, doorways_at_gates
from pgm_places.maps.components import connected_components
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.simulation import generate_building
from pgm_places.spaces.doorways import Doorways
from pgm_places.spaces.gates import Gate

RESOLUTION_M = 0.1
SHAPE = (9, 30)


def _passage(
    centre_x_m: float, painted: slice, depth_m: float | None = 0.4
) -> tuple[np.ndarray, np.ndarray, GridLayout, Doorways]:
    """Scores before and after, of a passage along x with a gate."""
    grid = OccupancyGrid(np.zeros(SHAPE, np.int8), resolution_m=RESOLUTION_M)
    layout = LabelGraph.from_grid(grid).layout
    assert isinstance(layout, GridLayout)
    p = np.full((*SHAPE, 3), (0.6, 0.35, 0.05))
    p[:, painted] = (0.05, 0.05, 0.9)
    log_z = np.log(p).reshape(-1, 3)
    gate = Gate((centre_x_m, 0.45), 0.0, width_m=0.9, depth_m=0.2)
    doorways = Doorways(grid, (gate,), np.ones(1), np.zeros(SHAPE, np.int16))
    return log_z, doorways_at_gates(log_z, doorways, layout, 2, depth_m), layout, doorways


def _doorway_columns(log_z: np.ndarray, layout: GridLayout) -> list[int]:
    labels = layout.to_raster(log_z.argmax(axis=1), fill=-1)
    assert (labels == labels[0]).all()
    return np.flatnonzero(labels[0] == 2).tolist()


def test_doorways_are_cut_to_their_depth_around_the_gate() -> None:
    log_z, found, layout, _ = _passage(1.5, slice(10, 20))
    assert _doorway_columns(log_z, layout) == list(range(10, 20))
    assert _doorway_columns(found, layout) == [13, 14, 15, 16]
    assert np.allclose(np.logaddexp.reduce(found.T, axis=0), 0)
    _, found, layout, _ = _passage(0.9, slice(13, 17))  # a gate beside its doorway
    assert _doorway_columns(found, layout) == [13, 14, 15, 16]


def test_odds_of_the_other_labels_stay() -> None:
    log_z, found, _, _ = _passage(1.5, slice(10, 20))
    assert np.allclose(found[:, 0] - found[:, 1], log_z[:, 0] - log_z[:, 1])
    changed = (found != log_z).any(axis=1)
    odds = (found - np.log1p(-np.exp(found)))[:, 2], (log_z - np.log1p(-np.exp(log_z)))[:, 2]
    assert np.allclose((odds[0] - odds[1])[changed], np.log(0.02))


@pytest.mark.parametrize(
    ("depth_m", "reach_m", "odds_near"), [(None, 0.42, 0.4), (0.4, 0.2, 0.02), (2.2, 1.1, 0.02)]
)
def test_odds_fall_with_the_distance_from_the_gate(
    depth_m: float | None, reach_m: float, odds_near: float
) -> None:
    log_z, found, layout, doorways = _passage(1.5, slice(0, 30), depth_m)
    away_m = np.abs((np.arange(30) + 0.5) * RESOLUTION_M - 1.5)
    odds = np.where(away_m < reach_m, 1.0, np.where(away_m < 1.1, odds_near, 0.02))
    zone, log_odds = doorway_zones(log_z, doorways, layout, 2, depth_m)
    added = layout.to_raster(log_odds[zone], fill=0.0)
    assert np.allclose(added, np.log(odds))
    same = layout.to_raster(np.isclose(found, log_z).all(axis=1), fill=False)
    assert (same == (odds == 1)).all()


def test_without_gates_no_doorway_is_left() -> None:
    grid = OccupancyGrid(np.zeros(SHAPE, np.int8), resolution_m=RESOLUTION_M)
    layout = LabelGraph.from_grid(grid).layout
    assert isinstance(layout, GridLayout)
    log_z = np.log(np.full((layout.n_nodes, 3), (0.06, 0.04, 0.9)))
    none = Doorways(grid, (), np.ones(0), np.zeros(SHAPE, np.int16))
    assert (doorways_at_gates(log_z, none, layout, 2).argmax(axis=1) == 0).all()


@pytest.mark.parametrize("turns", range(4))
@pytest.mark.parametrize(("second", "pieces"), [(0.85, 2), (0.75, 1)])
def test_doorways_of_two_sure_gates_do_not_touch(second: float, pieces: int, turns: int) -> None:
    cells = np.full((40, 40), 100, np.int8)
    cells[2:38, 2:38] = 0
    cells[20, :26], cells[20:, 30] = 100, 100  # gaps beside the corner of two walls
    cells[20:28, 30] = 0
    grid = OccupancyGrid(np.rot90(cells, turns), resolution_m=RESOLUTION_M)
    layout = LabelGraph.from_grid(grid).layout
    assert isinstance(layout, GridLayout)
    log_z = np.log(np.full((layout.n_nodes, 3), (0.005, 0.005, 0.99)))
    angle = -turns * np.pi / 2  # rows count upwards
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    middles = (turn @ (np.array([[2.8, 3.05], [2.05, 2.4]]) - 2) + 2).T.tolist()
    gates = tuple(
        Gate((x, y), heading + angle, width_m=0.8, depth_m=0.1)
        for (x, y), heading in zip(middles, (np.pi / 2, 0.0), strict=True)
    )
    both = Doorways(grid, gates, np.array([0.9, second]), np.zeros(grid.shape, np.int16))
    found = doorways_at_gates(log_z, both, layout, 2)
    painted = layout.to_raster(found.argmax(axis=1) == 2, fill=False)
    assert connected_components(painted).count == pieces
    assert all(painted[tuple(grid.cells_at_m([gate.centre_m])[0])] for gate in gates)


def test_the_shipped_model_labels_doorways_of_the_depth_asked_for() -> None:
    building = generate_building(4, size="small")
    labeler = trained_labeler().with_options(whole_spaces=False)
    doorway = labeler.label_names_.index("doorway")
    as_learned = labeler.label(building.grid).labels == doorway
    shallow = labeler.with_options(doorway_depth_m=0.3).label(building.grid).labels == doorway
    assert 0.2 * as_learned.sum() < shallow.sum() < 0.7 * as_learned.sum()
    assert (as_learned | ~shallow).mean() > 0.999
