"""Space features of cells, assembled from the features of their segments."""

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import integer_array
from pgm_places._core import write_features
from pgm_places.graph.layout import MaskCells
from pgm_places.kernels.threads import run_parts
from pgm_places.maps.components import number_type
from pgm_places.spaces.basins import clearance_m
from pgm_places.spaces.places import Places, place_features
from pgm_places.spaces.segment_features import segment_features
from pgm_places.spaces.segmentation import Segmentation, SpaceSegments
from pgm_places.spaces.space_spec import CELL_FEATURES, PLACE_FEATURES, SEGMENT_FEATURES

_WIDEST_M, _SHORTEST_M, _ASPECT = 3.0, 3.0, 0.5


_CELL_COLUMNS = 3  # columns of a cell in addition to its segment's: depth, way out, and its width


@dataclass(frozen=True, eq=False)
class SegmentLookup:
    """Lookup tables by segment, from which the features of cells are assembled.

    Cells outside all segments use an extra segment S with features 0 and no openings.
    """

    # (B + n_lines + 1,) segment of each basin and line; the last entry is for cells that are not
    # open
    segment_of: NDArray[np.int32]
    table: NDArray[np.float32]  # (S + 1, F) the segments' own features
    radius_m: NDArray[np.float64]  # (S + 1,)
    start: NDArray[np.int64]  # (S + 2,) start of the openings of each segment
    # (2 O, 5) openings as straight lines, grouped by segment: row and column of the midpoint and
    # half the line as a vector, in cells, and the half width in metres
    lines: NDArray[np.float64]
    resolution_m: float

    @classmethod
    def of(cls, division: SpaceSegments, table: NDArray[np.float64]) -> Self:
        """The lookup of a scale or of places, from the features (S, F) of its segments."""
        openings, resolution_m = division.openings, division.watershed.grid.resolution_m
        ends, count = openings.segments.reshape(-1), division.count
        order = np.argsort(ends, kind="stable")
        start = np.searchsorted(ends[order], np.arange(count + 2))
        half = openings.direction_rc * ((openings.length_m / resolution_m - 1) / 2)[:, None]
        lines = np.column_stack([openings.centre_rc, half, openings.half_width_m])
        segment_of = np.append(division.segment_of, -1)
        return cls(
            np.where(segment_of < 0, count, segment_of).astype(np.int32),
            np.append(table, np.zeros((1, table.shape[1])), axis=0).astype(np.float32),
            np.append(division.radius_m, np.inf),
            start.astype(np.int64),
            np.ascontiguousarray(lines[order // 2], np.float64),
            resolution_m,
        )

    @property
    def n_columns(self) -> int:
        """F + 3: the columns of the segment, and three of the cell."""
        return self.table.shape[1] + _CELL_COLUMNS


@dataclass(frozen=True, eq=False)
class Lookups:
    """The lookups of several divisions: all columns of cells, the clearance first.

    They do not hold rasters of the map.
    """

    parts: tuple[SegmentLookup, ...]

    def write(
        self,
        cells_rc: NDArray[np.int32],
        basin: NDArray[np.int32],
        clearance_m: NDArray[np.float64],
        columns: NDArray[np.int64],
        out: NDArray[np.float32],
        first: int = 0,
    ) -> None:
        """Write columns of cells (n, 2) to ``out[:, first:first + F]``."""
        out[:, first + np.flatnonzero(columns == 0)] = clearance_m[:, None]
        start = 1
        for part in self.parts:
            places = np.flatnonzero((columns >= start) & (columns < start + part.n_columns))
            if len(places):
                write_features(
                    cells_rc,
                    part.segment_of[basin],
                    clearance_m,
                    part.table,
                    part.radius_m,
                    part.start,
                    part.lines,
                    part.resolution_m,
                    columns[places] - start,
                    first + places,
                    out,
                )
            start += part.n_columns


# Cells that one thread looks up at a time, few enough for its data to stay in cache.
_CELLS_PER_TASK = 8192


@cache
def space_feature_names(ratios: tuple[float, ...], *, places: bool = False) -> tuple[str, ...]:
    """The names of the columns for the given scales and, optionally, for places.

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
    """The features of any cell of a map, computed on demand."""

    divisions: tuple[SpaceSegments, ...]  # scales, or places
    tables: tuple[NDArray[np.float64], ...]  # the features of each division's segments
    names: tuple[str, ...]  # the columns

    @classmethod
    def of(cls, segmentation: Segmentation, places: Places | None = None) -> Self:
        """The features from all scales of a segmentation and, if given, from its places."""
        ends = np.cumsum([scale.count for scale in segmentation.scales])
        tables = tuple(np.split(segment_features(*segmentation.scales), ends[:-1]))
        names = space_feature_names(segmentation.ratios, places=places is not None)
        if places is None:
            return cls(segmentation.scales, tables, names)
        return cls(
            (*segmentation.scales, places.segments), (*tables, place_features(places)), names
        )

    def lookup(self, cells_rc: ArrayLike, columns: ArrayLike | None = None) -> NDArray[np.float32]:
        """(n, F) features of cells for ``columns``, by default all of ``names``.

        For cells outside all segments of a scale, the columns of that scale are 0, except for the
        distance to the nearest opening, which is 10 m. Openings are treated as straight lines.

        ``cells_rc`` (n, 2): row and column. Consecutive cells of a row are fastest. ``columns``
        (F,): indices into ``names``.

        InputError: if a cell lies outside the map or a column does not exist.
        """
        n_all, watershed = len(self.names), self.divisions[0].watershed
        chosen = range(n_all) if columns is None else columns
        indices = integer_array("columns", chosen, ("F",), low=0, high=n_all)
        cells = watershed.checked(cells_rc)
        features = np.empty((len(cells), len(indices)), np.float32)

        def take(some: slice) -> None:
            self.lookups.write(cells[some], *watershed.read(cells[some]), indices, features[some])

        run_parts(take, len(cells), _CELLS_PER_TASK)
        return features

    @cached_property
    def lookups(self) -> Lookups:
        """The same features for cells whose basin and clearance are known."""
        both = zip(self.divisions, self.tables, strict=True)
        return Lookups(tuple(SegmentLookup.of(*item) for item in both))


@dataclass(frozen=True, eq=False)
class NodeSegments:
    """Segments of the finest scale."""

    segment: NDArray[np.int16] | NDArray[np.int32]  # (N,) the segment of each node, -1 for none
    # (S,) segments at most 3 m wide, at least 3 m long, and twice as long as wide: mostly parts of
    # corridors, also in incomplete maps
    is_ribbon: NDArray[np.bool_]
    is_wide: NDArray[np.bool_]  # (S,) segments in which a disc of 1.5 m radius fits

    @classmethod
    def of(cls, lookup: SegmentLookup, basin: NDArray[np.int32]) -> Self:
        """The segments of nodes by their basins, from the lookup of the finest scale."""
        count = len(lookup.table) - 1
        number = np.where(lookup.segment_of == count, -1, lookup.segment_of)
        table = lookup.table[:-1]
        radius, aspect, length = (table[:, _COLUMNS.index(n)] for n in ("radius", "aspect", "long"))
        narrow = (2 * radius <= _WIDEST_M) & (length >= _SHORTEST_M)
        segment = number.astype(number_type(count))[basin]
        return cls(segment, narrow & (aspect <= _ASPECT), radius >= _WIDEST_M / 2)


_COLUMNS = [spec.id for spec in SEGMENT_FEATURES]


@dataclass(frozen=True, eq=False)
class NodeFeatures:
    """The features of :class:`CellFeatures` at the nodes of a map.

    It stores basins and heights of the nodes only, not the map's rasters, half of which are walls
    and unknown space; on a huge map that saves half a gigabyte.
    """

    cells: MaskCells  # the nodes
    basin: NDArray[np.int32]  # (N,) basin of each node, -1 for none
    relief: NDArray[np.int32]  # (N,) height of each node
    lookups: Lookups
    resolution_m: float

    @classmethod
    def of(cls, features: CellFeatures, cells: MaskCells) -> Self:
        """The features of the nodes of a map, from the features of its cells."""
        watershed = features.divisions[0].watershed
        basin = watershed.basins.raster[1:-1, 1:-1][cells.mask]
        relief = watershed.relief[1:-1, 1:-1][cells.mask]
        return cls(cells, basin, relief, features.lookups, watershed.grid.resolution_m)

    @property
    def segments(self) -> NodeSegments:
        """The segments of the finest scale that contain the nodes."""
        return NodeSegments.of(self.lookups.parts[0], self.basin)

    def write(
        self,
        nodes: NDArray[np.int64],
        columns: NDArray[np.int64],
        out: NDArray[np.float32],
        first: int = 0,
    ) -> None:
        """Write columns of some nodes to ``out[:, first:first + F]``, C-contiguous."""
        clearance = clearance_m(self.relief[nodes], self.resolution_m)
        self.lookups.write(self.cells[nodes], self.basin[nodes], clearance, columns, out, first)
