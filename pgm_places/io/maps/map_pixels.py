"""Conversion of a map image's pixels to cells, by the rules of its YAML file, with warnings."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pgm_places.graph.bands import bands_of_rows
from pgm_places.io.maps.raster_image import RasterImage
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN
from pgm_places.options import UnknownGrey

Mode: TypeAlias = Literal["trinary", "scale", "raw"]

Compat: TypeAlias = Literal["nav2", "ros1"]

# Rec. 709 luma of gamma-coded channels: the grey conversion of ImageMagick, which Nav2 uses.
_LUMA = np.array([0.212656, 0.715158, 0.072186])


def grey_of(channels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(h, W) grey values of (h, W, C) channels: Rec. 709 luma of colours, rounded to 8 bits.

    ``0.212656 R + 0.715158 G + 0.072186 B``; equal channels keep their value.
    """
    if channels.shape[2] == 1:
        return channels[:, :, 0]
    return np.asarray(np.floor(channels @ _LUMA + 0.5), np.uint8)


@dataclass(frozen=True)
class PixelRules:
    """The keys of a map description that define the meaning of its pixels.

    Mode ``trinary``: occupied, free or unknown by the thresholds on the probability of an occupied
    cell; ``scale``: as trinary, but values between the thresholds become 1 to 99; ``raw``: the grey
    value is the occupancy. With ``negate``, black is free. ``compat``: current Nav2 or ROS 1.
    """

    mode: Mode
    negate: bool
    free_thresh: float
    occupied_thresh: float
    compat: Compat = "nav2"

    def read(
        self, channels: NDArray[np.uint8], alpha: NDArray[np.uint8] | None
    ) -> tuple[NDArray[np.int8], NDArray[np.int8]]:
        """(h, W) occupancy, 0 to 100 or -1, and (h, W) cells of (h, W, C) channels.

        Occupancy is as map_server publishes it. The cells are ``FREE``, ``OCCUPIED`` or
        ``UNKNOWN``: in mode trinary by occupancy; in mode scale by the rules of trinary; in mode
        raw by the file's thresholds on ``occupancy / 100``, as map savers convert such maps.
        """
        levels: NDArray[np.integer]
        levels, n_channels = grey_of(channels), 1
        if self.compat == "ros1":
            levels, n_channels = self._ros1_levels(channels, alpha)
        occupancy_table, cells_table = self.tables(n_channels)
        occupancy = occupancy_table[levels]
        cells = occupancy if self.mode == "trinary" else cells_table[levels]
        if alpha is not None and self.compat == "nav2" and self.mode != "raw":
            occupancy[alpha < 255] = UNKNOWN
            cells[alpha < 255] = UNKNOWN
        elif alpha is not None and self.mode == "scale":
            occupancy[(alpha == 0) & (cells == UNKNOWN)] = UNKNOWN
        return occupancy, cells

    def is_free(self, grey: int) -> bool:
        """Whether cells of a grey are free by the thresholds."""
        return bool(self.tables()[1][grey] == FREE)

    def tables(self, n_channels: int = 1) -> tuple[NDArray[np.int8], NDArray[np.int8]]:
        """(255 C + 1,) occupancy and cells of each brightness, 0 (black) to 255 C (white)."""
        make = self._ros1_table if self.compat == "ros1" else self._nav2_table
        occupancy = make(self.mode, n_channels)
        if self.mode != "raw":
            return occupancy, make("trinary", n_channels)
        cells = np.full(occupancy.shape, UNKNOWN, np.int8)
        cells[occupancy >= np.rint(100 * self.occupied_thresh)] = OCCUPIED
        low = np.rint(100 * self.free_thresh)
        cells[(occupancy != UNKNOWN) & (occupancy <= low)] = FREE
        return occupancy, cells

    def _nav2_table(self, mode: Mode, n_channels: int) -> NDArray[np.int8]:
        """``p = 1 - grey / 255`` (``grey / 255`` with negate) in single precision.

        ``p <= free_thresh`` is free, else ``p >= occupied_thresh`` occupied; scale rounds half up.
        Raw mode ignores negate.
        """
        level = np.arange(255 * n_channels + 1)
        if mode == "raw":
            return np.where(level <= OCCUPIED, level, UNKNOWN).astype(np.int8)
        p = level.astype(np.float32) / np.float32(255)
        if not self.negate:
            p = np.float32(1) - p
        low, high = np.float32(self.free_thresh), np.float32(self.occupied_thresh)
        table = np.full(p.shape, UNKNOWN, np.float32)
        if mode == "scale":
            width = np.float32(self.occupied_thresh - self.free_thresh)
            table = np.floor((p - low) / width * np.float32(100) + np.float32(0.5))
        table = np.where(p >= high, np.float32(OCCUPIED), table)
        return np.where(p <= low, np.float32(FREE), table).astype(np.int8)

    def _ros1_levels(
        self, channels: NDArray[np.uint8], alpha: NDArray[np.uint8] | None
    ) -> tuple[NDArray[np.int64], int]:
        """(h, W) sums of channels and their number; in trinary mode alpha is one of them."""
        total = channels.sum(axis=2, dtype=np.int64)
        n_channels = channels.shape[2]
        if alpha is None:
            return total, n_channels
        total *= 3 // n_channels  # the image library hands grey with alpha on as red, green, blue
        return (total + alpha, 4) if self.mode == "trinary" else (total, 3)

    def _ros1_table(self, mode: Mode, n_channels: int) -> NDArray[np.int8]:
        """Double precision on the mean of the channels; strict comparisons; scale truncates."""
        mean = np.arange(255 * n_channels + 1) / n_channels
        if self.negate:
            mean = 255 - mean
        if mode == "raw":
            return np.where(mean <= OCCUPIED, np.trunc(mean), UNKNOWN).astype(np.int8)
        p = (255 - mean) / 255
        table = np.full(p.shape, float(UNKNOWN))
        if mode == "scale":
            width = self.occupied_thresh - self.free_thresh
            table = np.trunc(99 * (p - self.free_thresh) / width)
        table = np.where(p < self.free_thresh, float(FREE), table)
        return np.where(p > self.occupied_thresh, float(OCCUPIED), table).astype(np.int8)


# The grey values of map savers, and the thresholds between them (Nav2 and ROS 1).
FREE_GREY, UNKNOWN_GREY, OCCUPIED_GREY = 254, 205, 0

FREE_THRESH, OCCUPIED_THRESH = 0.196, 0.65

NO_WALLS = "no cell is occupied: a map without walls; check negate and the thresholds"

# A smaller share of pixels with grey 205 means edges of walls, not the outside of a building.
_MANY = 0.01

# Grey 205 is isolated if greys within this distance have less than this share of its pixels: in a
# picture with many shades all are frequent, while smoothed lines give only a few pixels.
_NEAR, _FEW = 10, 0.01

# A grey with at least this share of the pixels is deliberate.
_OFTEN = 0.05

_UNDECIDED = 1
"""Marks cells of grey 205 until all pixels have been counted."""


class Fractions(NamedTuple):
    """Shares of a map's cells; they sum to 1."""

    free: float
    occupied: float
    unknown: float

    @classmethod
    def of(cls, cells: NDArray[np.int8]) -> "Fractions":
        """The shares of cells (H, W)."""
        n_free = int(np.count_nonzero(cells == FREE))
        n_occupied = int(np.count_nonzero(cells == OCCUPIED))
        size = cells.size
        return cls(n_free / size, n_occupied / size, (size - n_free - n_occupied) / size)


@dataclass
class MapPixels:
    """The decoded cells (H, W) in grid order, with counts (256,) of opaque pixels of each grey.

    ``occupancy`` as map_server publishes it, None if equal to ``cells``. ``unknown_value``: the
    grey read as unknown regardless of thresholds; ``is_meant`` if the image alone decided it.
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
        """The pixels of an image; ``unknown_value`` as in ``load_map``."""
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

    def suspicions(self, yaml_path: Path) -> list[str]:
        """Warnings: grey 205 read as free, JPEG noise, no free cells, no walls."""
        lines = [*self._of_grey_205(yaml_path), *self._of_second_grey(), *self._of_noise()]
        shares = Fractions.of(self.cells)
        if shares.free == 0:
            lines.append(
                "no cell is free, so there is nothing to label; check negate and the thresholds"
            )
        elif shares.occupied == 0:
            lines.append(NO_WALLS)
        elif shares.occupied > max(0.5, shares.free):
            lines.append(
                f"{100 * shares.occupied:.0f} % of the cells are occupied, more than are free; "
                "check negate and the thresholds"
            )
        return lines

    def _of_grey_205(self, yaml_path: Path) -> list[str]:
        share = float(self.grey_counts[UNKNOWN_GREY]) / self.cells.size
        start = (
            f"{100 * share:.1f} % of the pixels have grey {UNKNOWN_GREY}, which map savers write "
            "for unknown"
        )
        free_thresh = f"free_thresh {self.rules.free_thresh:g}"
        if self.is_meant:
            return [
                f"{start}: read as unknown, although by {free_thresh} it is free (50/255 = 0.196). "
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

    def _of_second_grey(self) -> list[str]:
        """A warning of a second frequent grey that reads as free: it may mean unknown."""
        if self.unknown_value is not None or self.rules.mode != "trinary":
            return []
        free = np.flatnonzero(self.rules.tables()[1] == FREE)
        share = self.grey_counts / self.cells.size
        often = free[share[free] >= _OFTEN]
        if len(often) < 2:
            return []
        freest = int(often.min() if self.rules.negate else often.max())
        others = [g for g in often.tolist() if abs(g - freest) > _NEAR and g != UNKNOWN_GREY]
        alone = [g for g in others if _stands_out(self.grey_counts, g)]
        if not alone:
            return []
        grey = max(alone, key=lambda g: share[g])
        return [
            f"{100 * share[grey]:.0f} % of the pixels have grey {grey} and read as free, as grey "
            f"{freest} does. If grey {grey} means unknown, pass unknown_value = {grey} "
            f"(--unknown-value {grey})"
        ]

    def _of_noise(self) -> list[str]:
        if not self.is_lossy:
            return []
        saved = [OCCUPIED_GREY, UNKNOWN_GREY, FREE_GREY, 255]
        share = 1 - float(self.grey_counts[saved].sum()) / self.cells.size
        return [
            f"the picture is a JPEG, whose noise changes greys ({100 * share:.1f} % of the pixels "
            f"have none of {', '.join(map(str, saved))}): specks of free cells may appear in "
            "unknown space, and walls may break or thicken; save the map as PNG or PGM from its "
            "source"
        ]


def _stands_out(counts: NDArray[np.int64], grey: int) -> bool:
    """Whether the greys around a grey have together less than a hundredth of its pixels."""
    around = counts[max(grey - _NEAR, 0) : grey + _NEAR + 1]
    return bool(around.sum() - counts[grey] < _FEW * counts[grey])


def _stands_alone(counts: NDArray[np.int64]) -> bool:
    """Whether grey 205 is a map saver's unknown, not one shade of many."""
    others = counts[OCCUPIED_GREY] > 0 and counts[FREE_GREY] > 0
    return bool(others and _stands_out(counts, UNKNOWN_GREY))
