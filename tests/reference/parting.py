"""Doorways drawn across regions, slow and obvious: all parts found anew for every chord."""

import numpy as np
from scipy import ndimage

from pgm_places.topology.chords import Chord, shortest_chords
from tests.reference.topology import flood_fill

EIGHT = np.ones((3, 3), bool)


def band(chord: Chord, reach: float, shape: tuple[int, int]) -> tuple[slice, slice, np.ndarray]:
    """Rows, columns and mask of the cells of a raster at most ``reach`` from a chord."""
    ends = np.array([chord.start_rc, chord.end_rc])
    low = np.clip(np.floor(ends.min(axis=0) - reach), 0, shape).astype(int)
    high = np.clip(np.ceil(ends.max(axis=0) + reach) + 1, low, shape).astype(int)
    rows, columns = slice(low[0], high[0]), slice(low[1], high[1])
    y, x = np.mgrid[rows, columns]
    offset = np.stack([y, x], axis=-1) - ends[0]
    along = ends[1] - ends[0]
    share = np.clip(offset @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
    away = offset - share[..., None] * along
    return rows, columns, (away**2).sum(axis=-1) <= reach**2


class SlowParting:
    """Labels that doorways are drawn into, and the regions as they were."""

    def __init__(self, labels: np.ndarray, doorway: int, reach: float, least_cells: int) -> None:
        self.labels, self.doorway = labels.copy(), doorway
        self.blocked = labels < 0
        self.reach, self.least_cells = reach, least_cells
        # Of two regions with as many cells in a gap, the one that is met first is split.
        self.piece = flood_fill(np.where(labels == doorway, -1, labels), 8)

    def draw(
        self, cells_rc: np.ndarray, longest: float
    ) -> tuple[Chord, np.ndarray, int, list[int]] | None:
        """The first chord that leaves two parts, its cells, their piece, the two largest sizes."""
        for chord in shortest_chords(self.blocked, cells_rc, longest):
            gap = self._gap(chord)
            if gap.any():
                piece = int(np.bincount(self.piece[gap]).argmax())
                sizes = self._sizes(piece, gap)
                if len(sizes) > 1 and sizes[1] >= self.least_cells:
                    self.labels[gap] = self.doorway
                    return chord, np.argwhere(gap), piece, sizes[:2]
        return None

    def _gap(self, chord: Chord) -> np.ndarray:
        near = np.zeros(self.labels.shape, bool)
        rows, columns, near_chord = band(chord, self.reach, self.labels.shape)
        near[rows, columns] = near_chord
        near &= ~self.blocked
        cells = np.argwhere(near)
        if not len(cells):
            return near
        home = cells[((cells - chord.middle) ** 2).sum(axis=1).argmin()]
        parts, _ = ndimage.label(near, EIGHT)
        return (parts == parts[tuple(home)]) & (self.labels != self.doorway)

    def _sizes(self, piece: int, gap: np.ndarray) -> list[int]:
        left = (self.piece == piece) & (self.labels != self.doorway) & ~gap
        parts, count = ndimage.label(left, EIGHT)
        beside = ndimage.binary_dilation(gap, EIGHT)
        touching = [part for part in range(1, count + 1) if (beside & (parts == part)).any()]
        return sorted((int((parts == part).sum()) for part in touching), reverse=True)
