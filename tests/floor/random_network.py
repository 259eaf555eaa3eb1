"""Networks with random weights: what they say means nothing, however they are asked."""

import numpy as np

from pgm_places.floor.architecture import parameters
from pgm_places.floor.network import FloorNetwork


def random_network(seed: int) -> FloorNetwork:
    """A network whose scores are of the order of one."""
    rng = np.random.default_rng(seed)
    weights = {}
    for name, shape in parameters():
        if name.endswith(".weights"):
            values = rng.normal(size=shape) * np.sqrt(2 / np.prod(shape[:-1]))
        else:
            values = rng.normal(size=shape) * 0.1 + float(name.endswith(".gain"))
        weights[name] = values.astype(np.float32)
    return FloorNetwork(weights)
