"""The features of segments, one row per segment."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pgm_places._core import add_paths, largest_rests
from pgm_places.spaces.components import components, neighbour_lists
from pgm_places.spaces.segment_rows import SegmentRows
from pgm_places.spaces.segmentation import Segments
from pgm_places.spaces.shapes import shape_columns
from pgm_places.spaces.space_spec import LARGEST_NEIGHBOUR_FEATURES, OWN_FEATURES

NARROW_M = 0.8
"""Half width of the widest opening that counts as narrow."""

_MOST_SOURCES = 1000
"""Number of sources per component; the time is their number times that of the edges."""

_Columns = Mapping[str, NDArray[np.float64]]


def segment_features(*divisions: Segments) -> NDArray[np.float64]:
    """(S, 37) the features of every segment of a scale, or of every place.

    The columns are those of ``SEGMENT_FEATURES``, which defines them. The segments of several
    divisions of one map follow each other; none of them knows of another division.

    Examples
    --------
    >>> from pgm_places.datasets import generate_building
    >>> from pgm_places.spaces.segmentation import Segmentation
    >>> scale = Segmentation.of(generate_building(size="small").grid).scales[0]
    >>> segment_features(scale).shape == (scale.count, 37)
    True
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
    whole = np.repeat([part.sum() for part in areas], sizes)
    median = np.repeat([_weighted_median(*both) for both in zip(radii, areas, strict=True)], sizes)
    lists = neighbour_lists(segments.neighbours, segments.count)
    between, cut = betweenness(*lists, area), area_cut_off(*lists, area)
    i, j = _both_ways(segments)
    number = np.bincount(i, minlength=segments.count)
    around = np.bincount(i, area[j], segments.count)
    return {
        "rank": np.concatenate([_share_no_larger(part) for part in areas]),
        "radius_share": own["radius"] / median,
        "long_share": own["long"] / np.sqrt(whole),
        "betweenness": between,
        "cut": cut,
        "neighbour_area": around / np.maximum(number, 1),
        "neighbour_share": around / area,
        "neighbour_betweenness": _largest_around(between, i, j),
        "neighbour_cut": _largest_around(cut, i, j),
    }


def betweenness(
    start: NDArray[np.int32], neighbour: NDArray[np.int32], area_m2: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N,) share of the shortest paths between other nodes of a component through each node.

    Every edge has length 1 (Freeman, 1977; algorithm: Brandes, 2001). In components of more than
    1000 nodes, only paths from the 1000 nodes with the largest areas count.

    Parameters
    ----------
    start, neighbour : (N + 1,) and (2 E,) int32
        The neighbours of each node (:func:`pgm_places.spaces.components.neighbour_lists`).
    area_m2 : (N,) float

    Examples
    --------
    >>> from pgm_places.spaces.components import neighbour_lists
    >>> chain = neighbour_lists(np.array([[0, 1], [1, 2]]), 3)
    >>> betweenness(*chain, np.ones(3)).tolist()
    [0.0, 1.0, 0.0]
    """
    component = components(start, neighbour)
    sources = np.argsort(-area_m2, kind="stable")
    share = np.zeros(len(area_m2))
    add_paths(sources, component, _MOST_SOURCES, start, neighbour, share)
    return share


def area_cut_off(
    start: NDArray[np.int32], neighbour: NDArray[np.int32], area_m2: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N,) share of its component that each node cuts off from the largest remaining part.

    0 if the rest remains connected without it. Arguments as :func:`betweenness`.

    Examples
    --------
    >>> from pgm_places.spaces.components import neighbour_lists
    >>> chain = neighbour_lists(np.array([[0, 1], [1, 2]]), 3)
    >>> area_cut_off(*chain, np.array([1.0, 5.0, 3.0])).tolist()
    [0.0, 0.25, 0.0]
    """
    rest, whole = np.zeros(len(area_m2)), np.zeros(len(area_m2))
    largest_rests(start, neighbour, np.ascontiguousarray(area_m2, np.float64), rest, whole)
    others = whole - area_m2
    kept = np.divide(rest, others, out=np.ones(len(rest)), where=others > 1e-9 * whole)
    return np.minimum(np.maximum(1.0 - kept, 0.0), 1.0)


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
    of_largest[i[order]] = picked[j[order]]  # the last one stays
    return of_largest
