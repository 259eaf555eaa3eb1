import numpy as np
import pytest

from pgm_places import LabelGraph, OccupancyGrid
from pgm_places.errors import InputError, MapError
from pgm_places.graph.bands import band_limit
from pgm_places.graph.layout import GridLayout
from pgm_places.maps.coarsening import Coarsening, coarsen
from pgm_places.maps.components import connected_components
from pgm_places.topology.from_labels import mean_probabilities


def free_grid(height: int, width: int, resolution_m: float = 0.05) -> OccupancyGrid:
    return OccupancyGrid(np.zeros((height, width), np.int8), resolution_m)


def layout_of(grid: OccupancyGrid) -> GridLayout:
    layout = LabelGraph.from_grid(grid).layout
    assert isinstance(layout, GridLayout)
    return layout


def test_confidence_is_the_mean_over_known_cells() -> None:
    pieces = connected_components(np.array([[0, 0, 0, 1]], np.int16))
    layout = GridLayout.of_mask(np.array([[True, True, False, False]]))
    found = mean_probabilities(pieces, [[0.5, 0.5], [1.0, 0.0]], layout, 2, free_grid(1, 4))
    np.testing.assert_allclose(found, [[0.75, 0.25], [np.nan, np.nan]], rtol=1e-12)


def test_beliefs_of_a_coarser_map_count_for_all_its_cells() -> None:
    pieces = connected_components(np.array([[0, 0, 1], [0, 0, 1], [0, 0, 1]], np.int16))
    beliefs = [[0.9, 0.1], [0.4, 0.6], [0.6, 0.4], [0.2, 0.8]]
    layout = layout_of(free_grid(2, 2, 0.1))
    found = mean_probabilities(pieces, beliefs, layout, 2, free_grid(3, 3))
    own = found[np.arange(2), pieces.label]
    assert own == pytest.approx([(4 * 0.9 + 2 * 0.6) / 6, (2 * 0.6 + 0.8) / 3])
    assert found.sum(axis=1) == pytest.approx([1, 1])


@pytest.mark.parametrize("factor", [1.25, 1.5, 2, 2.5, 10 / 3])
def test_confidences_are_those_of_the_painted_probabilities(factor: float) -> None:
    rng = np.random.default_rng(3)
    grid = OccupancyGrid(rng.choice(np.array([0, 0, 0, 100], np.int8), (40, 30)), 0.05)
    layout = layout_of(coarsen(grid, factor * grid.resolution_m))
    beliefs = rng.dirichlet(np.ones(3), len(layout.cells_rc)).astype(np.float32)
    labels = np.where(grid.free, rng.integers(0, 3, grid.shape), -1).astype(np.int16)
    pieces = connected_components(labels)
    painted = Coarsening.behind(layout, grid).paint(layout.to_raster(beliefs, fill=0), 0)
    expected = [painted[pieces.piece == number].mean(axis=0) for number in range(pieces.count)]
    found = mean_probabilities(pieces, beliefs, layout, 3, grid)
    np.testing.assert_allclose(found, expected, rtol=1e-5)


def test_a_map_of_many_bands_gives_the_same() -> None:
    rng = np.random.default_rng(4)
    grid = OccupancyGrid(rng.choice(np.array([0, 0, 0, 100], np.int8), (40, 30)), 0.05)
    pieces = connected_components(rng.integers(-1, 3, grid.shape).astype(np.int16))
    layout = layout_of(coarsen(grid, 0.1))
    beliefs = rng.dirichlet(np.ones(3), len(layout.cells_rc))
    whole = mean_probabilities(pieces, beliefs, layout, 3, grid)
    with band_limit(100):
        banded = mean_probabilities(pieces, beliefs, layout, 3, grid)
    assert not np.isnan(whole).all()
    np.testing.assert_allclose(banded, whole, rtol=1e-12)


def test_what_does_not_fit_is_refused() -> None:
    pieces = connected_components(np.zeros((4, 4), np.int16))
    with pytest.raises(InputError, match="pass layout as well"):
        mean_probabilities(pieces, [[1.0]], None, 1, free_grid(4, 4))
    layout = GridLayout.of_mask(np.ones((3, 3), np.bool_))
    with pytest.raises(MapError, match=r"the layout has \(3, 3\) cells but the map \(4, 4\)"):
        mean_probabilities(pieces, [[1.0]] * 9, layout, 1, free_grid(4, 4))
    other = layout_of(free_grid(3, 3, 0.1))
    with pytest.raises(MapError, match=r"\(3, 3\) cells is not one of \(4, 4\) .* by 2"):
        mean_probabilities(pieces, [[1.0]] * 9, other, 1, free_grid(4, 4))
