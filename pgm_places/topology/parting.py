"""Regions divided by doorways that are drawn across them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places.maps.components import connected_components
from pgm_places.topology._parting_kernels import (
    Candidates,
    Doorways,
    Drawing,
    Floor,
    Room,
    part_regions,
)
from pgm_places.topology.chords import Chord, chord_directions

__all__ = ["Parting", "Split"]

DOORWAY_DEPTH_M = 0.3
"""Depth of a doorway drawn across a passage, within the range of hand-made labels."""


@dataclass(frozen=True, eq=False)
class Split:
    """A place where a doorway could split a region in two.

    Parameters
    ----------
    chord : Chord
        From wall to wall across the narrowest point.
    cells : (n, 2) int64
        Row and column of the cells that would be the doorway.
    label : int
        Label of the region.
    areas_m2 : (float, float)
        Areas of the larger and the smaller part.
    """

    chord: Chord
    cells: NDArray[np.int64]
    label: int
    areas_m2: tuple[float, float]


class Parting:
    """Labels that doorways are drawn into if they split a region in two.

    Parameters
    ----------
    labels : (H, W) int16
        Label per cell, -1 for none.
    doorway : int
        The label that is drawn.
    resolution_m : float
    min_part_m2 : float
        Minimum area of both parts.

    Attributes
    ----------
    labels : (H, W) int16
        A copy of the labels, with the doorways drawn so far.
    pieces : Components
        The regions other than doorways, as they were.
    """

    def __init__(
        self, labels: NDArray[np.int16], doorway: int, resolution_m: float, min_part_m2: float
    ) -> None:
        self.blocked = labels < 0
        self.doorway, self.resolution_m, self.min_part_m2 = doorway, resolution_m, min_part_m2
        self.pieces = connected_components(np.where(labels == doorway, np.int16(-1), labels))
        piece = self.pieces.piece.ravel()
        size = np.empty(max(labels.size, 1), np.int64)  # there is a cell in every part
        size[: self.pieces.count] = self.pieces.size
        parts = np.array([self.pieces.count])
        self._floor = Floor(labels.copy(), piece, piece.copy(), size, parts)

    @property
    def labels(self) -> NDArray[np.int16]:
        """(H, W) the labels with the doorways drawn so far."""
        found: NDArray[np.int16] = self._floor.labels
        return found

    def draw(
        self, cells: NDArray[np.int64], start: NDArray[np.int64], longest: float
    ) -> list[Split]:
        """Draw, for each candidate, the shortest chord that splits a region, if one does.

        Parameters
        ----------
        cells : (n,) int64
            Cells that a candidate's chords go through, numbered row by row.
        start : (M + 1,) int64
            Where the cells of each candidate begin, and where the last ones end.
        longest : float
            Longest chord to look for, in cells.
        """
        # With 0.75 cells on both sides, no step between cells, even a diagonal one, crosses it.
        reach = max(0.75, DOORWAY_DEPTH_M / self.resolution_m / 2)
        most, n_cells = len(start) - 1, self.blocked.size
        found = Doorways(
            np.empty((most, 4)),
            np.empty(most, np.int32),
            np.empty((most, 2), np.int64),
            np.empty(most, np.int64),
            np.empty(n_cells, np.int64),  # pages are only touched as far as it is used
        )
        rows, columns = np.divmod(cells, self.blocked.shape[1])
        count = part_regions(
            self._floor,
            _room(n_cells, longest + 2 * reach),
            self.blocked,
            Candidates(start, rows, columns, chord_directions(), float(longest)),
            Drawing(self.doorway, reach, self.resolution_m**2, float(self.min_part_m2)),
            found,
        )
        drawn = np.split(
            found.cells[: found.stop[count - 1] if count else 0], found.stop[: max(count - 1, 0)]
        )
        return [
            Split(
                Chord((y0, x0), (y1, x1)),
                np.stack(np.divmod(gap, self.blocked.shape[1]), axis=1),
                int(self.pieces.label[piece]),
                (larger, smaller),
            )
            for (y0, x0, y1, x1), gap, piece, (larger, smaller) in zip(
                found.ends[:count].tolist(),
                drawn[:count],
                found.piece[:count],
                (found.sizes[:count] * self.resolution_m**2).tolist(),
                strict=True,
            )
        ]


def _room(n_cells: int, across: float) -> Room:
    """What the kernel works in, for gaps whose cells lie within a square ``across``."""
    side = min(across + 4, float(n_cells))  # a width of 1e300 has no square
    gap = int(min(n_cells, side**2))
    waters = 8 * gap + 1  # around each cell of the gap
    return Room(
        mark=np.zeros(n_cells, np.int32),
        queue=np.empty(n_cells, np.int64),
        gap=np.empty(gap, np.int64),
        parent=np.empty(waters, np.int32),
        cells=np.empty(waters, np.int64),
        spreading=np.empty(waters, np.int64),
        place=np.empty(waters, np.int32),
        fresh=np.empty(waters, np.int32),
        touched=np.empty(waters + gap, np.int32),
        region=np.empty(waters + gap, np.int32),
        lost=np.empty(waters + gap, np.int64),
        waters=np.empty(waters + gap, np.int64),
        left=np.empty(waters + gap, np.int64),
    )
