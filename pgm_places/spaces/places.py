"""Places: the areas between accepted gates, such as rooms and corridors."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import freeze
from pgm_places.errors import InputError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.spaces.gates import MOST_HALF_WIDTH_M, Gates
from pgm_places.spaces.joining import join
from pgm_places.spaces.segment_features import segment_features
from pgm_places.spaces.segmentation import Segments, divided
from pgm_places.spaces.space_spec import SEGMENT_FEATURES

_SURE = 1e-6
"""Least distance of uncertain probabilities of gates from 0 and 1."""

_SLIVER_M2 = 2.0
"""Smaller segments behind an impassable gap are corners of a place, not places."""


@dataclass(frozen=True, eq=False)
class Places:
    """The segments of the finest scale, joined unless a doorway separates them.

    Parameters
    ----------
    gates : Gates
    accepted : (G,) bool
        Which gates are accepted as doorways.
    segments : Segments
        The places as a division of the open space, with areas, openings, raster and graph.
    gate_places : (G, 2) int32
        The two places on either side of each gate, possibly the same.
    """

    gates: Gates
    accepted: NDArray[np.bool_]
    segments: Segments
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

    Parameters
    ----------
    gates : Gates
    accepted : (G,) bool or float
        Which gates are doorways, or their probabilities. Booleans, and probabilities of exactly 0
        and 1, are certain: a certain non-doorway joins the segments on its sides regardless of
        other gates, unless another gate between these two segments is a doorway.
    threshold : float
        The probability at which a doorway is undecided, above 0 and below 1.

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
    finest: Segments, gates: Gates, strongest: NDArray[np.float64]
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


def _ways_out_of_slivers(finest: Segments, passable: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(O,) the widest gaps of small segments without a passable opening."""
    openings = finest.openings
    has_way_out = np.zeros(finest.count, np.bool_)
    has_way_out[openings.segments[passable]] = True
    sliver = (finest.area_m2 < _SLIVER_M2) & ~has_way_out
    widest = np.zeros(finest.count)
    np.maximum.at(widest, openings.segments.reshape(-1), np.repeat(openings.half_width_m, 2))
    is_widest = openings.half_width_m[:, None] == widest[openings.segments]
    return np.asarray((sliver[openings.segments] & is_widest).any(axis=1))
