"""The pixels of a map's image as cells, and what about them looks wrong."""

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.graph.bands import bands_of_rows
from pgm_places.io.maps.pixel_rules import PixelRules, grey_of
from pgm_places.io.maps.raster_image import RasterImage
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN
from pgm_places.options import UnknownGrey

__all__ = [
    "FREE_GREY",
    "FREE_THRESH",
    "OCCUPIED_GREY",
    "OCCUPIED_THRESH",
    "UNKNOWN_GREY",
    "Fractions",
    "MapPixels",
]

# The grey values that map savers write, and the thresholds that tell them apart (Nav2 and ROS 1).
FREE_GREY, UNKNOWN_GREY, OCCUPIED_GREY = 254, 205, 0
FREE_THRESH, OCCUPIED_THRESH = 0.196, 0.65
# A smaller share of pixels with grey 205 is edges of walls, not the outside of a building.
_MANY = 0.01
# Grey 205 stands alone where greys this near hold less than this share of its pixels: a picture
# with many shades has as many of each, while a line that an editor has smoothed has a few.
_NEAR, _FEW = 10, 0.01
_UNDECIDED = 1
"""Stands for grey 205 among the cells until all pixels have been counted."""


class Fractions(NamedTuple):
    """Shares of a map's cells; they sum to 1."""

    free: float
    occupied: float
    unknown: float


@dataclass
class MapPixels:
    """The decoded image in grid order, with counts of what was seen.

    Parameters
    ----------
    cells : (H, W) int8
        Free, occupied or unknown; row 0 is the bottom of the image.
    occupancy : (H, W) int8 or None
        As map_server would publish it; None where that is ``cells``.
    grey_counts : (256,) int64
        Opaque pixels of each grey value.
    rules : PixelRules
        By which they were read.
    unknown_value : int, "none" or None
        The grey that was read as unknown in any case; 205 where it was found to be meant so.
    is_meant : bool
        Whether nobody but the picture says that grey 205 is unknown.
    is_lossy : bool
        Whether the image's compression changes greys.
    """

    cells: NDArray[np.int8]
    occupancy: NDArray[np.int8] | None
    grey_counts: NDArray[np.int64]
    rules: PixelRules
    unknown_value: UnknownGrey | None
    is_meant: bool
    is_lossy: bool

    @classmethod
    def read(
        cls, image: RasterImage, rules: PixelRules, unknown_value: UnknownGrey | None
    ) -> "MapPixels":
        """The pixels of an image; ``unknown_value`` is that of ``load_map``."""
        height, width = image.shape
        cells = np.empty((height, width), np.int8)
        occupancy = None if rules.mode == "trinary" else np.empty((height, width), np.int8)
        counts = np.zeros(256, np.int64)
        asks = unknown_value is None and rules.mode == "trinary"
        for row, channels, alpha in image.strips():
            grey = grey_of(channels)
            values, kinds = rules.read(channels, alpha)
            if isinstance(unknown_value, int):
                values[grey == unknown_value] = UNKNOWN
                kinds[grey == unknown_value] = UNKNOWN
            elif asks:
                kinds[(grey == UNKNOWN_GREY) & (kinds == FREE)] = _UNDECIDED
            # row 0 of the image is the top, row 0 of the grid the bottom
            rows = slice(height - row - len(grey), height - row)
            cells[rows] = kinds[::-1]
            if occupancy is not None:
                occupancy[rows] = values[::-1]
            counts += np.bincount(
                (grey if alpha is None else grey[alpha == 255]).ravel(), minlength=256
            )
        is_meant = asks and rules.is_free(UNKNOWN_GREY) and _stands_alone(counts)
        if asks:
            for rows in bands_of_rows((height, width)):
                cells[rows][cells[rows] == _UNDECIDED] = UNKNOWN if is_meant else FREE
        cells.setflags(write=False)
        chosen = UNKNOWN_GREY if is_meant else unknown_value
        return cls(cells, occupancy, counts, rules, chosen, is_meant, image.is_lossy)

    @property
    def fractions(self) -> Fractions:
        """Shares of the cells."""
        n_free = int(np.count_nonzero(self.cells == FREE))
        n_occupied = int(np.count_nonzero(self.cells == OCCUPIED))
        size = self.cells.size
        return Fractions(n_free / size, n_occupied / size, (size - n_free - n_occupied) / size)

    def suspicions(self, yaml_path: Path) -> list[str]:
        """What looks wrong: grey 205 read as free, noise, nothing free, no walls."""
        found = [*self._of_grey_205(yaml_path), *self._of_noise()]
        shares = self.fractions
        if shares.free == 0:
            found.append(
                "no cell is free, so there is nothing to label; check negate and the thresholds"
            )
        elif shares.occupied == 0:
            found.append(
                "no cell is occupied: a map without walls; check negate and the thresholds"
            )
        elif shares.occupied > max(0.5, shares.free):
            found.append(
                f"{100 * shares.occupied:.0f} % of the cells are occupied, more than are free; "
                "check negate and the thresholds"
            )
        return found

    def _of_grey_205(self, yaml_path: Path) -> list[str]:
        share = float(self.grey_counts[UNKNOWN_GREY]) / self.cells.size
        start = (
            f"{100 * share:.1f} % of the pixels have grey {UNKNOWN_GREY}, which map savers write "
            "for unknown"
        )
        free_thresh = f"free_thresh {self.rules.free_thresh:g}"
        if self.is_meant:
            return [
                f"{start}: read as unknown, although {free_thresh} says free (50/255 = 0.196). "
                f"'pgm-places doctor {yaml_path.name} --fix' corrects the file; if free is meant, "
                'pass unknown_value = "none" (--unknown-value none)'
            ]
        if share >= _MANY and self.rules.is_free(UNKNOWN_GREY) and self.unknown_value is None:
            return [
                f"{start}, but {free_thresh} reads it as free (50/255 = 0.196). If it means "
                f"unknown, set free_thresh: {FREE_THRESH} in {yaml_path.name}, or force it with "
                f"unknown_value = {UNKNOWN_GREY} (--unknown-value {UNKNOWN_GREY})"
            ]
        return []

    def _of_noise(self) -> list[str]:
        if not self.is_lossy:
            return []
        saved = [OCCUPIED_GREY, UNKNOWN_GREY, FREE_GREY, 255]
        share = 1 - float(self.grey_counts[saved].sum()) / self.cells.size
        return [
            f"the picture is a JPEG, whose noise changes greys ({100 * share:.1f} % of the pixels "
            f"have none of {', '.join(map(str, saved))}): specks of free cells may appear in "
            "unknown space, and walls may break or thicken; save the map as PNG or PGM anew, from "
            "where it was made"
        ]


def _stands_alone(counts: NDArray[np.int64]) -> bool:
    """Whether grey 205 is one of the three that map savers write, and no shade among others."""
    n_near = int(counts[UNKNOWN_GREY - _NEAR : UNKNOWN_GREY + _NEAR + 1].sum())
    n_near -= int(counts[UNKNOWN_GREY])
    others = counts[OCCUPIED_GREY] > 0 and counts[FREE_GREY] > 0
    return bool(others and n_near < _FEW * counts[UNKNOWN_GREY])
