"""Features of cells from the segments they are in, looked up one chunk of cells at a time."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import integer_array
from pgm_places.kernels.threads import run_tasks
from pgm_places.spaces.places import Places, place_features
from pgm_places.spaces.segment_features import segment_features
from pgm_places.spaces.segment_lookup import Lookups, SegmentLookup
from pgm_places.spaces.segmentation import Segmentation, Segments
from pgm_places.spaces.space_spec import CELL_FEATURES, PLACE_FEATURES, SEGMENT_FEATURES

_CELLS_PER_TASK = 8192
"""Cells that one thread looks up at a time, few enough for its data to stay in cache."""


def space_feature_names(ratios: Sequence[float], *, places: bool = False) -> tuple[str, ...]:
    """The names of the columns for the given scales and, optionally, for places.

    Examples
    --------
    >>> names = space_feature_names((0.9, 0.75, 0.6))
    >>> len(names), names[:2], names[-1]
    (121, ('clearance', 'area[0.9]'), 'way_out_width[0.6]')
    >>> len(space_feature_names((0.9, 0.75, 0.6), places=True))
    167
    """
    return _names(tuple(ratios), places)


@cache
def _names(ratios: tuple[float, ...], places: bool) -> tuple[str, ...]:
    groups = [(str(ratio), SEGMENT_FEATURES) for ratio in ratios]
    groups += [("place", PLACE_FEATURES)] if places else []
    columns = [(scale, spec) for scale, specs in groups for spec in (*specs, *CELL_FEATURES)]
    return ("clearance", *(f"{spec.id}[{scale}]" for scale, spec in columns))


@dataclass(frozen=True, eq=False)
class CellFeatures:
    """The features of any cell of a map, computed on demand.

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
        """The features from all scales of a segmentation and, if given, from its places."""
        ends = np.cumsum([scale.count for scale in segmentation.scales])
        tables = tuple(np.split(segment_features(*segmentation.scales), ends[:-1]))
        names = space_feature_names(segmentation.ratios, places=places is not None)
        if places is None:
            return cls(segmentation.scales, tables, names)
        return cls(
            (*segmentation.scales, places.segments), (*tables, place_features(places)), names
        )

    def lookup(
        self,
        cells_rc: ArrayLike,
        columns: ArrayLike | None = None,
        *,
        n_threads: int | None = None,
    ) -> NDArray[np.float32]:
        """(n, F) features of cells: those of ``columns``, by default all of ``names``.

        For cells outside all segments of a scale, the columns of that scale are 0, except for the
        distance to the nearest opening, which is 10 m. Openings are treated as straight lines.

        Parameters
        ----------
        cells_rc : (n, 2) int
            Row and column. Consecutive cells of a row are fastest.
        columns : (F,) int, optional
            Indices into ``names``.
        n_threads : int, optional
            All cores by default; the results are bit-identical for any number.

        Raises
        ------
        InputError
            If a cell lies outside the map or a column does not exist.
        """
        n_all, watershed = len(self.names), self.divisions[0].watershed
        chosen = range(n_all) if columns is None else columns
        indices = integer_array("columns", chosen, ("F",), low=0, high=n_all)
        cells = watershed.checked(cells_rc)
        features = np.empty((len(cells), len(indices)), np.float32)

        def take(task: int) -> None:
            some = slice(task * _CELLS_PER_TASK, (task + 1) * _CELLS_PER_TASK)
            self.lookups.write(cells[some], *watershed.read(cells[some]), indices, features[some])

        run_tasks(take, -(-len(cells) // _CELLS_PER_TASK), n_threads=n_threads)
        return features

    @cached_property
    def lookups(self) -> Lookups:
        """The same features for cells whose basin and clearance are known."""
        both = zip(self.divisions, self.tables, strict=True)
        return Lookups(tuple(SegmentLookup.of(*item) for item in both))
