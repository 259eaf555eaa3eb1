"""Doorways: accepted gates with the places that they part, on the map's cells and on others."""

import numpy as np
import pytest

from pgm_places.errors import InputError
from pgm_places.maps.coarsening import coarsen, refine
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.spaces.doorways import Doorways
from pgm_places.spaces.gates import gate_candidates
from pgm_places.spaces.places import places_between
from pgm_places.spaces.segmentation import Segmentation
from tests.refusals import refused
from tests.spaces.floors import corridor_with_rooms, grid_of, two_rooms


def found_in(free: np.ndarray, probability: float) -> Doorways:
    gates = gate_candidates(Segmentation.of(grid_of(free)))
    each = np.full(len(gates), probability)
    return Doorways.of(places_between(gates, each), each)


def test_accepted_gates_come_with_their_probability_and_places() -> None:
    found = found_in(corridor_with_rooms(), 0.75)
    assert len(found) == 3
    assert found.probability.tolist() == [0.75] * 3
    assert len(np.unique(found.place[found.place >= 0])) == 4


def test_doorways_that_are_known_are_certain() -> None:
    found = found_in(two_rooms(), 0.75)
    more = found.with_known([found.gates[0], found.gates[0]])
    assert more.probability.tolist() == [0.75, 1.0, 1.0]
    assert len(more) == 3 and np.array_equal(more.place, found.place)


@pytest.mark.parametrize("resolution_m", [0.03, 0.05, 0.3])
def test_other_cells_lie_in_the_place_at_their_centre(resolution_m: float) -> None:
    found = found_in(two_rooms(), 0.9)
    finer = resolution_m < 0.1
    other = (refine if finer else coarsen)(found.grid, resolution_m)
    assert other.shape != found.grid.shape
    asked = np.ones(other.shape, np.bool_) if finer else other.free
    r, c = found.grid.cells_at_m(other.cell_centres_m(np.argwhere(asked))).T
    np.testing.assert_array_equal(found.place_on(other)[asked], found.place[r, c])


def test_a_map_elsewhere_is_refused() -> None:
    found, cells = found_in(two_rooms(), 0.9), np.zeros((4, 4), np.int8)
    for message, grid in (
        (r"found in a map with its origin at \(0.0, 0.0\)", OccupancyGrid(cells, 0.2, (1.0, 0.0))),
        (r"but the map has \(1.0, 0.0\)", OccupancyGrid(found.grid.cells, 0.1, (1.0, 0.0))),
        (r"a map of 4.3 x 8.3 m, but the map has 0.8 x 0.8 m", OccupancyGrid(cells, 0.2)),
    ):
        refused(InputError, message, found.place_on, grid)


def test_probabilities_and_places_must_fit() -> None:
    found = found_in(two_rooms(), 0.9)
    with pytest.raises(InputError, match=r"one number per gate \(1\), got shape \(2,\)"):
        Doorways(found.grid, found.gates, np.zeros(2), found.place)
    with pytest.raises(InputError, match="place must have the map's shape"):
        Doorways(found.grid, found.gates, found.probability, found.place[1:])
