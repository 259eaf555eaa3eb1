"""The segments that the nodes of a map lie in, and which of them are ribbons."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pgm_places.maps.number_type import number_type
from pgm_places.spaces.segment_lookup import SegmentLookup
from pgm_places.spaces.space_spec import SEGMENT_FEATURES

__all__ = ["NodeSegments"]

_WIDEST_M, _SHORTEST_M, _ASPECT = 3.0, 3.0, 0.5


@dataclass(frozen=True, eq=False)
class NodeSegments:
    """Segments of the finest scale.

    Parameters
    ----------
    segment : (N,) int16 or int32
        The segment of each node, -1 for none.
    is_ribbon : (S,) bool
        Segments at most 3 m wide, at least 3 m long, and twice as long as wide: most are stretches
        of corridor, also where nothing is mapped beside them.
    """

    segment: NDArray[np.int16] | NDArray[np.int32]
    is_ribbon: NDArray[np.bool_]

    @classmethod
    def of(cls, lookup: SegmentLookup, basin: NDArray[np.int32]) -> Self:
        """The segments of nodes by their basins, from the lookup of the finest scale."""
        count = len(lookup.table) - 1
        number = np.where(lookup.segment_of == count, -1, lookup.segment_of)
        table = lookup.table[:-1]
        radius, aspect, length = (table[:, _COLUMNS.index(n)] for n in ("radius", "aspect", "long"))
        narrow = (2 * radius <= _WIDEST_M) & (length >= _SHORTEST_M)
        return cls(number.astype(number_type(count))[basin], narrow & (aspect <= _ASPECT))


_COLUMNS = [spec.id for spec in SEGMENT_FEATURES]
