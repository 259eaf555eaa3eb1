"""The floor network while it learns, where TensorFlow is installed."""

from collections.abc import Iterator

import numpy as np
import pytest

pytest.importorskip("tensorflow", reason="the floor network is trained with TensorFlow")

from pgm_places.floor.architecture import N_INPUTS
from pgm_places.floor.network import FloorNetwork
from pgm_places.training.crops import N_TARGETS, SIDE
from pgm_places.training.network_learning import BATCH, Batch, Trainer, fresh, tensorflow_scores


def batches() -> Iterator[Batch]:
    """What is free is a room, what is not is a corridor."""
    rng = np.random.default_rng(0)
    while True:
        x = rng.random((BATCH, SIDE // 2, SIDE // 2, N_INPUTS)).astype(np.float32)
        y = np.zeros((BATCH, SIDE // 2, SIDE // 2, N_TARGETS), np.float32)
        y[..., 1] = x[..., 0] > 0.5
        y[..., 0] = 1 - y[..., 1]
        yield x, y


def test_tensorflow_and_numpy_say_the_same() -> None:
    weights = fresh(3)
    weights["scores.weights"] *= 10
    x = np.random.default_rng(1).random((32, 48, N_INPUTS)).astype(np.float32)
    mine = FloorNetwork(weights).scores(x)
    theirs = tensorflow_scores(weights, x)
    assert np.abs(mine).max() > 0.5
    np.testing.assert_allclose(mine, theirs, rtol=0, atol=0.05 * np.abs(mine).max())


def test_it_learns_and_goes_on_from_its_state() -> None:
    trainer = Trainer(fresh(1))
    first, _ = trainer.learn(batches(), 2, lambda step: 3e-3)
    last, accuracy = trainer.learn(batches(), 12, lambda step: 3e-3)
    assert last < first
    assert 0 <= accuracy <= 1
    state = trainer.state()
    again = Trainer(state)
    assert again.steps == 14
    for name, value in again.state().items():
        np.testing.assert_array_equal(value, state[name])
