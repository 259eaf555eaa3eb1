"""The features of segments: shape, openings, and position in the graph of segments."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places._core import add_paths, gather_basins, largest_rests, number_components
from pgm_places.spaces.basins import N_RECTANGLES, clearance_m
from pgm_places.spaces.segmentation import SpaceSegments
from pgm_places.spaces.space_spec import LARGEST_NEIGHBOUR_FEATURES, OWN_FEATURES


def neighbour_lists(
    pairs: NDArray[np.integer], count: int
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """(N + 1,) start of each node's neighbours, and the neighbours, ascending.

    ``pairs`` (E, 2): the edges, in any direction. ``count``: N, the number of nodes.

    Examples
    --------
    >>> start, neighbour = neighbour_lists(np.array([[0, 2], [1, 0]]), 3)
    >>> start.tolist(), neighbour.tolist()
    ([0, 2, 3, 4], [1, 2, 0, 0])
    """
    i, j = pairs.T.astype(np.int64)
    n = max(count, 1)
    ends = np.sort(np.concatenate([i * n + j, j * n + i]))
    start = np.searchsorted(ends, np.arange(count + 1) * n)
    return start.astype(np.int32), (ends % n).astype(np.int32)


def components(start: NDArray[np.int32], neighbour: NDArray[np.int32]) -> NDArray[np.int32]:
    """(N,) component of each node, numbered in the order of their first nodes."""
    component = np.empty(len(start) - 1, np.int32)
    number_components(start, neighbour, component)
    return component


@dataclass(frozen=True, eq=False)
class SegmentRows:
    """The segments of several divisions of a map, concatenated."""

    divisions: Sequence[SpaceSegments]  # at least one

    @cached_property
    def first(self) -> NDArray[np.int64]:
        """(D + 1,) the first segment of each division, and the total number S."""
        return np.cumsum([0, *(division.count for division in self.divisions)])

    @property
    def count(self) -> int:
        """S."""
        return int(self.first[-1])

    @property
    def resolution_m(self) -> float:
        """The map's cell size."""
        return self.divisions[0].watershed.grid.resolution_m

    @cached_property
    def area_m2(self) -> NDArray[np.float64]:
        """(S,) area of each segment."""
        return np.concatenate([division.area_m2 for division in self.divisions])

    @cached_property
    def radius_m(self) -> NDArray[np.float64]:
        """(S,) radius of the largest disc in each segment."""
        return np.concatenate([division.radius_m for division in self.divisions])

    @cached_property
    def ends(self) -> NDArray[np.int64]:
        """(2 O,) the two segments of each opening."""
        return self._numbered(division.openings.segments for division in self.divisions).reshape(-1)

    @cached_property
    def half_width_m(self) -> NDArray[np.float64]:
        """(2 O,) half the width of each opening, twice."""
        openings = [division.openings.half_width_m for division in self.divisions]
        return np.repeat(np.concatenate(openings), 2)

    @cached_property
    def open_sides(self) -> NDArray[np.float64]:
        """(S,) sides of cells at openings."""
        sides = np.concatenate([division.openings.sides for division in self.divisions])
        twice = np.repeat(sides, 2).astype(np.float64)
        return np.asarray(np.bincount(self.ends, twice, self.count), np.float64)

    @cached_property
    def neighbours(self) -> NDArray[np.int64]:
        """(E, 2) the pairs of segments that share an opening."""
        return self._numbered(division.neighbours for division in self.divisions)

    def by_division(self, values: NDArray[Any]) -> list[NDArray[Any]]:
        """Values (S, ...) of all segments, split by division."""
        return np.split(values, self.first[1:-1])

    def _numbered(self, pairs: Iterator[NDArray[np.int32]]) -> NDArray[np.int64]:
        """Pairs of segments of each division, in the numbers of the concatenation."""
        starts = self.first.tolist()
        return np.concatenate(
            [part.astype(np.int64) + start for part, start in zip(pairs, starts, strict=False)]
        )


NARROW_M = 0.8
"""Half width of the widest opening that counts as narrow."""

_Columns = Mapping[str, NDArray[np.float64]]


def segment_features(*divisions: SpaceSegments) -> NDArray[np.float64]:
    """(S, 37) the features of every segment of a scale, or of every place.

    ``SEGMENT_FEATURES`` defines the columns. The segments of several divisions of a map are
    concatenated; divisions do not influence each other.
    """
    segments = SegmentRows(divisions)
    if not segments.count:
        return np.zeros((0, len(OWN_FEATURES) + len(LARGEST_NEIGHBOUR_FEATURES)))
    own = shape_columns(segments)
    own |= _opening_columns(segments, own)
    own |= _position_columns(segments, own)
    values = np.stack([own[spec.id] for spec in OWN_FEATURES], axis=1)
    of_largest = [spec.id.removeprefix("largest_") for spec in LARGEST_NEIGHBOUR_FEATURES]
    picked = np.stack([own[id] for id in of_largest], axis=1)
    return np.concatenate([values, _of_largest_neighbour(segments, picked)], axis=1)


def _opening_columns(segments: SegmentRows, own: _Columns) -> dict[str, NDArray[np.float64]]:
    ends, half_width, count = segments.ends, segments.half_width_m, segments.count
    number = np.bincount(ends, minlength=count).astype(np.float64)
    narrow = np.bincount(ends[half_width < NARROW_M], minlength=count).astype(np.float64)
    widest = np.zeros(count)
    np.maximum.at(widest, ends, half_width)
    return {
        "openings": number,
        "narrow": narrow,
        "widest": widest,
        "widest_share": widest / own["radius"],
        "opening_density": number / np.sqrt(own["area"]),
        "narrow_density": narrow / own["long"],
        "open_share": segments.open_sides * segments.resolution_m / own["outline"],
    }


def _position_columns(segments: SegmentRows, own: _Columns) -> dict[str, NDArray[np.float64]]:
    area, sizes = own["area"], np.diff(segments.first)
    areas, radii = segments.by_division(area), segments.by_division(own["radius"])
    total = np.repeat([part.sum() for part in areas], sizes)
    median = np.repeat([_weighted_median(*both) for both in zip(radii, areas, strict=True)], sizes)
    lists = neighbour_lists(segments.neighbours, segments.count)
    between, cut = betweenness(*lists, area), area_cut_off(*lists, area)
    i, j = _both_ways(segments)
    number = np.bincount(i, minlength=segments.count)
    around = np.bincount(i, area[j], segments.count)
    return {
        "rank": np.concatenate([_share_no_larger(part) for part in areas]),
        "radius_share": own["radius"] / median,
        "long_share": own["long"] / np.sqrt(total),
        "betweenness": between,
        "cut": cut,
        "neighbour_area": around / np.maximum(number, 1),
        "neighbour_share": around / area,
        "neighbour_betweenness": _largest_around(between, i, j),
        "neighbour_cut": _largest_around(cut, i, j),
    }


def betweenness(
    start: NDArray[np.int32],
    neighbour: NDArray[np.int32],
    area_m2: NDArray[np.float64],
    *,
    _most_sources: int = 1000,
) -> NDArray[np.float64]:
    """(N,) share of the shortest paths between other nodes of a component through each node.

    Every edge has length 1 (Freeman, 1977; algorithm: Brandes, 2001). In components of more than
    1000 nodes, only paths from the 1000 nodes with the largest areas count: the time grows with
    sources times edges.

    ``start`` and ``neighbour`` are those of :func:`neighbour_lists`; ``area_m2`` has shape (N,).
    """
    component = components(start, neighbour)
    sources = np.argsort(-area_m2, kind="stable")
    share = np.zeros(len(area_m2))
    add_paths(sources, component, _most_sources, start, neighbour, share)
    return share


def area_cut_off(
    start: NDArray[np.int32], neighbour: NDArray[np.int32], area_m2: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N,) share of its component that each node cuts off from the largest remaining part.

    0 if the rest remains connected without it. Arguments as :func:`betweenness`.
    """
    rest, total = np.zeros(len(area_m2)), np.zeros(len(area_m2))
    largest_rests(start, neighbour, np.ascontiguousarray(area_m2, np.float64), rest, total)
    others = total - area_m2
    share = np.divide(rest, others, out=np.ones(len(rest)), where=others > 1e-9 * total)
    return np.minimum(np.maximum(1.0 - share, 0.0), 1.0)


def _both_ways(segments: SegmentRows) -> NDArray[np.int64]:
    """(2, 2 E) every pair of neighbours in one direction, then in the other."""
    pairs = segments.neighbours
    return np.concatenate([pairs, pairs[:, ::-1]]).T


def _share_no_larger(area: NDArray[np.float64]) -> NDArray[np.float64]:
    ordered = np.sort(area)
    below = np.concatenate([[0.0], np.cumsum(ordered)])
    # Sizes that differ only by rounding count as equal.
    return np.asarray(below[np.searchsorted(ordered, area * (1 + 1e-9), "right")] / below[-1])


def _weighted_median(values: NDArray[np.float64], weight: NDArray[np.float64]) -> float:
    order = np.argsort(values, kind="stable")
    below = np.cumsum(weight[order])
    return float(values[order][np.searchsorted(below, below[-1] / 2)])


def _largest_around(
    values: NDArray[np.float64], i: NDArray[np.int64], j: NDArray[np.int64]
) -> NDArray[np.float64]:
    largest = np.zeros(len(values))
    np.maximum.at(largest, i, values[j])
    return largest


def _of_largest_neighbour(
    segments: SegmentRows, picked: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(S, P) the columns of each segment's largest neighbour; ties go to the larger values."""
    i, j = _both_ways(segments)
    order = np.lexsort((*picked[j].T[::-1], i))  # the area is the first column: compared first
    of_largest = np.zeros_like(picked)
    of_largest[i[order]] = picked[j[order]]  # of several, the last assignment wins
    return of_largest


def shape_columns(rows: SegmentRows) -> dict[str, NDArray[np.float64]]:
    """(S,) values of all segments of some divisions by feature: see ``SHAPE_FEATURES``.

    In addition, ``outline`` is its length along sides of cells, including openings. Roundness is 1
    for a disc or a square, near 0 for a line.
    """
    resolution_m, area, radius, count = rows.resolution_m, rows.area_m2, rows.radius_m, rows.count
    sums = rows.divisions[0].watershed.sums
    total = np.zeros((count, sums.total.shape[1]), np.int64)
    low = np.full((count, sums.low.shape[1]), np.inf)
    high = np.full((count, sums.high.shape[1]), -np.inf)
    parts = zip(rows.divisions, *map(rows.by_division, (total, low, high)), strict=True)
    for division, *own in parts:
        gather_basins(division.segment_of, sums.total, sums.low, sums.high, *own)
    cells = np.round(area / resolution_m**2).astype(np.int64)
    short, long = (side * resolution_m for side in _rectangles(low, high))
    clearance = clearance_m(total[:, 0] / cells, resolution_m)
    outline = (total[:, 2] + total[:, 3] + rows.open_sides) * resolution_m
    return {
        "area": area,
        "radius": radius,
        "clearance": clearance,
        "clearance_share": clearance / radius,
        "roundness": _roundness(cells, total[:, 4:9]),
        "short": short,
        "long": long,
        "aspect": short / long,
        "filling": area / (short * long),
        "discs": area / (np.pi * radius**2),
        "unknown": total[:, 3] * resolution_m / outline,
        "furniture": total[:, 1] / cells,
        "outline": outline,
    }


def _rectangles(
    low: NDArray[np.float64], high: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(S,) shorter and (S,) longer side, in cells, of the rectangle with the smallest area."""
    extent = high - low + 1
    one, other = extent[:, :N_RECTANGLES], extent[:, N_RECTANGLES:]
    best = np.arange(len(low)), np.argmin(np.round(one * other, 6), axis=1)
    return np.minimum(one, other)[best], np.maximum(one, other)[best]


def _roundness(cells: NDArray[np.int64], moments: NDArray[np.int64]) -> NDArray[np.float64]:
    """Square root of the ratio of the principal second moments; cells are squares, not points."""
    r, c, rr, rc, cc = moments.T
    # Integers shifted by the rounded mean stay exact and small.
    mid_r, mid_c = np.round(r / cells).astype(np.int64), np.round(c / cells).astype(np.int64)
    off_r, off_c = (r - cells * mid_r) / cells, (c - cells * mid_c) / cells
    var_r = (rr - 2 * mid_r * r + cells * mid_r**2) / cells - off_r**2 + 1 / 12
    var_c = (cc - 2 * mid_c * c + cells * mid_c**2) / cells - off_c**2 + 1 / 12
    cov = (rc - mid_r * c - mid_c * r + cells * mid_r * mid_c) / cells - off_r * off_c
    mean, spread = (var_r + var_c) / 2, np.hypot((var_r - var_c) / 2, cov)
    return np.asarray(np.sqrt(np.maximum(mean - spread, 0.0) / (mean + spread)))
