"""The floor network in NumPy, against convolutions cell by cell."""

import numpy as np
import pytest

from pgm_places.errors import ModelFileError
from pgm_places.floor.architecture import DEEPEST, N_INPUTS, Operations, forward, parameters
from pgm_places.floor.network import FloorNetwork
from tests.floor.random_network import random_network
from tests.reference.convolution import convolved


class Slow:
    """The operations of the network, one cell at a time and in double precision."""

    def __init__(self, network: FloorNetwork) -> None:
        self.weights = network.weights

    def convolution(self, x, name, *, stride=1, dilation=1):  # type: ignore[no-untyped-def]
        kernel, bias = self.weights[f"{name}.weights"], self.weights[f"{name}.bias"]
        return convolved(x, kernel, bias, stride=stride, dilation=dilation)

    def rectified(self, x):  # type: ignore[no-untyped-def]
        return np.where(x > 0, x, 0.0)

    def normalised(self, x, name):  # type: ignore[no-untyped-def]
        return x / np.sqrt((x**2).mean(axis=-1, keepdims=True) + 1e-3) * self.weights[name]

    def enlarged(self, x):  # type: ignore[no-untyped-def]
        return np.kron(x, np.ones((2, 2, 1)))


@pytest.mark.parametrize("shape", [(DEEPEST, DEEPEST), (DEEPEST, 3 * DEEPEST)])
def test_scores_are_those_of_the_definition(shape: tuple[int, int]) -> None:
    network = random_network(1)
    slow: Operations = Slow(network)
    x = np.random.default_rng(2).random((*shape, N_INPUTS)).astype(np.float32)
    wanted = forward(x, slow)
    np.testing.assert_allclose(network.scores(x), wanted, rtol=0, atol=1e-4 * np.abs(wanted).max())


@pytest.mark.parametrize(("stride", "dilation"), [(1, 1), (2, 1), (1, 2)])
def test_a_band_of_rows_is_as_good_as_all(stride: int, dilation: int) -> None:
    network = random_network(3)
    x = np.random.default_rng(4).normal(size=(12, 8, 16)).astype(np.float32)
    whole = network.convolution(x, "decode0", stride=stride, dilation=dilation)
    by_row = network.convolution(x, "decode0", stride=stride, dilation=dilation, _values_at_once=1)
    np.testing.assert_allclose(by_row, whole, rtol=0, atol=1e-5)
    kernel, bias = network.weights["decode0.weights"], network.weights["decode0.bias"]
    wanted = convolved(x, kernel, bias, stride=stride, dilation=dilation)
    np.testing.assert_allclose(whole, wanted, rtol=0, atol=1e-4)


def test_inputs_are_left_alone() -> None:
    x = np.random.default_rng(5).random((DEEPEST, DEEPEST, N_INPUTS)).astype(np.float32)
    before = x.copy()
    random_network(6).scores(x)
    np.testing.assert_array_equal(x, before)


def test_packed_weights_are_the_nearest_of_127_steps() -> None:
    network = random_network(7)
    again = FloorNetwork.unpacked(network.packed())
    for name, shape in parameters():
        mine, theirs = network.weights[name], again.weights[name]
        assert theirs.shape == shape
        if name.endswith(".weights"):
            unit = np.abs(mine).max(axis=(0, 1, 2)) / 63
            assert (np.abs(mine - theirs) <= unit / 2 * 1.001).all()
        else:
            np.testing.assert_array_equal(mine, theirs)
    np.testing.assert_array_equal(again.packed(), network.packed())


def test_a_network_is_small() -> None:
    assert random_network(8).packed().nbytes < 750_000


@pytest.mark.parametrize("spoil", [lambda b: b[:-50], lambda b: b[:100], lambda b: b * 0])
def test_spoiled_weights_are_refused(spoil) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ModelFileError, match="floor network"):
        FloorNetwork.unpacked(spoil(random_network(9).packed()))


def test_a_missing_parameter_is_named() -> None:
    weights = dict(random_network(10).weights)
    del weights["up2.bias"]
    with pytest.raises(ModelFileError, match=r"up2.bias must have shape \(48,\), got nothing"):
        FloorNetwork(weights)
