"""Places: the areas between accepted gates, such as rooms and corridors."""

import heapq
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import freeze
from pgm_places.errors import InputError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.spaces.gates import MOST_HALF_WIDTH_M, Gates
from pgm_places.spaces.segment_features import components, neighbour_lists, segment_features
from pgm_places.spaces.segmentation import SpaceSegments, divided
from pgm_places.spaces.space_spec import SEGMENT_FEATURES

_UNIT = 1e-9  # unit of weights, so that their sums do not depend on the order


def join(count: int, pairs: NDArray[np.integer], weights: NDArray[np.float64]) -> NDArray[np.int32]:
    """(N,) group of each node, numbered in the order of their first nodes.

    The two groups with the largest weight between them are joined first, and their weights to every
    other group added up, until all weights are negative: greedy additive edge contraction (Keuper
    et al., 2015), a heuristic for a small sum of weights between groups. Groups of equal weight are
    joined at once, so that the result does not depend on the numbers of the nodes.

    ``count``: N, the number of nodes. ``pairs`` (E, 2): pairs of nodes; other pairs have no weight,
    which equals a weight of -0. ``weights`` (E,): positive if a pair belongs together, negative if
    not. A weight of inf always joins; -inf outweighs all other weights.

    Examples
    --------
    >>> ring = np.array([[0, 1], [1, 2], [2, 3], [3, 0]])
    >>> join(4, ring, np.array([5.0, 1.0, 4.0, -3.0])).tolist()
    [0, 0, 1, 1]
    """
    certain = weights == np.inf
    first = components(*neighbour_lists(pairs[certain], count))
    n = int(first.max(initial=-1)) + 1
    least = -np.abs(weights[np.isfinite(weights)]).sum() - 1.0  # outweighs the sum of all others
    known = np.where(np.isfinite(weights), weights, least)
    joined = _contracted(_Groups(n, first[pairs[~certain]], known[~certain]))
    return components(*neighbour_lists(joined, n))[first]


class _Groups:
    """The current groups, the weights between them, and the queue of candidate pairs."""

    def __init__(self, count: int, pairs: NDArray[np.int32], weights: NDArray[np.float64]) -> None:
        self.into = list(range(count))
        self.weight: list[dict[int, int]] = [{} for _ in range(count)]
        for (a, b), weight in zip(pairs.tolist(), np.rint(weights / _UNIT).tolist(), strict=True):
            if a != b:
                self.weight[a][b] = self.weight[b][a] = self.weight[a].get(b, 0) + int(weight)
        self.queue = [
            (-weight, a, b)
            for a, others in enumerate(self.weight)
            for b, weight in others.items()
            if a < b and weight >= 0
        ]
        heapq.heapify(self.queue)

    def best(self) -> list[tuple[int, int]]:
        """The pairs with the largest weight; none if all are negative."""
        pairs: list[tuple[int, int]] = []
        largest = 0
        while self.queue and (not pairs or -self.queue[0][0] == largest):
            negative, a, b = heapq.heappop(self.queue)
            if self.weight[a].get(b) == -negative:  # otherwise the entry is outdated
                pairs.append((a, b))
                largest = -negative
        return pairs

    def now(self, group: int) -> int:
        """The current group that contains an original one."""
        while self.into[group] != group:
            group = self.into[group]
        return group

    def merge(self, a: int, b: int) -> None:
        """Join two groups."""
        if len(self.weight[a]) < len(self.weight[b]):
            a, b = b, a
        self.into[b] = a
        for other, weight in self.weight[b].items():
            del self.weight[other][b]
            if other == a:
                continue
            total = self.weight[a].get(other, 0) + weight
            self.weight[a][other] = self.weight[other][a] = total
            if total >= 0:
                heapq.heappush(self.queue, (-total, a, other))
        self.weight[b] = {}


def _contracted(groups: _Groups) -> NDArray[np.int64]:
    """(M, 2) the joined pairs."""
    joined: list[tuple[int, int]] = []
    while chosen := groups.best():
        for pair in chosen:
            a, b = map(groups.now, pair)
            if a != b:
                groups.merge(a, b)
        joined += chosen
    return np.array(joined, np.int64).reshape(-1, 2)


_SURE = 1e-6  # least distance of uncertain probabilities of gates from 0 and 1

_SLIVER_M2 = 2.0  # smaller segments behind an impassable gap are corners of a place, not places


@dataclass(frozen=True, eq=False)
class Places:
    """The segments of the finest scale, joined unless a doorway separates them."""

    gates: Gates
    accepted: NDArray[np.bool_]  # (G,) which gates are accepted as doorways
    # the places as a division of the open space, with areas, openings, raster and graph
    segments: SpaceSegments
    # (G, 2) the two places on either side of each gate, possibly the same
    gate_places: NDArray[np.int32]

    @property
    def count(self) -> int:
        """P, the number of places."""
        return self.segments.count

    @property
    def graph(self) -> LabelGraph:
        """The places as nodes; adjacent places are joined."""
        return self.segments.graph

    @property
    def parting(self) -> NDArray[np.bool_]:
        """(G,) which accepted gates have different places on their two sides."""
        return np.asarray(self.accepted & (self.gate_places[:, 0] != self.gate_places[:, 1]))


def places_between(gates: Gates, accepted: ArrayLike, *, threshold: float = 0.5) -> Places:
    """The places of a map between the gates that are doorways.

    Two segments of the finest scale belong to one place if an opening between them is too wide for
    a gate. Between all others there are candidates; the most probable one counts for the pair, with
    its log-odds for two places (positive) or one place (negative). If candidates disagree, because
    another opening leads around a doorway, :func:`join` weighs them: either all gates between two
    places separate them, or they are one place. Between two separated segments, the most probable
    gate is a doorway, and so is every other gate above the threshold; the rest are gaps between two
    places. Gaps under 0.2 m, such as cracks in a wall or between chairs in a row, are no candidates
    and join nothing; but segments under 2 m2 without another way out join the neighbour behind
    their widest gap.

    ``accepted`` (G,): which gates are doorways, or their probabilities. Booleans, and probabilities
    of exactly 0 and 1, are certain: a certain non-doorway joins the segments on its sides
    regardless of other gates, unless another gate between these two segments is a doorway.
    ``threshold``: the probability at which a doorway is undecided, above 0 and below 1.

    Examples
    --------
    >>> import numpy as np
    >>> from pgm_places.maps.occupancy_grid import OccupancyGrid
    >>> from pgm_places.spaces.gates import gate_candidates
    >>> from pgm_places.spaces.segmentation import Segmentation
    >>> cells = np.zeros((20, 42), np.int8)
    >>> cells[:, 20:22], cells[8:12, 20:22] = 100, 0  # two rooms, a wall, a door of 0.8 m
    >>> gates = gate_candidates(Segmentation.of(OccupancyGrid(cells, resolution_m=0.2)))
    >>> places_between(gates, [True]).count, places_between(gates, [0.2]).count
    (2, 1)
    """
    if not 0 < threshold < 1:
        raise InputError(f"threshold must lie between 0 and 1, got {threshold}")
    log_odds = _log_odds(_probability(accepted, len(gates)), threshold)
    finest = gates.segmentation.scales[0]
    n_basins = finest.watershed.basins.count
    strongest = _strongest(gates.segments, log_odds)
    home = join(finest.count, *_weighed_pairs(finest, gates, strongest))
    segments = divided(finest.watershed, home[finest.segment_of[:n_basins]][None])[0]
    sides = home[gates.segments]
    taken = (log_odds > 0) | (log_odds == strongest)
    taken &= sides[:, 0] != sides[:, 1]
    taken |= log_odds == np.inf
    return Places(gates, freeze(taken), segments, sides)


def place_features(places: Places) -> NDArray[np.float64]:
    """(P, 43) the features of every place; ``PLACE_FEATURES`` defines the columns."""
    own = segment_features(places.segments)
    names = [spec.id for spec in SEGMENT_FEATURES]
    area, long = own[:, names.index("area")], own[:, names.index("long")]
    sides = places.gate_places[places.parting]
    number = np.bincount(sides.reshape(-1), minlength=places.count)
    ends = np.concatenate([sides, sides[:, ::-1]])
    one_gate = np.bincount(ends[number[ends[:, 1]] == 1, 0], minlength=places.count)
    extra = (
        number,
        number / np.sqrt(area),
        number / long,
        one_gate,
        one_gate / np.sqrt(area),
        one_gate / np.maximum(number, 1),
    )
    return np.concatenate([own, np.stack(extra, axis=1)], axis=1)


def _probability(accepted: ArrayLike, n_gates: int) -> NDArray[np.float64]:
    values = np.asarray(accepted)
    if values.shape != (n_gates,) or not (values.dtype.kind in "bf" or not values.size):
        raise InputError(
            "accepted must contain one boolean or probability per gate "
            f"({n_gates}), got {values.dtype} of shape {values.shape}"
        )
    if values.size and not (values.min() >= 0 and values.max() <= 1):
        raise InputError(
            f"accepted must hold probabilities from 0 to 1, got {values.min()} to {values.max()}"
        )
    return np.asarray(values, np.float64)


def _log_odds(probability: NDArray[np.float64], threshold: float) -> NDArray[np.float64]:
    """(G,) log-odds of each gate relative to the threshold, infinite for certain gates."""
    p = np.clip(probability, _SURE, 1 - _SURE)
    log_odds = np.log(p / (1 - p)) - np.log(threshold / (1 - threshold))
    log_odds[probability == 0], log_odds[probability == 1] = -np.inf, np.inf
    return log_odds


def _strongest(segments: NDArray[np.int32], log_odds: NDArray[np.float64]) -> NDArray[np.float64]:
    """(G,) the largest log-odds of the gates between the same two segments."""
    pairs, of = np.unique(segments, axis=0, return_inverse=True)
    most = np.full(len(pairs), -np.inf)
    np.maximum.at(most, of.reshape(-1), log_odds)
    return most[of.reshape(-1)]


def _weighed_pairs(
    finest: SpaceSegments, gates: Gates, strongest: NDArray[np.float64]
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """(E, 2) neighbouring segments, and (E,) their weights for being one place."""
    openings = finest.openings
    weights = np.array([finest.count, 1])
    key, with_gate = openings.segments @ weights, gates.segments @ weights
    wide = openings.half_width_m >= MOST_HALF_WIDTH_M
    wide |= _ways_out_of_slivers(finest, wide | np.isin(key, with_gate))
    first = np.unique(with_gate, return_index=True)[1]
    return (
        np.concatenate([openings.segments[wide], gates.segments[first]]),
        np.concatenate([np.full(int(wide.sum()), np.inf), -strongest[first]]),
    )


def _ways_out_of_slivers(finest: SpaceSegments, passable: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(O,) the widest gaps of small segments without a passable opening."""
    openings = finest.openings
    has_way_out = np.zeros(finest.count, np.bool_)
    has_way_out[openings.segments[passable]] = True
    sliver = (finest.area_m2 < _SLIVER_M2) & ~has_way_out
    widest = np.zeros(finest.count)
    np.maximum.at(widest, openings.segments.reshape(-1), np.repeat(openings.half_width_m, 2))
    is_widest = openings.half_width_m[:, None] == widest[openings.segments]
    return np.asarray((sliver[openings.segments] & is_widest).any(axis=1))


WIDEST_WALL_M = 0.6
LEAST_SHARED_M = 1.0


def neighbour_graph(places: Places) -> LabelGraph:
    """The places as nodes, joined if a gate or at least 1 m of a wall separates them.

    Rooms of one kind are often adjacent along a corridor, without a door between them; the graph
    of ``places`` joins each of them only with the corridor. Places across walls thicker than
    0.6 m, or across shafts between two walls, are not neighbours.
    """
    resolution_m = places.gates.segmentation.watershed.grid.resolution_m
    pairs, shared_m = shared_walls(places.segments.raster(), resolution_m)
    by_gate = np.sort(places.gate_places[places.parting], axis=1)
    both = np.concatenate([pairs[shared_m >= LEAST_SHARED_M], by_gate])
    return LabelGraph.from_edges(places.count, np.unique(both, axis=0))


def shared_walls(
    place: NDArray[np.int32], resolution_m: float, *, widest_wall_m: float = WIDEST_WALL_M
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """(P, 2) pairs of places with a wall between them, and (P,) the length in metres they share.

    Along every row and column of the map, two consecutive places at most ``widest_wall_m`` apart
    share one side of a cell. Walls along the axes of the map have their true length, oblique ones
    up to 1.41 times their length.

    ``place`` (H, W): the place of each cell, -1 for none.
    """
    reach = int(widest_wall_m / resolution_m + 1e-6) + 1
    runs = [np.empty((0, 2), np.int32)]
    for raster in (place, place.T):
        width = raster.shape[1]
        at = np.flatnonzero(raster >= 0)
        here = np.ascontiguousarray(raster).reshape(-1)[at]
        step = np.diff(at)
        same_line = at[1:] // width == at[:-1] // width
        crossed = (here[1:] != here[:-1]) & same_line & (step <= reach)
        runs.append(np.sort(np.column_stack([here[:-1], here[1:]])[crossed], axis=1))
    pairs, number = np.unique(np.concatenate(runs), axis=0, return_counts=True)
    return pairs, number.astype(np.float64) * resolution_m
