import numpy as np
import pytest

from pgm_places.errors import InputError, LabelError
from pgm_places.labelers.map_prior import LEAST, MapPrior
from pgm_places.labelers.tracking import BeliefFilter
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.models.hmm import HiddenMarkovModel
from pgm_places.models.semi_markov import SemiMarkovModel
from tests.refusals import refused

GRID = OccupancyGrid(np.zeros((2, 3), np.int8), 1.0, (10.0, -5.0), np.pi / 2)
TABLE = np.array([[[3, 1], [1, 0], [0, 0]], [[1, 1], [0, 4], [1, 3]]], np.float32)


def test_positions_are_looked_up_in_the_frame_of_the_map() -> None:
    prior = MapPrior(GRID, TABLE)
    cells = np.argwhere(np.ones(GRID.shape, bool))
    low = LEAST / (1 + LEAST)
    known = np.array([[0.75, 0.25], [1 - low, low], [0.5, 0.5], [low, 1 - low], [0.25, 0.75]])
    expected = np.insert(known, 2, known.mean(axis=0), axis=0)
    np.testing.assert_allclose(prior.at(GRID.cell_centres_m(cells)), expected, rtol=1e-5)
    np.testing.assert_allclose(prior.shares, known.mean(axis=0), rtol=1e-6)
    np.testing.assert_allclose(prior.at([[0.0, 0.0], [1e9, 0.0]]), [prior.shares] * 2, rtol=1e-12)


def test_where_nothing_is_known_nothing_is_added() -> None:
    prior = MapPrior(GRID, TABLE, weight=0.3)
    outside = prior.log_likelihood(prior.at([[0.0, 0.0]]))
    np.testing.assert_allclose(outside, [[0.0, 0.0]], rtol=0, atol=1e-12)
    inside = prior.log_likelihood(np.array([0.5, 0.5]))
    np.testing.assert_allclose(inside, 0.3 * np.log(0.5 / prior.shares), rtol=1e-9)


@pytest.mark.parametrize("kind", [HiddenMarkovModel, SemiMarkovModel])
def test_the_map_moves_the_belief_by_its_likelihood(kind: type[HiddenMarkovModel]) -> None:
    model = kind().with_counts(confusions=[[8, 2], [2, 8]], moves=[[9, 1], [1, 9]])
    prior = MapPrior(GRID, TABLE, weight=1.0)
    x, y = GRID.cell_centres_m([[1, 2]])[0].tolist()
    log_z = np.log([0.6, 0.4])
    alone = BeliefFilter(model, 0.1).step(x, y, log_z)
    there = BeliefFilter(model, 0.1, prior).step(x, y, log_z)
    expected = alone * np.array([0.25, 0.75]) / prior.shares
    np.testing.assert_allclose(there, expected / expected.sum(), rtol=1e-6)
    away = BeliefFilter(model, 0.1, prior).step(0.0, 0.0, log_z)
    np.testing.assert_allclose(away, alone, rtol=1e-9)


def test_within_a_segment_another_map_takes_the_place_of_the_one_before() -> None:
    model = HiddenMarkovModel().with_counts(confusions=[[8, 2], [2, 8]], moves=[[9, 1], [1, 9]])
    prior = MapPrior(GRID, TABLE, weight=1.0)
    (x, y), log_z = GRID.cell_centres_m([[1, 2]])[0].tolist(), np.log([0.6, 0.4])
    tracker = BeliefFilter(model, 10.0, MapPrior(GRID, TABLE[:, :, ::-1], weight=1.0))
    tracker.step(x, y, log_z)
    tracker.use_map(prior)
    wanted = BeliefFilter(model, 10.0, prior).step(x, y, log_z)
    np.testing.assert_allclose(tracker.step(x, y, log_z), wanted, rtol=1e-9)
    tracker.use_map(None)
    alone = BeliefFilter(model, 10.0).step(x, y, log_z)
    np.testing.assert_allclose(tracker.step(x, y, log_z), alone, rtol=1e-9)


def test_what_is_no_labelled_map_is_refused() -> None:
    refused(InputError, r"probabilities must have shape \(2, 3, K\)", MapPrior, GRID, TABLE[:1])
    refused(InputError, "weight must be above 0, got 0", MapPrior, GRID, TABLE, weight=0)
    refused(InputError, "at least 0 and finite", MapPrior, GRID, -TABLE)
    refused(LabelError, "no cell of the labelled map has a label", MapPrior, GRID, 0 * TABLE)
    with pytest.raises(LabelError, match="has 2 labels, but the model has 3: a, b, c"):
        MapPrior(GRID, TABLE).check_labels(("a", "b", "c"))


def test_rescaling_without_a_distance_is_refused() -> None:
    labeler = TrajectoryLabeler(("a", "b"), every_m=0.0)
    labeler.set_learned(method_=HiddenMarkovModel(), label_names_=("a", "b"), scan_model_=None)
    refused(InputError, "updates every 0 m cannot be rescaled", labeler.updated_every, 0.3)
