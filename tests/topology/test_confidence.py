import numpy as np
import pytest

from pgm_places.errors import InputError, LabelError
from pgm_places.graph.layout import GridLayout
from pgm_places.topology import components
from pgm_places.topology.components import connected_components
from pgm_places.topology.confidence import mean_confidences


def test_confidence_is_the_mean_over_known_cells() -> None:
    pieces = connected_components(np.array([[0, 0, 0, 1]], np.int16))
    layout = GridLayout.of_mask(np.array([[True, True, False, False]]))
    found = mean_confidences(pieces, [[0.5, 0.5], [1.0, 0.0]], layout, 2)
    assert found == [pytest.approx(0.75), None]


def test_beliefs_of_a_coarser_map_count_for_all_its_cells() -> None:
    pieces = connected_components(np.array([[0, 0, 1], [0, 0, 1], [0, 0, 1]], np.int16))
    layout = GridLayout.of_mask(np.ones((2, 2), np.bool_))
    beliefs = [[0.9, 0.1], [0.4, 0.6], [0.6, 0.4], [0.2, 0.8]]
    found = mean_confidences(pieces, beliefs, layout, 2)
    assert found == pytest.approx([(4 * 0.9 + 2 * 0.6) / 6, (2 * 0.6 + 0.8) / 3])


def test_a_map_of_many_bands_gives_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(4)
    pieces = connected_components(rng.integers(-1, 3, (40, 30)).astype(np.int16))
    layout = GridLayout.of_mask(rng.random((20, 15)) < 0.8)
    beliefs = rng.dirichlet(np.ones(3), len(layout.cells_rc))
    whole = mean_confidences(pieces, beliefs, layout, 3)
    monkeypatch.setattr(components, "BAND_CELLS", 100)
    banded = mean_confidences(pieces, beliefs, layout, 3)
    assert [value is None for value in whole] == [value is None for value in banded]
    known = [value for value in whole if value is not None]
    assert [value for value in banded if value is not None] == pytest.approx(known, rel=1e-12)


def test_what_does_not_fit_is_refused() -> None:
    pieces = connected_components(np.zeros((4, 4), np.int16))
    with pytest.raises(InputError, match="pass layout as well"):
        mean_confidences(pieces, [[1.0]], None, 1)
    with pytest.raises(LabelError, match="no whole multiple"):
        mean_confidences(pieces, [[1.0]] * 9, GridLayout.of_mask(np.ones((3, 3), np.bool_)), 1)
