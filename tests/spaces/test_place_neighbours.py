"""Places beside each other, against walking every row and column of a small map."""

from collections import Counter

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.spaces.gates import gate_candidates
from pgm_places.spaces.places import neighbour_graph, places_between, shared_walls
from pgm_places.spaces.segmentation import Segmentation


def walked(place: NDArray[np.int32], most_cells: int) -> Counter[tuple[int, int]]:
    """Cells of wall between each two places, line by line."""
    found: Counter[tuple[int, int]] = Counter()
    for line in [*place.tolist(), *place.T.tolist()]:
        last, since = -1, 0
        for value in line:
            if value < 0:
                since += 1
                continue
            if last not in (-1, value) and since <= most_cells:
                found[min(last, value), max(last, value)] += 1
            last, since = value, 0
    return found


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, 3))
def test_shared_walls_are_those_that_lines_cross(seed: int, most_cells: int) -> None:
    rng = np.random.default_rng(seed)
    place = rng.integers(-1, 4, rng.integers(1, 12, 2)).astype(np.int32)
    pairs, shared_m = shared_walls(place, 0.5, widest_wall_m=0.5 * most_cells)
    expected = walked(place, most_cells)
    assert {tuple(pair): m / 0.5 for pair, m in zip(pairs.tolist(), shared_m, strict=True)} == dict(
        expected
    )


def test_rooms_along_a_corridor_are_joined_with_it_and_with_each_other() -> None:
    cells = np.zeros((60, 122), np.int8)
    cells[20:24] = 100  # the corridor's wall; three rooms above it
    cells[24:, 40:42] = cells[24:, 80:82] = 100
    for column in (18, 58, 98):
        cells[20:24, column : column + 9] = 0
    gates = gate_candidates(Segmentation.of(OccupancyGrid(cells, resolution_m=0.1)))
    places = places_between(gates, np.ones(len(gates), np.bool_))
    order = places.segments.at(np.array([[10, 60], [40, 20], [40, 60], [40, 100]])).tolist()
    number = {place: k for k, place in enumerate(order)}
    joined = {
        tuple(sorted((number[i], number[j]))) for i, j in neighbour_graph(places).edges.tolist()
    }
    assert joined == {(0, 1), (0, 2), (0, 3), (1, 2), (2, 3)}
