"""map_server's reading of one pixel, written down statement by statement (slow)."""

import math
from collections.abc import Sequence

import numpy as np


def nav2_occupancy(
    pixel: Sequence[int],
    alpha: int,
    mode: str,
    negate: bool,
    free_thresh: float,
    occupied_thresh: float,
) -> int:
    """Current Nav2: grey by luma, single precision, free goes before occupied."""
    if len(pixel) == 1:
        grey = pixel[0]
    else:
        red, green, blue = pixel
        grey = math.floor(0.212656 * red + 0.715158 * green + 0.072186 * blue + 0.5)
    if mode == "raw":
        return grey if grey <= 100 else -1
    if alpha < 255:
        return -1
    p = np.float32(grey) / np.float32(255)
    if not negate:
        p = np.float32(1) - p
    if p <= np.float32(free_thresh):
        return 0
    if p >= np.float32(occupied_thresh):
        return 100
    if mode == "trinary":
        return -1
    span = np.float32(occupied_thresh - free_thresh)
    scaled = (p - np.float32(free_thresh)) / span * np.float32(100)
    return math.floor(float(scaled) + 0.5)


def ros1_occupancy(
    pixel: Sequence[int],
    alpha: int | None,
    mode: str,
    negate: bool,
    free_thresh: float,
    occupied_thresh: float,
) -> int:
    """ROS 1: mean of the channels, alpha one of them in trinary mode, strict comparisons."""
    channels = list(pixel)
    if alpha is not None:
        channels = channels * 3 if len(channels) == 1 else channels
        if mode == "trinary":
            channels.append(alpha)
    mean = sum(channels) / len(channels)
    if negate:
        mean = 255 - mean
    if mode == "raw":
        return int(mean) if mean <= 100 else -1
    p = (255 - mean) / 255
    if p > occupied_thresh:
        return 100
    if p < free_thresh:
        return 0
    if mode == "trinary" or alpha == 0:
        return -1
    return int(99 * (p - free_thresh) / (occupied_thresh - free_thresh))
