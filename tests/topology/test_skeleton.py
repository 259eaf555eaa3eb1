"""The skeleton keeps every piece and every ring, is thin, and ends only where it should."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pgm_places._core import thin
from pgm_places.maps.components import squared_clearance
from pgm_places.topology.driving_graph import skeleton_of
from tests.reference.routes import counts, is_simple


@settings(max_examples=60, deadline=None)
@given(raster=arrays(np.bool_, (9, 12)), data=st.data())
def test_thinning_changes_no_piece_and_no_ring_and_leaves_nothing_to_take(
    raster: np.ndarray, data: st.DataObject
) -> None:
    inside = np.pad(raster, 1)
    kept = np.zeros_like(inside)
    cells = [tuple(cell) for cell in np.argwhere(inside).tolist()]
    for cell in data.draw(st.lists(st.sampled_from(cells), max_size=3)) if cells else []:
        kept[cell] = True
    thinned = inside.copy()
    thin(thinned, squared_clearance(~inside), kept)
    assert not (thinned & ~inside).any()
    assert thinned[kept].all()
    assert counts(thinned) == counts(inside)
    for row, column in np.argwhere(thinned & ~kept).tolist():
        assert not is_simple(thinned, (row, column))


def ring() -> np.ndarray:
    inside = np.zeros((21, 31), np.bool_)
    inside[1:20, 1:30] = True
    inside[6:15, 6:25] = False
    return inside


def test_a_ring_closes_and_runs_along_its_middle() -> None:
    inside = ring()
    squared = squared_clearance(~inside)
    found = skeleton_of(inside, squared, np.array([[3, 15]]))
    assert found.points == [(3, 15)]
    [*ways] = found.ways
    assert {tuple(way[0]) for way in ways} == {tuple(way[-1]) for way in ways} == {(3, 15)}
    along = np.vstack(ways)
    assert squared[along[:, 0], along[:, 1]].min() >= 9
    assert {cell for cell in map(tuple, along.tolist()) if cell == (17, 15)}


@pytest.mark.parametrize("turns", [0, 1])
def test_ways_meet_at_shared_points(turns: int) -> None:
    inside = np.zeros((25, 41), np.bool_)
    inside[10:15, 1:40] = True  # a corridor
    for left in (5, 18, 31):
        inside[1:11, left : left + 5] = True
    inside = np.rot90(inside, turns)
    targets = np.array([[2, 7], [2, 20], [2, 33], [12, 2], [12, 38]])
    if turns:
        targets = np.column_stack([40 - targets[:, 1], targets[:, 0]])
    inside = np.ascontiguousarray(inside)
    found = skeleton_of(inside, squared_clearance(~inside), targets)
    assert [*map(list, found.points[:5])] == targets.tolist()
    ends = [tuple(cell) for way in found.ways for cell in (way[0], way[-1])]
    assert {ends.count(tuple(target)) for target in targets.tolist()} == {1}
    assert len(found.points) == 8  # three junctions: one below each of the openings
    assert len(found.ways) == 7
