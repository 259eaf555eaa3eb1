"""Functions on spaces take maps, cells and areas of any layout in memory."""

from collections.abc import Callable

import numpy as np
import pytest

from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.spaces.cell_features import CellFeatures
from pgm_places.spaces.gates import gate_candidates, gate_features
from pgm_places.spaces.segment_features import (
    area_cut_off,
    betweenness,
    neighbour_lists,
    segment_features,
)
from pgm_places.spaces.segmentation import Segmentation
from pgm_places.spaces.unentered import find_unentered
from tests.layouts import CHANGES, Array, check_any_layout
from tests.spaces.floors import corridor_with_rooms

CELLS = np.where(corridor_with_rooms(), 0, 100).astype(np.int8)
CELLS[:, -4:] = -1
FREE_CELLS = np.argwhere(CELLS == 0)[::7]
FOUND = Segmentation.of(OccupancyGrid(CELLS, 0.1))
AREAS = FOUND.scales[0].area_m2
LISTS = neighbour_lists(FOUND.scales[0].neighbours, len(AREAS))


def segmented(cells: Array) -> Segmentation:
    return Segmentation.of(OccupancyGrid(cells, 0.1))


FUNCTIONS: dict[str, tuple[Callable[[Array], Array], Array]] = {
    "segments": (lambda cells: segmented(cells).scales[0].raster(), CELLS),
    "features of segments": (lambda cells: segment_features(*segmented(cells).scales), CELLS),
    "gates": (lambda cells: gate_candidates(segmented(cells)).profile_m, CELLS),
    "features of gates": (lambda cells: gate_features(gate_candidates(segmented(cells))), CELLS),
    "unentered": (lambda cells: find_unentered(OccupancyGrid(cells, 0.1)).cells, CELLS),
    "features of cells": (lambda cells_rc: CellFeatures.of(FOUND).lookup(cells_rc), FREE_CELLS),
    "some features of cells": (
        lambda columns: CellFeatures.of(FOUND).lookup(FREE_CELLS, columns),
        np.array([0, 40, 41, 5]),
    ),
    "betweenness": (lambda areas: betweenness(*LISTS, areas), AREAS),
    "area cut off": (lambda areas: area_cut_off(*LISTS, areas), AREAS),
}


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("name", FUNCTIONS)
def test_any_layout_gives_the_same(name: str, change: Callable[[Array], Array]) -> None:
    function, argument = FUNCTIONS[name]
    check_any_layout(function, (argument,), change)
