"""Scores from spaces: gates weigh doorways, and cells are scored alike in blocks of any size."""

import numpy as np
import pytest

from pgm_places.graph.layout import GridLayout
from pgm_places.models.boosted_list import BoostedList
from pgm_places.models.strong_classifier import BoostedTrees
from pgm_places.simulation import generate_building
from pgm_places.spaces.gates import gate_candidates
from pgm_places.spaces.segmentation import Segmentation
from pgm_places.unary.cell_scorers import SpaceScorer, aligned_log_proba
from pgm_places.unary.space_model import N_SPACE_COLUMNS, MapSpaces, SpaceModel, with_gates

N_OWN = 5


def random_list(n_features: int, n_classes: int) -> BoostedList:
    rng = np.random.default_rng(n_features)
    trees = tuple(
        BoostedTrees(
            rng.integers(0, n_features, (20, 3)).astype(np.int32),
            rng.random((20, 3)).astype(np.float32),
            rng.normal(size=(20, 4)).astype(np.float32),
        )
        for _ in range(n_classes - 1)
    )
    calibration = np.tile([2.0, 0.0], (n_classes - 1, 1))
    return BoostedList(
        np.arange(n_classes), np.arange(n_classes), trees, calibration, n_features, "argmax"
    )


def small_floor() -> tuple[MapSpaces, GridLayout]:
    grid = generate_building(size="small").grid
    gates = gate_candidates(Segmentation.of(grid))
    spaces = MapSpaces.of(gates, np.random.default_rng(0).random(len(gates)))
    return spaces, GridLayout.of_map(grid)


def slow_at_gates(spaces: MapSpaces, layout: GridLayout) -> np.ndarray:
    """Every cell against every gate."""
    assert layout.positions_m is not None
    found = np.zeros(len(layout.cells_rc), np.float32)
    for gate, probability in zip(spaces.gates, spaces.probability, strict=True):
        deeper_m = max(0.6 - gate.depth_m / 2, 0.0)
        inside = gate.contains(layout.positions_m, wider_m=0.1, deeper_m=deeper_m)
        found[inside] = np.maximum(found[inside], np.float32(probability))
    return found


@pytest.mark.parametrize("everywhere", [True, False])
def test_nodes_take_the_largest_probability_of_their_gates(everywhere: bool) -> None:
    spaces, layout = small_floor()
    if not everywhere:
        layout = layout.part(np.random.default_rng(1).random(len(layout.cells_rc)) < 0.5)
    found = spaces.at_gates(layout)
    assert found.dtype == np.float32 and 0 < np.count_nonzero(found) < len(found) / 2
    assert np.array_equal(found, slow_at_gates(spaces, layout))


def test_maps_without_gates_have_no_nodes_at_them() -> None:
    spaces, layout = small_floor()
    none = GridLayout.of_mask(np.zeros(layout.shape, np.bool_))
    assert spaces.nodes_at_gates(none).of(np.arange(3)).tolist() == [0, 0, 0]


def test_gates_multiply_the_odds_of_doorways() -> None:
    rng = np.random.default_rng(0)
    z, at_gate = rng.dirichlet(np.ones(3), 40), rng.random(40).astype(np.float32)
    log_z = np.log(z)
    wanted = z * np.stack([np.ones(40), np.maximum(1.2 * at_gate, 0.02), np.ones(40)], axis=1)
    wanted /= wanted.sum(axis=1, keepdims=True)
    assert np.exp(with_gates(log_z, at_gate, 1)) == pytest.approx(wanted, rel=1e-6)
    assert np.array_equal(log_z, np.log(z))


@pytest.mark.parametrize("doorway", [None, 2])
def test_cells_are_scored_alike_in_blocks_of_any_size(doorway: int | None) -> None:
    spaces, layout = small_floor()
    gates = None if doorway is None else random_list(75, 2)
    model = SpaceModel(random_list(N_OWN + N_SPACE_COLUMNS, 3), gates, doorway)
    own = np.random.default_rng(5).random((len(layout.cells_rc), N_OWN)).astype(np.float32)
    every = np.concatenate([own, spaces.features.lookup(layout.cells_rc)], axis=1)
    wanted = aligned_log_proba(model.classifier, every, 3)
    if doorway is not None:
        wanted = with_gates(wanted, slow_at_gates(spaces, layout), doorway)
    for given in (np.arange(N_OWN), None):
        item = SpaceScorer(model, spaces, layout, N_OWN, 3)
        columns = item.columns if given is None else given
        item.set_columns(columns)
        for nodes in np.array_split(np.arange(len(own)), 3):
            item.score_block(nodes, own[nodes][:, columns])
        assert np.array_equal(item.scores, wanted)


def test_scores_in_single_precision_are_those_in_double_rounded() -> None:
    spaces, layout = small_floor()
    model = SpaceModel(random_list(N_OWN + N_SPACE_COLUMNS, 3), random_list(75, 2), 2)
    own = np.random.default_rng(5).random((layout.n_nodes, N_OWN)).astype(np.float32)
    found = []
    for dtype in (np.float64, np.float32):
        item = SpaceScorer(model, spaces, layout, N_OWN, 3, dtype)
        item.set_columns(np.arange(N_OWN))
        item.score_block(np.arange(layout.n_nodes), own)
        found.append(item.scores)
    assert found[1].dtype == np.float32
    assert np.array_equal(found[1], found[0].astype(np.float32))
