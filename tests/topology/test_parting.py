"""Doorways drawn where they split a region: the same as when all parts are found anew each time."""

import numpy as np
import pytest

from pgm_places.topology.parting import DOORWAY_DEPTH_M, Parting
from tests.reference.parting import SlowParting

DOORWAY = 2


def cluttered(seed: int, side: int = 24) -> np.ndarray:
    """Two kinds of rooms behind walls with openings, some furniture, some painted doorways."""
    generator = np.random.default_rng(seed)
    labels = np.zeros((side, side + 5), np.int16)
    labels[generator.integers(4, side - 4) :] = 1
    for _ in range(4):
        wall = generator.integers(3, side - 3)
        labels[wall, generator.random(side + 5) < 0.8] = -1
        labels[generator.random(side) < 0.8, wall] = -1
    labels[generator.random(labels.shape) < 0.03] = -1
    for _ in range(3):
        r, c = generator.integers(0, side - 4, 2)
        patch = labels[r : r + 4, c : c + 3]
        patch[patch >= 0] = DOORWAY
    return labels


@pytest.mark.parametrize("least_cells", [1, 12])
@pytest.mark.parametrize("resolution_m", [0.5, 0.1])
@pytest.mark.parametrize("seed", range(12))
def test_splits_are_those_of_the_slow_way(seed: int, resolution_m: float, least_cells: int) -> None:
    labels = cluttered(seed)
    generator = np.random.default_rng(seed)
    free = np.flatnonzero(labels.ravel() >= 0)
    groups = [generator.choice(free, generator.integers(1, 6)) for _ in range(40)]
    start = np.append(0, np.cumsum([len(group) for group in groups]))
    fast = Parting(labels, DOORWAY, resolution_m, least_cells * resolution_m**2)
    found = fast.draw(np.concatenate(groups[:25]), start[:26], 7.3)
    found += fast.draw(np.concatenate(groups[25:]), start[25:] - start[25], 7.3)

    reach = max(0.75, DOORWAY_DEPTH_M / resolution_m / 2)
    slow = SlowParting(labels, DOORWAY, reach, least_cells)
    drawn = [slow.draw(np.stack(np.divmod(g, labels.shape[1]), axis=1), 7.3) for g in groups]
    expected = [split for split in drawn if split is not None]
    assert len(found) == len(expected) > 0
    for split, (chord, cells, piece, sizes) in zip(found, expected, strict=True):
        assert split.chord == chord
        assert split.cells.tolist() == cells.tolist()
        assert split.areas_m2 == pytest.approx(np.array(sizes) * resolution_m**2, rel=1e-12)
        assert split.label == labels[slow.piece == piece][0]
    assert (fast.labels == slow.labels).all()


def test_nothing_is_drawn_without_candidates() -> None:
    labels = cluttered(1)
    parting = Parting(labels, DOORWAY, 0.1, 0.0)
    assert parting.draw(np.empty(0, np.int64), np.zeros(1, np.int64), 5.0) == []
    assert (parting.labels == labels).all()
