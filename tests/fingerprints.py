"""What this machine computes, a line for each, to compare with another's.

    python -m tests.fingerprints > here.txt    # and there; then: diff here.txt there.txt

A generated building is drawn, measured by a laser and labelled; random problems go through the
solvers. Each line holds the first bits of a hash: equal lines are equal to the bit.
"""

import hashlib
import platform
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places import Sensor, SensorNoise, _core, label_map, trained_labeler
from pgm_places.features.extraction import extract
from pgm_places.maps.components import squared_clearance
from pgm_places.sensing.ray_casting import cast_cells
from pgm_places.simulation import generate_building
from pgm_places.solvers.belief_propagation import belief_propagation
from pgm_places.solvers.forward import filtered_beliefs, markov_chain, viterbi
from pgm_places.solvers.graph_cut import alpha_expansion
from pgm_places.solvers.grid_relaxation import relax_grid
from pgm_places.solvers.mean_field import mean_field
from pgm_places.solvers.pairwise import pairwise_model
from pgm_places.solvers.trws import trws


def fingerprint(*arrays: NDArray[Any]) -> str:
    """The hash of arrays' bytes, their types and shapes."""
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(f"{array.dtype.str}{array.shape}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:16]


def building() -> Iterator[tuple[str, str]]:
    """A map from its generation to its labels."""
    made = generate_building(size="small", seed=3)
    grid = made.grid
    yield "building: cells", fingerprint(grid.cells)
    sensor = Sensor(180, 10.0, noise=SensorNoise(0.02, 0.01, 0.01, seed=5))
    ranges = cast_cells(grid, sensor)
    yield "building: ranges", fingerprint(ranges)
    yield "building: features", fingerprint(extract(ranges[::7], max_range_m=10.0))
    yield "building: clearance", fingerprint(squared_clearance(grid.cells > 0))
    labelled = label_map(trained_labeler(), grid)
    yield "building: labels", fingerprint(labelled.labels)
    beliefs = labelled.labeling.beliefs
    assert beliefs is not None
    yield "building: beliefs", fingerprint(beliefs)


def solvers() -> Iterator[tuple[str, str]]:
    """Random problems."""
    rng = np.random.default_rng(7)
    mask = rng.random((60, 80)) < 0.7
    cells = np.argwhere(mask).astype(np.int32)
    unary = rng.normal(size=(len(cells), 3))
    tables = rng.uniform(-1, 1, (8, 4, 4))
    relaxed = relax_grid(unary, cells, mask.shape, tables, walls=~mask, max_iterations=20)
    yield "relaxation", fingerprint(relaxed.beliefs)

    edges = rng.integers(0, 200, (500, 2))
    edges = np.unique(np.sort(edges[edges[:, 0] != edges[:, 1]]), axis=0)
    unary, agreement = rng.normal(size=(200, 3)), rng.uniform(0, 1, (len(edges), 3))
    bounded = trws(pairwise_model(unary, edges, agreement))
    yield "trws", fingerprint(bounded.labels, bounded.history)
    moved = alpha_expansion(pairwise_model(unary, edges, agreement))
    yield "alpha_expansion", fingerprint(moved.labels, np.array(moved.score))
    yield (
        "belief_propagation",
        fingerprint(belief_propagation(pairwise_model(unary, edges, agreement)).beliefs),
    )
    yield "mean_field", fingerprint(mean_field(pairwise_model(unary, edges, agreement)).beliefs)

    start, seen = np.full(4, 0.25), rng.normal(size=(500, 4))
    turn = np.full((4, 4), 0.05) + 0.8 * np.eye(4)
    yield "viterbi", fingerprint(viterbi(markov_chain(start, turn, seen)).labels)
    yield "filtered_beliefs", fingerprint(filtered_beliefs(markov_chain(start, turn, seen)).beliefs)


def main() -> None:
    """Print all."""
    for name, value in (*building(), *solvers()):
        sys.stdout.write(f"{name:28} {value}\n")
    machine = f"{platform.machine()}, registers of {_core.widest_registers()} bytes"
    sys.stderr.write(f"{machine}, Python {platform.python_version()}, NumPy {np.__version__}\n")


if __name__ == "__main__":
    main()
