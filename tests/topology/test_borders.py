"""Borders between connected components, against loops."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pgm_places.graph.bands import band_limit
from pgm_places.maps.components import connected_components
from pgm_places.topology.regions import contacts
from tests.strategies import varied_arrays

rasters = varied_arrays(
    np.int16, st.tuples(st.integers(1, 7), st.integers(1, 7)), elements=st.integers(-1, 2)
)


@given(raster=rasters, band_cells=st.integers(1, 60))
def test_borders_are_counted_side_by_side(raster: np.ndarray, band_cells: int) -> None:
    pieces = connected_components(raster)
    sides: dict[tuple[int, int], int] = {}
    corners: dict[tuple[int, int], int] = {}
    height, width = raster.shape
    for r in range(height):
        for c in range(width):
            for dr, dc in ((0, 1), (1, 0), (1, 1), (1, -1)):
                s, d = r + dr, c + dc
                if not (s < height and 0 <= d < width):
                    continue
                a, b = sorted((int(pieces.piece[r, c]), int(pieces.piece[s, d])))
                if a >= 0 and a != b:
                    counts = sides if dr * dc == 0 else corners
                    counts[a, b] = counts.get((a, b), 0) + 1
    with band_limit(band_cells):
        found = contacts(pieces.piece, pieces.count)
    pairs = [(int(i), int(j)) for i, j in found.pairs]
    assert pairs == sorted({*sides, *corners})
    assert found.sides.tolist() == [sides.get(pair, 0) for pair in pairs]
    assert found.corners.tolist() == [corners.get(pair, 0) for pair in pairs]
