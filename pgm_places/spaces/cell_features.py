"""Features of cells from the segments they lie in, looked up a chunk of cells at a time."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.spaces.places import Places, place_features
from pgm_places.spaces.segment_features import segment_features
from pgm_places.spaces.segmentation import Segmentation, Segments
from pgm_places.spaces.space_spec import CELL_FEATURES, PLACE_FEATURES, SEGMENT_FEATURES

__all__ = ["CellFeatures", "nearest_opening", "space_feature_names"]

_FARTHEST_M = 10.0


def space_feature_names(ratios: Sequence[float], *, places: bool = False) -> tuple[str, ...]:
    """The names of the columns for some scales, and for places where there are any.

    Examples
    --------
    >>> names = space_feature_names((0.9, 0.75, 0.6))
    >>> len(names), names[:2], names[-1]
    (121, ('clearance', 'area[0.9]'), 'way_out_width[0.6]')
    >>> len(space_feature_names((0.9, 0.75, 0.6), places=True))
    167
    """
    groups = [(str(ratio), SEGMENT_FEATURES) for ratio in ratios]
    groups += [("place", PLACE_FEATURES)] if places else []
    columns = [(scale, spec) for scale, specs in groups for spec in (*specs, *CELL_FEATURES)]
    return ("clearance", *(f"{spec.id}[{scale}]" for scale, spec in columns))


@dataclass(frozen=True, eq=False)
class CellFeatures:
    """The features of any cell of a map, made when they are asked for.

    Parameters
    ----------
    divisions : tuple of Segments
        Scales, or places.
    tables : tuple of (S, F) float64
        The features of each division's segments.
    names : tuple of str
        The columns.

    Examples
    --------
    >>> from pgm_places.datasets import generate_building
    >>> grid = generate_building(size="small").grid
    >>> features = CellFeatures.of(Segmentation.of(grid))
    >>> features.lookup(np.argwhere(grid.free)[:5]).shape
    (5, 121)
    """

    divisions: tuple[Segments, ...]
    tables: tuple[NDArray[np.float64], ...]
    names: tuple[str, ...]

    @classmethod
    def of(cls, segmentation: Segmentation, places: Places | None = None) -> Self:
        """The features from all scales of a segmentation, and from its places if they are given."""
        tables = tuple(segment_features(scale) for scale in segmentation.scales)
        names = space_feature_names(segmentation.ratios, places=places is not None)
        if places is None:
            return cls(segmentation.scales, tables, names)
        return cls(
            (*segmentation.scales, places.segments), (*tables, place_features(places)), names
        )

    def lookup(self, cells_rc: ArrayLike) -> NDArray[np.float32]:
        """(n, F) features of cells (n, 2), row and column, in the order of ``names``.

        Of cells that lie in no segment the columns of that scale are 0, the distance to the
        nearest opening excepted, which is 10 m as wherever there is none.
        """
        cells = np.asarray(cells_rc)
        basin, clearance = self.divisions[0].watershed.at(cells)
        found = np.empty((len(cells), len(self.names)), np.float32)
        found[:, 0] = clearance
        first = 1
        for division, table in zip(self.divisions, self.tables, strict=True):
            segment = division.of_basins(basin)
            last = first + table.shape[1]
            found[:, first:last] = np.append(table, np.zeros((1, table.shape[1])), axis=0)[segment]
            radius = np.append(division.radius_m, np.inf)[segment]
            distance, width = nearest_opening(division, cells, segment)
            found[:, last : last + 3] = np.stack([clearance / radius, distance, width], axis=1)
            first = last + 3
        return found


def nearest_opening(
    division: Segments, cells_rc: ArrayLike, segment: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(n,) distance to the nearest opening of each cell's segment, and (n,) its half width.

    Metres; at most 10 m, and 0 wide where there is none. Openings are straight lines.
    """
    from pgm_places.spaces._lookup_kernels import nearest_openings

    openings, resolution_m = division.openings, division.watershed.grid.resolution_m
    ends = openings.segments.reshape(-1)
    order = np.argsort(ends, kind="stable")
    start = np.searchsorted(ends[order], np.arange(division.count + 1))
    half = (openings.length_m / resolution_m - 1) / 2
    cells = np.ascontiguousarray(cells_rc, np.int64)
    distance, width = np.empty(len(cells)), np.empty(len(cells))
    nearest_openings(
        cells,
        segment,
        start,
        order // 2,
        openings.centre_rc,
        openings.direction_rc * half[:, None],
        openings.half_width_m,
        distance,
        width,
    )
    return np.minimum(distance * resolution_m, _FARTHEST_M), width
