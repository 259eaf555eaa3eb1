"""Windows by columns, rows and metres."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places import OccupancyGrid
from pgm_places.errors import MapError
from pgm_places.graph.bands import band_limit
from pgm_places.maps.windows import window_mask


def grid(height: int = 4, width: int = 5, **frame: Any) -> OccupancyGrid:
    return OccupancyGrid(np.zeros((height, width), np.int8), **{"resolution_m": 0.5, **frame})


def test_columns_and_rows_are_those_of_the_image() -> None:
    image = np.zeros((4, 5), np.bool_)
    image[:3, 2:] = True
    mask = window_mask(grid(), columns=(2, None), rows=(None, 3))
    assert (mask[::-1] == image).all() and window_mask(grid()).all()
    low = window_mask(grid(), x_m=(None, 1.25))
    assert low[0].tolist() == [True, True, False, False, False]  # the centre at 1.25 is not below


@given(
    yaw=st.floats(-np.pi, np.pi),
    limits=st.tuples(*[st.floats(-3, 3)] * 2),
    vertical=st.booleans(),
    strip=st.sampled_from([1, 7, 1 << 20]),
)
def test_metres_are_those_of_the_map_frame(
    yaw: float, limits: tuple[float, float], vertical: bool, strip: int
) -> None:
    turned = grid(origin_xy_m=(-1.0, -1.5), yaw_rad=yaw)
    centres = turned.cell_centres_m(np.argwhere(turned.free))[:, int(vertical)].reshape(4, 5)
    low, high = min(limits), max(limits)
    expected = (centres >= low) & (centres < high)
    near = np.minimum(abs(centres - low), abs(centres - high)) < 1e-9
    with band_limit(strip):
        try:
            pair = (low, high)
            mask = window_mask(turned, y_m=pair) if vertical else window_mask(turned, x_m=pair)
        except MapError:
            mask = np.zeros((4, 5), np.bool_)
    assert ((mask == expected) | near).all()


EXTENT = "has 5 columns and 4 rows and reaches from 1 to 3.5 m in x and from 0 to 2 m in y"


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        ({"columns": (3, 9)}, "the window columns [3, 9] must be whole numbers with 0 <= start <"),
        ({"columns": (-1, 3)}, "the window columns [-1, 3] must be whole numbers with 0 <= start"),
        ({"columns": (3, 3)}, "the window columns [3, 3] must be whole numbers"),
        ({"columns": (0.5, 3)}, "the window columns [0.5, 3] must be whole numbers"),
        ({"rows": (4, None)}, "0 <= start < stop <= 4, the height of the map's image"),
        ({"rows": (1, 2, 3)}, "the window rows must be a pair [start, stop], got (1, 2, 3)"),
        ({"rows": "12"}, "the window rows must be a pair [start, stop], got '12'"),
        ({"x_m": (2.0, 1.0)}, "the window x_m [2, 1] is empty: low must be below high"),
        ({"x_m": (float("nan"), 1.0)}, "is empty: low must be below high"),
        ({"x_m": (7.0, None)}, f"the window x_m [7, end] holds no cell of the map, which {EXTENT}"),
        ({"y_m": (0.0, 0.2)}, "the window y_m [0, 0.2] holds no cell of the map"),
        ({"columns": (0, 1), "x_m": (2.0, 3.0)}, "the window columns [0, 1], x_m [2, 3] holds no"),
    ],
)
def test_bad_windows_are_refused(limits: dict[str, Any], message: str) -> None:
    with pytest.raises(MapError) as caught:
        window_mask(grid(origin_xy_m=(1.0, 0.0)), **limits)
    assert message in str(caught.value)
