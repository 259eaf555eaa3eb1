"""Counts of label transitions from short simulated runs in labelled maps."""

from collections.abc import Sequence
from math import isfinite, pi

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import require_at_least
from pgm_places.errors import InputError
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import at_cells

MOVE_M = (0.2, 0.5)
"""Distance between two updates of a moving robot (paper, section 5)."""

STAY_M = (0.0, 0.05)
"""Apparent motion of a standing robot, by jitter of its localisation."""

N_RUNS = 100_000
"""Default number of runs. The paper has 1,000, of which 31 begin in a doorway."""

# Rounds of draws without enough successful runs before an error.
MOST_ROUNDS = 200


def simulate_moves(
    maps: Sequence[LabelledMap],
    n_labels: int,
    *,
    n_runs: int = N_RUNS,
    step_m: tuple[float, float] = MOVE_M,
    seed: int = 0,
) -> NDArray[np.int64]:
    """(K, K) counts of simulated runs from the row's label to the column's.

    A run starts in a random labelled free cell of all maps, with a random heading, and goes a
    random distance straight ahead (paper, section 5). Runs that leave the free space, or end at an
    unknown label, are drawn again.

    Parameters
    ----------
    maps : sequence of LabelledMap
        Maps of the runs; starts lie inside their windows.
    n_labels : int
        K.
    n_runs : int
        Number of counted runs.
    step_m : (float, float)
        Shortest and longest distance in metres, drawn uniformly. :data:`MOVE_M` is the action
        MOVE, :data:`STAY_M` the action STAY.
    seed : int
        Seed of the draws.

    Raises
    ------
    InputError
        No free cell is labelled, a label is not below K, the distances are not a range, or hardly
        any run succeeds.

    Examples
    --------
    >>> from pgm_places.maps.occupancy_grid import OccupancyGrid
    >>> grid = OccupancyGrid(np.zeros((40, 40), np.int8), resolution_m=0.05)
    >>> labels = np.repeat(np.array([[0] * 20 + [1] * 20], np.int16), 40, axis=0)
    >>> counts = simulate_moves([LabelledMap(grid, labels)], 2, n_runs=1000)
    >>> int(counts.sum()), bool(counts[0, 0] > 5 * counts[0, 1])
    (1000, True)
    """
    low, high = float(step_m[0]), float(step_m[1])
    if not (isfinite(high) and 0 <= low <= high):
        raise InputError(f"step_m must be a range of metres from 0 up, got {step_m}")
    require_at_least("n_runs", n_runs, 1)
    sizes = np.array([int(known.labelled_cells.sum()) for known in maps], np.int64)
    if not sizes.sum():
        raise InputError("simulated runs need a labelled free cell to start from; there is none")
    rng = np.random.default_rng(seed)
    shares = rng.multinomial(n_runs, sizes / sizes.sum())
    counts = np.zeros((n_labels, n_labels), np.int64)
    for known, share in zip(maps, shares, strict=True):
        starts, ends = _runs(known, int(share), (low, high), rng)
        if starts.size and max(starts.max(), ends.max()) >= n_labels:
            raise InputError(
                f"{known.name}: label index {max(starts.max(), ends.max())} but there are only "
                f"{n_labels} labels"
            )
        np.add.at(counts, (starts, ends), 1)
    return counts


def _runs(
    item: LabelledMap, n_runs: int, step_m: tuple[float, float], rng: np.random.Generator
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Labels at the start and the end of successful runs."""
    cells = np.argwhere(item.labelled_cells)
    starts: list[NDArray[np.int64]] = []
    ends: list[NDArray[np.int64]] = []
    wanted = n_runs
    for _ in range(MOST_ROUNDS):
        if not wanted:
            break
        chosen = cells[rng.integers(len(cells), size=wanted)]
        position = chosen + rng.random((wanted, 2))
        heading = rng.uniform(0.0, 2 * pi, wanted)
        length = rng.uniform(*step_m, wanted) / item.grid.resolution_m
        motion = np.stack([np.sin(heading), np.cos(heading)], axis=1) * length[:, None]
        after = np.floor(position + motion).astype(np.int64)
        passable = _all_free(item.grid.free, position, motion)
        label = np.full(wanted, -1, np.int64)
        label[passable] = item.labels[after[passable, 0], after[passable, 1]]
        good = label >= 0
        starts.append(item.labels[chosen[good, 0], chosen[good, 1]].astype(np.int64))
        ends.append(label[good])
        wanted -= int(good.sum())
    if wanted:
        raise InputError(
            f"{item.name}: {wanted} of {n_runs} simulated runs of {step_m[0]:g} to {step_m[1]:g} m "
            "found no path; is the free space too small, or are its labels too sparse, for such "
            "a step?"
        )
    return np.concatenate([*starts, np.zeros(0, np.int64)]), np.concatenate(
        [*ends, np.zeros(0, np.int64)]
    )


def _all_free(
    free: NDArray[np.bool_], position: NDArray[np.float64], motion: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Whether straight runs stay on free cells, checked every half cell."""
    longest = float(np.linalg.norm(motion, axis=1).max(initial=0.0))
    going = np.arange(len(position))
    for fraction in np.linspace(0.0, 1.0, int(2 * longest) + 2):
        at = np.floor(position[going] + fraction * motion[going]).astype(np.int64)
        going = going[at_cells(free, at, False)]
    passable = np.zeros(len(position), np.bool_)
    passable[going] = True
    return passable
