"""The meaning of a map image's pixels: the rules of Nav2's and of ROS 1's map_server."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN

__all__ = ["Compat", "Mode", "PixelRules", "grey_of"]

Mode: TypeAlias = Literal["trinary", "scale", "raw"]
Compat: TypeAlias = Literal["nav2", "ros1"]

# Rec. 709 luma of gamma-coded channels: the grey conversion of ImageMagick, which Nav2 calls.
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
    """The keys of a map description that decide what its pixels mean.

    Parameters
    ----------
    mode : {"trinary", "scale", "raw"}
        ``trinary``: occupied, free or unknown by the thresholds. ``scale``: as trinary, but the
        values between the thresholds become 1 to 99. ``raw``: the grey value is the occupancy.
    negate : bool
        Black is free and white is occupied.
    free_thresh, occupied_thresh : float
        Thresholds on the probability that the cell is occupied.
    compat : {"nav2", "ros1"}
        Whose rules.
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

        Occupancy is what map_server would publish. The cells are ``FREE``, ``OCCUPIED`` or
        ``UNKNOWN``: in mode trinary the same; in mode scale what trinary would make of the same
        pixels; in mode raw the file's own thresholds on ``occupancy / 100``, as a map saver turns
        such a map into a trinary one.
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
        """Whether the thresholds make cells of a grey free."""
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
        """Single precision: ``p = 1 - grey / 255`` (``grey / 255`` with negate).

        Occupied where ``p >= occupied_thresh``, free where ``p <= free_thresh``, which goes first;
        scale rounds half up. Raw mode ignores negate.
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
