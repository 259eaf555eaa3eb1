"""Fusing floor-network and boosted-list scores.

Shares and weights were chosen on buildings held out (docs/notes/tried.md).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import cycle

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import ROWS_AT_ONCE, finite_array
from pgm_places.errors import ConfigError
from pgm_places.floor.architecture import LABELS
from pgm_places.floor.network import FloorNetwork
from pgm_places.floor.view import FloorScores, floor_scores, views_of
from pgm_places.graph.layout import GridLayout
from pgm_places.kernels.threads import thread_limit
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.sensing.local_map import LocalMap
from pgm_places.spaces.gates import Gates
from pgm_places.trajectories.segments import DistanceTrigger
from pgm_places.unary.door_lines import door_lines
from pgm_places.unary.local_space_features import square_around

_LEAST_DEPTH_M, _AT_LEAST = 0.4, 0.8

_WIDE_M, _WIDE_LOG_ODDS = 2.0, 2.5
"""Log-odds that wider gates must exceed to be doorways; chosen on held-out buildings
(docs/notes/tried.md)."""

_HALL, _CORRIDOR = LABELS.index("hall"), LABELS.index("corridor")


@dataclass(frozen=True, eq=False)
class FloorModel:
    """Floor networks, and their weights relative to the lists.

    Parameters
    ----------
    networks : tuple of FloorNetwork
    columns : tuple of K int
        The networks' output for each label: see :func:`columns_of`; -1 for a label that they do
        not support, which keeps the score of the list.
    views_per_network : int
        Number of orientations in which each network views a map.
    share : float
        Weight of the networks' log-odds relative to those of the list with spaces.
    doorway_share : float
        This weight for doorways.
    gate_share : float
        Weight of the networks' log-odds of a doorway at a gate, relative to the list of gates.
    """

    networks: tuple[FloorNetwork, ...] = field(repr=False)
    columns: tuple[int, ...] = (0, 1, 2)
    views_per_network: int = 4
    share: float = 0.6
    doorway_share: float = 0.7
    gate_share: float = 0.4

    def scores(self, grid: OccupancyGrid) -> FloorScores:
        """The networks' scores of a map."""
        views = views_of(len(self.networks), self.views_per_network)
        return floor_scores(grid, self.networks, views)

    @property
    def shares(self) -> NDArray[np.float64]:
        """(K,) the networks' weight in the score of each label."""
        columns = np.array(self.columns)
        shares = np.where(columns == LABELS.index("doorway"), self.doorway_share, self.share)
        return np.where(columns < 0, 0.0, shares)

    @property
    def _by_column(self) -> NDArray[np.int64]:
        """(K,) the labels in the networks' order, so that sums do not depend on their indices."""
        return np.argsort(self.columns, kind="stable")

    def mean(self, log_z: NDArray[np.float64], seen: NDArray[np.float64]) -> NDArray[np.float64]:
        """(..., K) the weighted mean of a list's log-odds and the networks', normalised."""
        mixed = (1 - self.shares) * log_z + self.shares * seen
        total = np.logaddexp.reduce(mixed[..., self._by_column], axis=-1, keepdims=True)
        return np.asarray(mixed - total)

    def with_more(self, n_labels: int) -> "FloorModel":
        """A copy with ``n_labels`` further labels unknown to the networks."""
        return replace(self, columns=(*self.columns, *(-1,) * n_labels))

    def evidence(self, seen: FloorScores, cells_rc: NDArray[np.integer]) -> NDArray[np.float64]:
        """(n, K) log-probabilities of cells, each over sqrt(1 + pi d^2 / 8), normalised again."""
        log_p = seen.of(cells_rc).astype(np.float64)
        log_p[:, _CORRIDOR] = np.logaddexp(log_p[:, _CORRIDOR], log_p[:, _HALL])
        spread = seen.doubt(cells_rc)[:, np.newaxis].astype(np.float64)
        logits = log_p[:, self.columns] / np.sqrt(1 + np.pi / 8 * spread**2)
        total = np.logaddexp.reduce(logits.T[self._by_column], axis=0)
        return np.asarray(logits - total[:, np.newaxis])

    def judged(
        self, seen: FloorScores, gates: Gates, probability: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(G,) probabilities that gates are doorways, by their list and the networks.

        The networks' probability of a gate is the doorway probability that a fifth of the cells in
        its rectangle, at least 0.4 m deep, exceed. It is used alone at cuts, as the list is trained
        on narrowing passages. Gates over 2 m wide, few of which are doorways, lose 2.5 of their
        log-odds.
        """
        share = np.where(gates.at_cuts, 1.0, self.gate_share)
        odds = (1 - share) * _log_odds(probability)
        grid = gates.segmentation.watershed.grid
        for g in range(len(gates)):
            deeper_m = max(_LEAST_DEPTH_M - gates[g].depth_m, 0.0) / 2
            cells = gates[g].cells(grid, deeper_m=deeper_m)
            log_p = seen.of(cells)[:, LABELS.index("doorway")] if len(cells) else np.zeros(1)
            odds[g] += share[g] * _log_odds(np.exp(np.quantile(log_p, _AT_LEAST)))
        odds -= np.where(gates.width_m > _WIDE_M, _WIDE_LOG_ODDS, 0.0)
        return np.asarray(1 / (1 + np.exp(-odds)))


@dataclass(frozen=True, eq=False)
class FloorJudge:
    """Judgement of the gates of a map by the networks.

    Parameters
    ----------
    model : FloorModel
    scores : FloorScores
        The networks' scores of the map.
    """

    model: FloorModel
    scores: FloorScores

    def cuts(self, gates: Gates) -> NDArray[np.int64]:
        """(n, 2) cells of door lines."""
        return door_lines(gates, self.scores)

    def judged(self, gates: Gates, probability: NDArray[np.float64]) -> NDArray[np.float64]:
        """See :meth:`FloorModel.judged`."""
        return self.model.judged(self.scores, gates, probability)


def _log_odds(probability: ArrayLike) -> NDArray[np.float64]:
    p = np.clip(probability, 1e-3, 1 - 1e-3)
    return np.asarray(np.log(p) - np.log1p(-p))


def columns_of(label_names: Sequence[str]) -> tuple[int, ...]:
    """(K,) the networks' output for each of these labels; halls count as corridors.

    Raises
    ------
    ConfigError
        A name is no label of the networks, or corridor or room is missing.
    """
    if {"corridor", "room"} <= set(label_names) <= {"corridor", "room", "doorway"}:
        return tuple(LABELS.index(name) for name in label_names)
    raise ConfigError(
        "the floor networks tell corridor, room, doorway and hall apart, and these labels are "
        f"{', '.join(label_names)}: use unary = 'space', or name corridors and rooms so"
    )


def with_floor(
    log_z: NDArray[np.float64],
    seen: FloorScores,
    model: FloorModel,
    layout: GridLayout,
    hall: NDArray[np.float32] | None = None,
) -> NDArray[np.float64]:
    """(N, K) log-probabilities: the weighted mean of both log-odds.

    With shares s_k and scores z_k of the list, log p_k is (1 - s_k) z_k + s_k n_k, normalised. The
    n_k of the networks are their log-probabilities over sqrt(1 + pi d^2 / 8): where views differ
    by a deviation d of log-odds, their mean is no surer than they are together (MacKay 1992).
    Halls are among the corridors. ``hall`` (N,), the probability that circulation is a hall,
    becomes the mean of its log-odds and those of the networks.
    """
    joined = np.empty_like(log_z)
    for first in range(0, len(log_z), ROWS_AT_ONCE):
        some = slice(first, first + ROWS_AT_ONCE)
        cells = layout.cells[some]
        if hall is not None:
            log_p = seen.of(cells).astype(np.float64)
            of_hall = log_p[:, _HALL] - np.logaddexp(log_p[:, _CORRIDOR], log_p[:, _HALL])
            hall[some] = _mean_probability(hall[some], of_hall, model.share)
        joined[some] = model.mean(log_z[some], model.evidence(seen, cells))
    return joined


def _mean_probability(
    of_list: NDArray[np.float32], log_of_networks: NDArray[np.float64], share: float
) -> NDArray[np.float64]:
    """(n,) the probability whose log-odds are the weighted mean of two."""
    tiny = 1e-6
    pair = np.stack([of_list.astype(np.float64), np.exp(log_of_networks)]).clip(tiny, 1 - tiny)
    odds = np.log(pair) - np.log1p(-pair)
    return np.asarray(1 / (1 + np.exp(-((1 - share) * odds[0] + share * odds[1]))))


_REACH_M = 16.0
"""Half the side (m) of the square around the robot: about the networks' receptive field."""

_EVERY_M = 0.5
"""Distance travelled (m) between evaluations; steps in between look up their position."""


class LocalFloor:
    """Floor-network scores along a robot's path.

    One network is evaluated at a time, in turn, which limits the delay; over a few metres all of
    them contribute.

    Parameters
    ----------
    source : LocalMap or OccupancyGrid
        The rolling map of the robot, or a known map, in the frame of the poses.
    model : FloorModel
    """

    def __init__(self, source: LocalMap | OccupancyGrid, model: FloorModel) -> None:
        self._source, self._model = source, model
        alone = [replace(model, networks=(network,)) for network in model.networks]
        self._turns = cycle(alone)
        self._gate = DistanceTrigger(_EVERY_M)
        self._grid: OccupancyGrid | None = None
        self._seen: FloorScores | None = None

    @property
    def n_labels(self) -> int:
        """K."""
        return len(self._model.columns)

    def along(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """(T, K) log-probabilities at the poses (T, 3) of a path."""
        return self.rows([self.at(pose[:2]) for pose in poses])

    def rows(self, seen: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
        """(T, K) the log-probabilities of T steps as an array."""
        return np.array(seen, np.float64).reshape(len(seen), self.n_labels)

    def at(self, position_m: ArrayLike) -> NDArray[np.float64]:
        """(K,) log-probabilities at a position (2,); nan off the map.

        Positions must follow a path.
        """
        where = finite_array("position_m", position_m, (2,))
        if self._gate.opens(float(where[0]), float(where[1])) is not None:
            self._grid = square_around(self._source, where, _REACH_M)
            with thread_limit(1):
                self._seen = None if self._grid is None else next(self._turns).scores(self._grid)
        if self._grid is None or self._seen is None:
            return np.full(self.n_labels, np.nan)
        cell = self._grid.cells_at_m(where[np.newaxis])
        if not ((cell >= 0) & (cell < self._grid.shape)).all():
            return np.full(self.n_labels, np.nan)
        return self._model.evidence(self._seen, cell)[0]


def with_local_floor(
    log_z: NDArray[np.float64], seen: NDArray[np.float64], model: FloorModel
) -> NDArray[np.float64]:
    """(..., K) the weighted mean of the log-odds of the list and of the networks at steps.

    Steps without network scores (nan) keep those of the list; see
    :func:`pgm_places.unary.floor_model.with_floor`.
    """
    return np.where(np.isnan(seen), log_z, model.mean(log_z, np.nan_to_num(seen)))
