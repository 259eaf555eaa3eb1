"""Scans with known or random shapes for the tests of the features."""

import gzip

import numpy as np
from numpy.typing import NDArray

from tests.real_data import real_data_folder

Scans = NDArray[np.float64]


def rectangle(
    width: float, height: float, x: float, y: float, *, n_beams: int = 360, turn: float = 0.0
) -> Scans:
    """(1, n_beams) exact ranges inside a rectangle with a corner at the origin."""
    angles = 2 * np.pi * np.arange(n_beams) / n_beams + turn
    with np.errstate(divide="ignore"):
        across = np.where(np.cos(angles) > 0, width - x, -x) / np.cos(angles)
        along = np.where(np.sin(angles) > 0, height - y, -y) / np.sin(angles)
    return np.minimum(np.abs(across), np.abs(along))[np.newaxis]


def doorway(gap: float, reach: float) -> Scans:
    """(1, 360) ranges in the middle of a gap of a thin wall between two round halls."""
    ranges = np.full(360, reach)
    for jamb in (90, 270):
        for offset in range(-3, 4):
            ranges[jamb + offset] = gap / 2 / np.cos(np.deg2rad(offset))
    return ranges[np.newaxis]


def rooms(n_scans: int, seed: int) -> NDArray[np.float32]:
    """(n, 360) ranges in random rectangles with doors, furniture and noise, as float32."""
    rng = np.random.default_rng(seed)
    scans = []
    for _ in range(n_scans):
        width, height = rng.uniform(1.5, 25.0, 2)
        x, y = width * rng.uniform(0.05, 0.95), height * rng.uniform(0.05, 0.95)
        scan = rectangle(width, height, x, y, turn=rng.uniform(0, 2 * np.pi))[0]
        for _ in range(rng.integers(0, 6)):
            start, size = rng.integers(0, 360), rng.integers(2, 40)
            beams = np.arange(start, start + size) % 360
            if rng.random() < 0.5:
                scan[beams] += rng.uniform(0.3, 12.0)
            else:
                scan[beams] = np.minimum(scan[beams], rng.uniform(0.2, 3.0))
        scans.append(scan + rng.normal(0, rng.choice([0.0, 0.01, 0.03]), 360))
    return np.clip(scans, 0.05, 29.9).astype(np.float32)


def degenerate() -> dict[str, Scans]:
    """Scans for which some definition loses its meaning, by name; maximum range 80."""
    half = np.repeat([80.0, 0.0], 180)
    spike = np.zeros(360)
    spike[0] = 80.0
    flat = np.zeros(360)
    flat[[0, 180]] = 3.0
    return {
        "all at maximum range": np.full((1, 360), 80.0),
        "all zero": np.zeros((1, 360)),
        "one spike": spike[np.newaxis],
        "half and half": half[np.newaxis],
        "no answer": np.full((1, 360), np.nan),
        "circle": np.full((1, 360), 2.0),
        "two spikes in line": flat[np.newaxis],
        "tiny": np.full((1, 360), 1e-6),
        "alternating": np.tile([0.0, 80.0], 180)[np.newaxis],
        "three sides equal": np.minimum(rectangle(4, 2, 1, 1), 2.0),
    }


def recorded(every: int) -> NDArray[np.float32]:
    """(n, 360) scans of a real robot; skips the running test where they are absent.

    They cover half a turn; taken as a full one they have the noise and jumps of a real sensor.
    """
    path = real_data_folder("freiburg079") / "laser.log.gz"
    with gzip.open(path, "rt") as lines:
        scans = [line.split()[2:362] for line in lines if line.startswith("FLASER 360")]
    return np.array(scans[::every], np.float32)
