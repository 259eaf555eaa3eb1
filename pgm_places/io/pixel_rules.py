"""What a pixel of a map image means: the rules of Nav2's and of ROS 1's map_server."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pgm_places.grid import FREE, OCCUPIED, UNKNOWN

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

    def occupancy(
        self, channels: NDArray[np.uint8], alpha: NDArray[np.uint8] | None
    ) -> NDArray[np.int8]:
        """(h, W) occupancy from 0 to 100, or -1 for unknown, of (h, W, C) channels."""
        if self.compat == "ros1":
            return self._ros1(channels, alpha)
        values = self.grey_table()[grey_of(channels)]
        if alpha is not None and self.mode != "raw":
            values[alpha < 255] = UNKNOWN
        return values

    def grey_table(self) -> NDArray[np.int8]:
        """(256,) occupancy of each opaque grey value.

        In Nav2 the comparison is done in single precision: ``p = 1 - grey / 255`` (``grey / 255``
        with negate); occupied where ``p >= occupied_thresh``, free where ``p <= free_thresh``,
        which goes first; scale rounds half away from zero. In raw mode negate is not looked at.
        """
        if self.compat == "ros1":
            return self._ros1_table(1)
        grey = np.arange(256)
        if self.mode == "raw":
            return np.where(grey <= OCCUPIED, grey, UNKNOWN).astype(np.int8)
        p = grey.astype(np.float32) / np.float32(255)
        if not self.negate:
            p = np.float32(1) - p
        low, high = np.float32(self.free_thresh), np.float32(self.occupied_thresh)
        if self.mode == "scale":
            width = np.float32(self.occupied_thresh - self.free_thresh)
            table = np.floor((p - low) / width * np.float32(100) + np.float32(0.5))
        else:
            table = np.full(256, UNKNOWN, np.float32)
        table = np.where(p >= high, np.float32(OCCUPIED), table)
        return np.where(p <= low, np.float32(FREE), table).astype(np.int8)

    def cells(self, occupancy: NDArray[np.int8]) -> NDArray[np.int8]:
        """(h, W) ``FREE``, ``OCCUPIED`` or ``UNKNOWN`` of occupancy values.

        trinary and scale: 0 is free, 100 is occupied, all between is unknown, so that both modes
        give the same cells (but for greys so near a threshold that they round to 0 or 100).
        raw: the file's own thresholds on ``occupancy / 100``, as a map saver turns such a map into
        a trinary one.
        """
        if self.mode == "trinary":
            return occupancy
        if self.mode == "scale":
            free, occupied = occupancy == FREE, occupancy == OCCUPIED
        else:
            occupied = occupancy >= np.rint(100 * self.occupied_thresh)
            free = (occupancy != UNKNOWN) & (occupancy <= np.rint(100 * self.free_thresh))
        cells = np.full(occupancy.shape, UNKNOWN, np.int8)
        cells[occupied] = OCCUPIED
        cells[free] = FREE
        return cells

    def _ros1(
        self, channels: NDArray[np.uint8], alpha: NDArray[np.uint8] | None
    ) -> NDArray[np.int8]:
        """Mean of the channels; in trinary mode alpha counts as one of them (SDL gives RGBA)."""
        total = channels.sum(axis=2, dtype=np.int64)
        n_channels = channels.shape[2]
        if alpha is not None:
            total, n_channels = total * 3 // n_channels, 3  # grey with alpha comes as RGBA
            if self.mode == "trinary":
                total, n_channels = total + alpha, 4
        values = self._ros1_table(n_channels)[total]
        if alpha is not None and self.mode == "scale":
            between = (values > FREE) & (values < OCCUPIED)
            values[between & (alpha == 0)] = UNKNOWN
        return values

    def _ros1_table(self, n_channels: int) -> NDArray[np.int8]:
        """(255 n_channels + 1,) occupancy of each sum of channels; strict comparisons."""
        mean = np.arange(255 * n_channels + 1) / n_channels
        if self.negate:
            mean = 255 - mean
        if self.mode == "raw":
            return np.where(mean <= OCCUPIED, np.trunc(mean), UNKNOWN).astype(np.int8)
        p = (255 - mean) / 255
        if self.mode == "scale":
            width = self.occupied_thresh - self.free_thresh
            table = np.trunc(99 * (p - self.free_thresh) / width)
        else:
            table = np.full(p.shape, float(UNKNOWN))
        table = np.where(p < self.free_thresh, float(FREE), table)
        return np.where(p > self.occupied_thresh, float(OCCUPIED), table).astype(np.int8)
