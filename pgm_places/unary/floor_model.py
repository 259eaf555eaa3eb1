"""Floor-network scores: fused with scores of boosted lists, and door lines without a gate.

Shares and weights were chosen on buildings held out (docs/notes/tried.md).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import ROWS_AT_ONCE
from pgm_places.errors import ConfigError
from pgm_places.floor.architecture import LABELS
from pgm_places.floor.network import FloorNetwork
from pgm_places.floor.raster import CELL_M
from pgm_places.floor.view import FloorScores, floor_scores, views_of
from pgm_places.graph.layout import GridLayout
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.spaces.gates import Gates, chord_directions
from pgm_places.spaces.segment_features import components, neighbour_lists

_DOORWAY = LABELS.index("doorway")

_LIKELY = 0.5  # adjacent cells with a higher probability of a doorway form a blob

# The least mean probability along a line; chosen on buildings held out (docs/notes/tried.md).
_SURE = 0.9

_LEAST_M2 = 0.06  # smaller blobs are specks

# Shortest and longest line (m): shorter ones cannot be passed, longer ones are rarely doorways.
_LEAST_WIDTH_M, _MOST_WIDTH_M = 0.4, 2.5

# A line is dropped if a larger share of it lies in the enlarged rectangle of a gate.
_MARGIN_M, _THROUGH = 0.1, 0.3

_POINTS = 12  # number of the most probable cells of a blob through which lines are tried

_PER_WIDTH_M = 0.02  # penalty per metre, so that of equally probable lines the shortest wins

_NEXT = np.array([[0, 1], [1, -1], [1, 0], [1, 1]])


def door_lines(gates: Gates, scores: FloorScores) -> NDArray[np.int64]:
    """(n, 2) row and column of cells on lines at doorways without a gate candidate.

    Adjacent cells of 0.1 m with a doorway probability above one half form a blob. In each blob, the
    line from wall to wall with the highest mean probability is selected if the mean is at least
    0.9, if it is 0.4 to 2.5 m long, and if no candidate is there. Consecutive cells of a line share
    sides, as :meth:`Segmentation.of` requires.

    ``gates``: the candidates where passages narrow. ``scores``: the networks' scores of the map.
    """
    grid = gates.segmentation.watershed.grid
    pairs = [np.empty((0, 2), np.int64)]
    for points, probability in _blobs(grid, scores):
        middle = probability @ points / probability.sum()
        inside = _covered(gates, grid.cell_centres_m(middle[np.newaxis])) > 0
        if inside or probability.max() < _SURE:
            continue
        away = np.hypot(*(points - middle).T)
        line = _line(grid, scores, points[np.lexsort((away, -probability))[:_POINTS]])
        if line is not None and _covered(gates, grid.cell_centres_m(line)) < _THROUGH:
            pairs.append(_cells_on(line, grid.shape))
    return np.concatenate(pairs)


def _blobs(
    grid: OccupancyGrid, scores: FloorScores
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """The points (n, 2) of each blob, as rows and columns of the map, and their probabilities."""
    cells = np.argwhere(scores.log_p[..., _DOORWAY] > np.log(_LIKELY))
    points = (cells + 0.5) * (CELL_M / grid.resolution_m) - 0.5
    on_map = np.minimum(np.rint(points).astype(np.int64), np.array(grid.shape) - 1)
    free = grid.free[on_map[:, 0], on_map[:, 1]]
    cells, points = cells[free], points[free]
    blob = components(*neighbour_lists(_touching(cells), len(cells)))
    probability = np.exp(scores.log_p[cells[:, 0], cells[:, 1], _DOORWAY].astype(np.float64))
    order = np.argsort(blob, kind="stable")
    ends = np.cumsum(np.bincount(blob))
    for some in np.split(order, ends[:-1]):
        if len(some) * CELL_M**2 >= _LEAST_M2:
            yield points[some], probability[some]


def _touching(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """(E, 2) the pairs of cells, given in row-major order, that share a side or a corner."""
    if not len(cells):
        return np.empty((0, 2), np.int64)
    width = int(cells[:, 1].max()) + 3
    key = (cells + 1) @ np.array([width, 1])
    other = key[:, np.newaxis] + _NEXT @ np.array([width, 1])
    place = np.minimum(np.searchsorted(key, other), len(key) - 1)
    one, step = np.nonzero(key[place] == other)
    return np.stack([one, place[one, step]], axis=1)


def _covered(gates: Gates, points_m: NDArray[np.float64]) -> float:
    """The largest share of some points that lies in the rectangle of one gate."""
    reach = np.hypot(gates.width_m, gates.depth_m) / 2 + _MOST_WIDTH_M
    away = np.hypot(*(gates.centre_m - points_m.mean(axis=0)).T)
    margin = {"wider_m": _MARGIN_M, "deeper_m": _MARGIN_M}
    return max(
        (
            float(gates[int(g)].contains(points_m, **margin).mean())
            for g in np.flatnonzero(away < reach)
        ),
        default=0.0,
    )


def _line(
    grid: OccupancyGrid, scores: FloorScores, points: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """(m, 2) places every half cell along the surest line through one of the points."""
    directions = chord_directions()
    n_steps = int(np.ceil(2 * _MOST_WIDTH_M / grid.resolution_m))
    there = _Rays.of(grid, scores, points, directions, n_steps)
    back = _Rays.of(grid, scores, points, -directions, n_steps)
    n = there.length + back.length - 1
    sure = (there.total + back.total - there.first) / n
    width_m = n * grid.resolution_m / 2
    passable = width_m.min(axis=1, keepdims=True) >= _LEAST_WIDTH_M
    allowed = passable & (width_m < _MOST_WIDTH_M) & (sure >= _SURE)
    if not allowed.any():
        return None
    score = np.where(allowed, sure - _PER_WIDTH_M * width_m, -np.inf)
    point, way = np.unravel_index(int(score.argmax()), score.shape)
    steps = np.arange(1 - back.length[point, way], there.length[point, way])
    return np.asarray(points[point] + steps[:, np.newaxis] / 2 * directions[way])


class _Rays:
    """Free rays from points in all directions, sampled every half cell, the point itself first.

    ``length`` (n, D): free samples before the first other one. ``total``, ``first`` (n, D): the sum
    and the first of their probabilities of a doorway.
    """

    def __init__(self, free: NDArray[np.bool_], probability: NDArray[np.float32]) -> None:
        run = np.logical_and.accumulate(free, axis=2)
        self.length = run.sum(axis=2)
        self.total = (probability * run).sum(axis=2)
        self.first = probability[:, :, 0]

    @classmethod
    def of(
        cls,
        grid: OccupancyGrid,
        scores: FloorScores,
        points: NDArray[np.float64],
        directions: NDArray[np.float64],
        n_steps: int,
    ) -> "_Rays":
        """The rays from points (n, 2) in directions (D, 2), as rows and columns of the map."""
        steps = np.arange(n_steps)[:, np.newaxis] / 2
        at = points[:, np.newaxis, np.newaxis] + steps * directions[:, np.newaxis]
        cells = np.rint(at).astype(np.int64)
        last = np.array(grid.shape) - 1
        inside = ((cells >= 0) & (cells <= last)).all(axis=-1)
        on_map = np.clip(cells, 0, last)
        free = inside & grid.free[on_map[..., 0], on_map[..., 1]]
        log_p = scores.of(on_map.reshape(-1, 2))[:, _DOORWAY]
        return cls(free, np.exp(log_p).reshape(free.shape))


def _cells_on(line: NDArray[np.float64], shape: tuple[int, int]) -> NDArray[np.int64]:
    """(n, 2) the cells of a line and one beyond each end; consecutive cells share sides."""
    step = (line[-1] - line[0]) / (len(line) - 1)
    steps = np.arange(-3 * 4, (len(line) + 2) * 4 + 1)[:, np.newaxis] / 4
    cells = np.rint(line[0] + steps * step).astype(np.int64)
    cells = cells[np.append(True, (cells[1:] != cells[:-1]).any(axis=1))]
    oblique = np.flatnonzero((cells[1:] != cells[:-1]).all(axis=1))
    corners = np.stack([cells[oblique + 1, 0], cells[oblique, 1]], axis=1)
    cells = np.concatenate([cells, corners])
    return np.asarray(cells[((cells >= 0) & (cells < shape)).all(axis=1)])


_LEAST_DEPTH_M, _AT_LEAST = 0.4, 0.8

# Log-odds that wider gates must exceed to be doorways; chosen on held-out buildings
# (docs/notes/tried.md).
_WIDE_M, _WIDE_LOG_ODDS = 2.0, 2.5

_HALL, _CORRIDOR = LABELS.index("hall"), LABELS.index("corridor")


@dataclass(frozen=True, eq=False)
class FloorModel:
    """Floor networks, and their weights relative to the lists."""

    networks: tuple[FloorNetwork, ...] = field(repr=False)
    # the networks' output for each label: see :func:`columns_of`; -1 for a label that they do not
    # support, which keeps the score of the list
    columns: tuple[int, ...] = (0, 1, 2)
    views_per_network: int = 4  # number of orientations in which each network views a map
    share: float = 0.6  # weight of the networks' log-odds relative to those of the list with spaces
    doorway_share: float = 0.7  # this weight for doorways
    # weight of the networks' log-odds of a doorway at a gate, relative to the list of gates
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

    def evidence(self, scores: FloorScores, cells_rc: NDArray[np.integer]) -> NDArray[np.float64]:
        """(n, K) log-probabilities of cells, each over sqrt(1 + pi d^2 / 8), normalised again."""
        log_p = scores.of(cells_rc).astype(np.float64)
        log_p[:, _CORRIDOR] = np.logaddexp(log_p[:, _CORRIDOR], log_p[:, _HALL])
        spread = scores.doubt(cells_rc)[:, np.newaxis].astype(np.float64)
        logits = log_p[:, self.columns] / np.sqrt(1 + np.pi / 8 * spread**2)
        total = np.logaddexp.reduce(logits.T[self._by_column], axis=0)
        return np.asarray(logits - total[:, np.newaxis])


@dataclass(frozen=True, eq=False)
class FloorJudge:
    """Judgement of the gates of a map by the networks."""

    model: FloorModel
    scores: FloorScores  # the networks' scores of the map

    def cuts(self, gates: Gates) -> NDArray[np.int64]:
        """(n, 2) cells of door lines."""
        return door_lines(gates, self.scores)

    def judged(self, gates: Gates, probability: NDArray[np.float64]) -> NDArray[np.float64]:
        """(G,) probabilities that gates are doorways, by their list and the networks.

        The networks' probability of a gate is the doorway probability that a fifth of the cells in
        its rectangle, at least 0.4 m deep, exceed. It is used alone at cuts, as the list is trained
        on narrowing passages. Gates over 2 m wide, few of which are doorways, lose 2.5 of their
        log-odds.
        """
        share = np.where(gates.at_cuts, 1.0, self.model.gate_share)
        odds = (1 - share) * _log_odds(probability)
        grid = gates.segmentation.watershed.grid
        for g in range(len(gates)):
            deeper_m = max(_LEAST_DEPTH_M - gates[g].depth_m, 0.0) / 2
            cells = gates[g].cells(grid, deeper_m=deeper_m)
            log_p = self.scores.of(cells)[:, LABELS.index("doorway")] if len(cells) else np.zeros(1)
            odds[g] += share[g] * _log_odds(np.exp(np.quantile(log_p, _AT_LEAST)))
        odds -= np.where(gates.width_m > _WIDE_M, _WIDE_LOG_ODDS, 0.0)
        return np.asarray(1 / (1 + np.exp(-odds)))


def _log_odds(probability: ArrayLike) -> NDArray[np.float64]:
    p = np.clip(probability, 1e-3, 1 - 1e-3)
    return np.asarray(np.log(p) - np.log1p(-p))


def columns_of(label_names: Sequence[str]) -> tuple[int, ...]:
    """(K,) the networks' output for each of these labels; halls count as corridors.

    ConfigError: A name is no label of the networks, or corridor or room is missing.
    """
    if {"corridor", "room"} <= set(label_names) <= {"corridor", "room", "doorway"}:
        return tuple(LABELS.index(name) for name in label_names)
    raise ConfigError(
        "the floor networks tell corridor, room, doorway and hall apart, and these labels are "
        f"{', '.join(label_names)}: use unary = 'space', or name corridors and rooms so"
    )


def with_floor(
    log_z: NDArray[np.float64],
    scores: FloorScores,
    model: FloorModel,
    layout: GridLayout,
    hall: NDArray[np.float32] | None = None,
) -> NDArray[np.float64]:
    """(N, K) log-probabilities: the weighted mean of both log-odds.

    With shares s_k and scores z_k of the list, log p_k is (1 - s_k) z_k + s_k n_k, normalised. The
    n_k of the networks are their log-probabilities over sqrt(1 + pi d^2 / 8): where views differ
    by a deviation d of log-odds, their mean is no surer than they are together (MacKay 1992).
    Halls are among the corridors. ``hall`` (N,), the probability that circulation is a hall,
    becomes the mean of its log-odds and the log-odds of the networks.
    """
    joined = np.empty_like(log_z)
    for first in range(0, len(log_z), ROWS_AT_ONCE):
        some = slice(first, first + ROWS_AT_ONCE)
        cells = layout.cells[some]
        if hall is not None:
            log_p = scores.of(cells).astype(np.float64)
            of_hall = log_p[:, _HALL] - np.logaddexp(log_p[:, _CORRIDOR], log_p[:, _HALL])
            hall[some] = _mean_probability(hall[some], of_hall, model.share)
        joined[some] = model.mean(log_z[some], model.evidence(scores, cells))
    return joined


def _mean_probability(
    of_list: NDArray[np.float32], log_of_networks: NDArray[np.float64], share: float
) -> NDArray[np.float64]:
    """(n,) the probability whose log-odds are the weighted mean of two."""
    tiny = 1e-6
    pair = np.stack([of_list.astype(np.float64), np.exp(log_of_networks)]).clip(tiny, 1 - tiny)
    odds = np.log(pair) - np.log1p(-pair)
    return np.asarray(1 / (1 + np.exp(-((1 - share) * odds[0] + share * odds[1]))))
