"""The features of divisions, laid out for looking up many cells."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pgm_places._core import write_features
from pgm_places.spaces.segmentation import Segments

_CELL_COLUMNS = 3
"""What a cell adds to the columns of its segment: depth, way out, and the way out's width."""


@dataclass(frozen=True, eq=False)
class SegmentLookup:
    """The parts that a cell's features are assembled from, by segment.

    Cells outside all segments use an extra segment S with features 0 and no openings.

    Parameters
    ----------
    segment_of : (B + n_lines + 1,) int32
        Segment of each basin and line; the last entry is for cells that are not open.
    table : (S + 1, F) float32
        The segments' own features.
    radius_m : (S + 1,) float64
    start : (S + 2,) int64
        Start of the openings of each segment.
    lines : (2 O, 5) float64
        Openings as straight lines, grouped by segment: row and column of the midpoint and half
        the line as a vector, in cells, and the half width in metres.
    resolution_m : float
    """

    segment_of: NDArray[np.int32]
    table: NDArray[np.float32]
    radius_m: NDArray[np.float64]
    start: NDArray[np.int64]
    lines: NDArray[np.float64]
    resolution_m: float

    @classmethod
    def of(cls, division: Segments, table: NDArray[np.float64]) -> Self:
        """The lookup of a scale, or of places, with the features (S, F) of its segments."""
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
        """F + 3: the columns of the segment, and the three that a cell adds."""
        return self.table.shape[1] + _CELL_COLUMNS


@dataclass(frozen=True, eq=False)
class Lookups:
    """The lookups of several divisions: all columns of cells, the clearance first.

    Nothing here holds the rasters of the map.

    Parameters
    ----------
    parts : tuple of SegmentLookup
    """

    parts: tuple[SegmentLookup, ...]

    @property
    def n_columns(self) -> int:
        """The columns of all divisions, and the clearance."""
        return 1 + sum(part.n_columns for part in self.parts)

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
