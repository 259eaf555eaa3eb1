"""Units of features: at twice the size, lengths are twice as large, and areas four times."""

import numpy as np
import pytest

from pgm_places.features.extraction import extract
from pgm_places.features.laser import LASER_FEATURES
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.spaces.segment_features import segment_features
from pgm_places.spaces.segmentation import Segmentation
from pgm_places.spaces.space_spec import (
    CELL_FEATURES,
    PLACE_EXTRA_FEATURES,
    SEGMENT_FEATURES,
    SpaceSpec,
)
from pgm_places.teaching.reasons import unit_of
from tests.spaces.floors import corridor_with_rooms, grid_of

POWERS = {"m": 1, "m²": 2, "1/m": -1, "rad": 0, "": 0}


def test_laser_features_grow_as_their_units_say() -> None:
    """Thresholds and prominences in metres do not grow, so f3, f14 and the like are left out."""
    ranges = np.random.default_rng(0).uniform(0.5, 8.0, (5, 360)).astype(np.float32)
    small, large = extract(ranges, max_range_m=20.0), extract(2 * ranges, max_range_m=40.0)
    n = 0
    for column, spec in enumerate(LASER_FEATURES):
        if spec.id in ("f3", "f14", "f33", "f21", "f25", "f26"):
            continue
        grown = 2.0 ** POWERS[unit_of(spec.name, of_space=False)]
        np.testing.assert_allclose(
            large[:, column], grown * small[:, column], rtol=1e-3, atol=1e-5, err_msg=spec.name
        )
        n += 1
    assert n > 200
    assert unit_of("f3[5]", of_space=False) == unit_of("f25[0.1]", of_space=False) == "m"
    assert unit_of("f14[0.5]", of_space=False) == unit_of("f21[1]", of_space=False) == ""


def test_features_of_segments_grow_as_their_units_say() -> None:
    cells = grid_of(corridor_with_rooms()).cells
    small, large = (
        segment_features(Segmentation.of(OccupancyGrid(cells, side_m)).scales[0])
        for side_m in (0.05, 0.1)
    )
    assert small.shape == large.shape
    for column, spec in enumerate(SEGMENT_FEATURES):
        if "narrow" in spec.id or spec.id == "furniture":
            continue  # thresholds in metres
        grown = 2.0 ** POWERS[unit_of(f"{spec.id}[0.9]", of_space=True)]
        np.testing.assert_allclose(
            large[:, column], grown * small[:, column], rtol=1e-3, atol=1e-6, err_msg=spec.id
        )


@pytest.mark.parametrize("spec", [*CELL_FEATURES, *PLACE_EXTRA_FEATURES, *SEGMENT_FEATURES])
def test_quotients_have_the_unit_of_their_definition(spec: SpaceSpec) -> None:
    name, text = spec.id, spec.definition
    unit = unit_of(name, of_space=True)
    if text.endswith(("root of area", " / long")) and name not in ("aspect", "filling"):
        assert unit == "1/m"
    if text.startswith(("number of", "share of")):
        assert unit == ""
    if text.startswith(("distance to", "half width")) and "/" not in text:
        assert unit == "m"
