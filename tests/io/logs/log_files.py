"""Small trajectories and log lines for tests of readers and writers."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.rosbag2.enums import CompressionFormat, CompressionMode

from pgm_places import ScanGeometry, Trajectory

HEADER = b"# message formats defined: PARAM ODOM FLASER\n"


def flaser(
    readings: list[float], *, time: float = 1.0, pose: str = "1 2 0.5", odometry: str = "1 2 0.5"
) -> bytes:
    values = " ".join(map(str, readings))
    return f"FLASER {len(readings)} {values} {pose} {odometry} {time} host {time}\n".encode()


def robotlaser(readings: list[float], *, start: float = -0.5, step: float = 0.25) -> bytes:
    values = " ".join(map(str, readings))
    span = step * len(readings)
    return (
        f"ROBOTLASER1 0 {start} {span} {step} 20.0 0.1 0 {len(readings)} {values} 2 7 8 "
        "1 2 0.5 0.9 2 0.5 0.1 0 0.2 0.3 1e6 55.5 host 0.1\n"
    ).encode()


def drive(geometry: ScanGeometry, n_steps: int = 6, *, odometry: bool = True) -> Trajectory:
    """A drive with scans whose ranges are whole millimetres, some of them without return."""
    rng = np.random.default_rng(n_steps)
    reach = geometry.range_max_m
    ranges = np.round(rng.uniform(0.2, reach - 0.01, (n_steps, geometry.n_beams)), 3)
    ranges[rng.random(ranges.shape) < 0.2] = reach
    wheels = rng.normal(size=(n_steps, 3))
    return Trajectory(
        1e9 + np.cumsum(rng.uniform(0.05, 0.2, n_steps)),
        rng.normal(size=(n_steps, 3)),
        ranges.astype(np.float32),
        geometry,
        rng.integers(-1, 2, n_steps),
        ("corridor", "room"),
        wheels if odometry else None,
        name="drive",
    )


@contextmanager
def packed_chunks(name: str) -> Iterator[None]:
    """ROS 1 bags that are written meanwhile have chunks packed by ``BZ2`` or ``LZ4``."""
    made = rosbag1.Writer

    def packed(path: Any) -> Any:
        writer = made(path)
        writer.set_compression(made.CompressionFormat[name])
        return writer

    with patch.object(rosbag1, "Writer", packed):
        yield


@contextmanager
def packed_files(plugin: str) -> Iterator[None]:
    """ROS 2 bags that are written meanwhile are packed as a whole; ``SQLITE3`` or ``MCAP``."""
    made = rosbag2.Writer

    def packed(path: Any, **options: Any) -> Any:
        storage = rosbag2.StoragePlugin[plugin]
        writer = made(path, **{**options, "storage_plugin": storage})
        writer.set_compression(CompressionMode.FILE, CompressionFormat.ZSTD)
        return writer

    with patch.object(rosbag2, "Writer", packed):
        yield
