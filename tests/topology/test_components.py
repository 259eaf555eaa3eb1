"""Connected components and their borders, against flood fill and loops."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pgm_places.errors import InputError
from pgm_places.topology.borders import contacts
from pgm_places.topology.components import connected_components
from tests.reference.topology import flood_fill
from tests.strategies import varied_arrays

rasters = varied_arrays(
    np.int16, st.tuples(st.integers(1, 7), st.integers(1, 7)), elements=st.integers(-1, 2)
)


@pytest.mark.parametrize("connectivity", [4, 8])
@settings(deadline=None)  # the first call compiles
@given(raster=rasters)
def test_components_are_those_of_flood_fill(connectivity: int, raster: np.ndarray) -> None:
    found = connected_components(raster, connectivity=connectivity)
    wanted = flood_fill(raster, connectivity)
    assert (found.piece == wanted).all()
    for number in range(found.count):
        assert (raster[found.piece == number] == found.label[number]).all()
        assert (found.piece == number).sum() == found.size[number]


@settings(deadline=None)  # the first call compiles
@given(raster=rasters)
def test_borders_are_counted_side_by_side(raster: np.ndarray) -> None:
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
    found = contacts(pieces.piece, pieces.count)
    pairs = [(int(i), int(j)) for i, j in found.pairs]
    assert pairs == sorted({*sides, *corners})
    assert found.sides.tolist() == [sides.get(pair, 0) for pair in pairs]
    assert found.corners.tolist() == [corners.get(pair, 0) for pair in pairs]


def test_wrong_rasters_are_refused() -> None:
    with pytest.raises(InputError, match="2-D integer raster"):
        connected_components(np.zeros((2, 2)))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="connectivity must be 4 or 8, got 6"):
        connected_components(np.zeros((2, 2), np.int16), connectivity=6)
