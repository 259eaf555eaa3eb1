"""Connected components, against flood fill."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places.errors import InputError
from pgm_places.graph.bands import band_limit
from pgm_places.maps.components import connected_components
from tests.reference.topology import flood_fill
from tests.strategies import varied_arrays

rasters = varied_arrays(
    np.int16, st.tuples(st.integers(1, 7), st.integers(1, 7)), elements=st.integers(-1, 2)
)


@pytest.mark.parametrize("connectivity", [4, 8])
@given(raster=rasters)
def test_components_are_those_of_flood_fill(connectivity: int, raster: np.ndarray) -> None:
    found = connected_components(raster, connectivity=connectivity)
    wanted = flood_fill(raster, connectivity)
    assert (found.piece == wanted).all()
    for number in range(found.count):
        assert (raster[found.piece == number] == found.label[number]).all()
        assert (found.piece == number).sum() == found.size[number]


@pytest.mark.parametrize("connectivity", [4, 8])
@given(raster=rasters)
def test_a_mask_is_one_label(connectivity: int, raster: np.ndarray) -> None:
    mask = raster > 0
    found = connected_components(mask, connectivity=connectivity)
    assert (found.piece == flood_fill(np.where(mask, 0, -1), connectivity)).all()
    sizes = [int((found.piece == number).sum()) for number in range(found.count)]
    first = sizes.index(max(sizes)) if sizes else 0
    assert (found.largest == (found.piece == first)).all()


@pytest.mark.parametrize("band_cells", [1, 100])
def test_values_of_pieces_are_written_to_their_cells(band_cells: int) -> None:
    found = connected_components(np.array([[0, 0, 1], [-1, 1, 1], [2, -1, -1]], np.int16))
    values = np.array([7, 5, 9], np.int32)
    with band_limit(band_cells):
        painted = found.on_cells(values.astype(np.int16), -3)
        assert painted.dtype == np.int16
        assert painted.tolist() == [[7, 7, 5], [-3, 5, 5], [9, -3, -3]]
        assert found.on_cells(values, -3, out=found.piece) is found.piece
    assert found.piece.tolist() == painted.tolist()


@given(raster=rasters)
def test_windows_are_as_small_as_they_can_be(raster: np.ndarray) -> None:
    found = connected_components(raster)
    windows = found.windows()
    assert len(windows) == found.count
    for number, (rows, columns) in enumerate(windows):
        r, c = np.nonzero(found.piece == number)
        assert (rows.start, rows.stop) == (r.min(), r.max() + 1)
        assert (columns.start, columns.stop) == (c.min(), c.max() + 1)


def test_wrong_rasters_are_refused() -> None:
    with pytest.raises(InputError, match="2-D integer raster"):
        connected_components(np.zeros((2, 2)))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="connectivity must be 4 or 8, got 6"):
        connected_components(np.zeros((2, 2), np.int16), connectivity=6)
