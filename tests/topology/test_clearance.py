"""Distances to walls and edges, against a search over all cells."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from pgm_places.errors import InputError
from pgm_places.maps.components import squared_clearance
from pgm_places.topology.regions import edges
from tests.strategies import varied_arrays

shapes = st.tuples(st.integers(1, 9), st.integers(1, 9))


def nearest(targets: np.ndarray) -> np.ndarray:
    """To the nearest target of a raster with a frame of targets around it."""
    framed = np.pad(targets, 1, constant_values=True)
    cells = np.argwhere(framed) - 1
    wanted = np.empty(targets.shape, np.int64)
    for r, c in np.ndindex(targets.shape):
        wanted[r, c] = ((cells - (r, c)) ** 2).sum(axis=1).min()
    return wanted


@settings(deadline=None)
@given(blocked=varied_arrays(np.bool_, shapes))
def test_clearance_is_the_distance_to_the_nearest_blocked_cell(blocked: np.ndarray) -> None:
    assert (squared_clearance(blocked) == nearest(blocked)).all()


@pytest.mark.parametrize("n_pillars", [0, 3, 20])
def test_far_walls_are_found_as_near_ones(n_pillars: int) -> None:
    blocked = np.zeros((170, 230), np.bool_)
    blocked.flat[np.random.default_rng(n_pillars).integers(0, blocked.size, n_pillars)] = True
    away = ndimage.distance_transform_edt(~np.pad(blocked, 1, constant_values=True))[1:-1, 1:-1]
    found = squared_clearance(blocked)
    assert (found == np.rint(away**2)).all()
    assert n_pillars > 3 or found.max() > 64**2


@settings(deadline=None)
@given(piece=varied_arrays(np.int32, shapes, elements=st.integers(-1, 2)))
def test_edges_are_beside_another_piece_or_the_outside(piece: np.ndarray) -> None:
    framed = np.pad(piece, 1, constant_values=-9)
    edge = np.zeros(piece.shape, np.bool_)
    for dr, dc in ((0, 1), (2, 1), (1, 0), (1, 2)):
        other = framed[dr : dr + piece.shape[0], dc : dc + piece.shape[1]]
        edge |= other != piece
    assert (edges(piece) == edge).all()


@pytest.mark.parametrize("shape", [(0, 3), (3, 0), (0, 0)])
def test_a_raster_without_cells_has_no_distances(shape: tuple[int, int]) -> None:
    """The kernel wrote before the beginning of the array."""
    assert squared_clearance(np.zeros(shape, np.bool_)).shape == shape


def test_an_array_of_another_shape_is_not_written_to() -> None:
    with pytest.raises(InputError, match=r"out must have shape \(3, 4\)"):
        squared_clearance(np.zeros((3, 4), np.bool_), out=np.empty((2, 4), np.int32))
