"""Maps of one floor: registered to each other, their labels compared."""

import numpy as np
import pytest

from experiments.repeat import OnReference, Transform, pairs, registered
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.simulation import generate_building


def test_a_turned_and_shifted_copy_is_laid_on_its_map() -> None:
    made = generate_building(3, size="small", resolution_m=0.1)
    reference, labels = made.grid, made.labels.astype(np.int64)
    other = OccupancyGrid(np.rot90(reference.cells).copy(), 0.1, (7.0, -2.0))
    transform = registered(reference, other)
    assert round(transform.degrees) % 90 == 0
    turned = np.rot90(labels).copy()
    maps = [
        OnReference.of("one", reference, labels, reference, Transform()),
        OnReference.of("other", other, turned, reference, transform),
    ]
    [(one, name, walls, free, alike)] = pairs(maps, 0.1)
    assert (one, name) == ("one", "other")
    assert min(walls, free, alike) > 0.95
    turned[turned == 1] = 0
    maps[1] = OnReference.of("other", other, turned, reference, transform)
    [(*_, less)] = pairs(maps, 0.1)
    assert less == pytest.approx(alike - np.mean(labels[labels >= 0] == 1), abs=0.06)
