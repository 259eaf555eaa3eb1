"""Rasters as runs."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pgm_places.graph.bands import band_limit
from pgm_places.spaces.doorways import RasterRuns
from tests.strategies import varied_arrays

RASTERS = varied_arrays(
    np.int16, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=st.integers(-1, 2)
)


@given(raster=RASTERS, cells_in_band=st.sampled_from([1, 10, 1000]))
def test_the_raster_comes_back(raster: np.ndarray, cells_in_band: int) -> None:
    with band_limit(cells_in_band):
        found = RasterRuns.of(raster).raster()
    assert found.dtype == raster.dtype and np.array_equal(found, raster)


def test_large_pieces_take_next_to_nothing() -> None:
    raster = np.zeros((400, 1000), np.int16)
    raster[:, 500:] = 1
    held = sum(part.nbytes for band in RasterRuns.of(raster).bands for part in band)
    assert held < raster.nbytes / 50
