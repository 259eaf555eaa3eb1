"""The occupancy grid: frames, masks, refusals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places import OccupancyGrid
from pgm_places.errors import MapError

poses = st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-np.pi, np.pi))


@given(pose=poses, row=st.integers(0, 3), column=st.integers(0, 4))
def test_positions_and_cells_are_inverse(
    pose: tuple[float, float, float], row: int, column: int
) -> None:
    grid = OccupancyGrid(
        np.zeros((4, 5), np.int8), resolution_m=0.25, origin_xy_m=pose[:2], yaw_rad=pose[2]
    )
    centre = grid.cell_centres_m([[row, column]])
    assert grid.cells_at_m(centre).tolist() == [[row, column]]


def test_yaw_turns_about_the_origin() -> None:
    grid = OccupancyGrid(
        np.zeros((1, 2), np.int8), resolution_m=1.0, origin_xy_m=(10.0, 0.0), yaw_rad=np.pi / 2
    )
    np.testing.assert_allclose(grid.cell_centres_m([[0, 1]]), [[9.5, 1.5]], rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"cells": [0, 1], "resolution_m": 1}, "2-D array"),
        ({"cells": [[0, 7]], "resolution_m": 1}, "got 7 at row 0, column 1"),
        (
            {"cells": [[0]], "resolution_m": 0},
            "from 1e-06 to 1000, got 0",
        ),
        (
            {"cells": [[0]], "resolution_m": np.nan},
            "resolution_m must be a finite number, got nan",
        ),
        ({"cells": [[0]], "resolution_m": 1e308}, "from 1e-06 to 1000, got 1e+308"),
        ({"cells": [[0]], "resolution_m": 1, "yaw_rad": np.inf}, "three finite numbers"),
    ],
)
def test_bad_grids_are_refused(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(MapError) as caught:
        OccupancyGrid(**arguments)  # type: ignore[arg-type]
    assert message in str(caught.value)
