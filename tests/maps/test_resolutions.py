"""Maps of every resolution that is promised, taken to the cells of a model and back again."""

from fractions import Fraction

import numpy as np

from pgm_places import OccupancyGrid
from pgm_places.graph.layout import GridLayout
from pgm_places.maps.coarsening import Coarsening, coarsen, coarsen_labels, refine
from pgm_places.spaces.doorways import Doorways

MODEL_M = 0.05
ODD = (0.0508, 0.0746, 0.1203)  # each was once refined by one fraction and brought back by another
SWEEP = sorted({*np.arange(5, 1001) / 1000, *np.arange(500, 3000, 7) / 10000, *ODD})


def tiny(resolution_m: float) -> OccupancyGrid:
    """A map of 11 x 14 cells with free, occupied and unknown ones; a block of free cells."""
    cells = np.random.default_rng(5).choice(np.array([0, 100, -1], np.int8), (11, 14))
    cells[:4, :9] = 0
    return OccupancyGrid(cells, resolution_m)


def at_model_cells(grid: OccupancyGrid) -> OccupancyGrid:
    finer = grid.resolution_m < MODEL_M
    return coarsen(grid, MODEL_M) if finer else refine(grid, MODEL_M)


def is_brought_back(grid: OccupancyGrid) -> bool:
    """Whether the cells of a map at the model's resolution stand for all of its free cells."""
    used = at_model_cells(grid)
    if used.resolution_m > grid.resolution_m:
        painted = Coarsening(grid, used).paint(np.where(used.free, 1, -1), -1)
        labels = coarsen_labels(np.where(grid.free, 1, -1), grid, used)
        every = bool(((painted >= 0) == (grid.free & used.free.any())).all())
        return every and bool((labels[used.free] == 1).any() or not used.free.any())
    layout = GridLayout.of_map(grid)
    nodes = layout.nodes_at(Coarsening(used, grid).holders(np.argwhere(used.free)))
    return bool((nodes >= 0).all()) and len(np.unique(nodes)) == layout.n_nodes


def test_every_free_cell_is_brought_back_at_every_resolution() -> None:
    lost = [resolution_m for resolution_m in SWEEP if not is_brought_back(tiny(resolution_m))]
    assert lost == []


def has_same_places(grid: OccupancyGrid) -> bool:
    """Whether the model's cells lie in the places that hold their centres, and the other way."""
    used = at_model_cells(grid)
    finer = used.resolution_m < grid.resolution_m
    factor = Coarsening(used, grid).factor if finer else 1 / Coarsening(grid, used).factor
    number = np.arange(grid.cells.size, dtype=np.int32).reshape(grid.shape)
    centres = [
        [min(int((i + Fraction(1, 2)) / factor), last - 1) for i in range(n)]
        for n, last in zip(used.shape, grid.shape, strict=True)
    ]
    there = Doorways(grid, (), np.empty(0), number).place_on(used)
    return bool((there == number[np.ix_(*centres)]).all())


def test_places_lie_where_the_cells_do_at_every_resolution() -> None:
    assert [resolution_m for resolution_m in SWEEP if not has_same_places(tiny(resolution_m))] == []
