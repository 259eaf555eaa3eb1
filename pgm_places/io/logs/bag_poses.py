"""Poses over time from a bag: tracks, and the tree of coordinate frames they define."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

Lookup = Literal["interpolated", "nearest"]


@dataclass(frozen=True)
class PoseTrack:
    """Where one frame lies in another over time, seen from above.

    Parameters
    ----------
    times_s : (P,) float
        Increasing; one entry of a frame that never moves.
    poses : (P, 3) float
        x, y, and the heading of the frame's x axis.
    mirrored : bool
        Whether the frame is upside down, so that its y axis points to the right of its x axis.
    is_static : bool
        Whether it holds at all times.
    """

    times_s: NDArray[np.float64]
    poses: NDArray[np.float64]
    mirrored: bool = False
    is_static: bool = False

    @classmethod
    def from_entries(
        cls, entries: Iterable[tuple[float, float, float, float, bool]], *, is_static: bool = False
    ) -> Self:
        """The track through (time, x, y, heading, mirrored) in any order, each time once."""
        rows = np.array(list(entries), np.float64).reshape(-1, 5)
        times, first = np.unique(rows[:, 0], return_index=True)
        if is_static:
            times, first = rows[-1:, 0], np.array([len(rows) - 1])  # the last word counts
        mirrored = bool(rows[0, 4]) if len(rows) else False
        return cls(times, rows[first, 1:4], mirrored, is_static)

    def at(
        self, times_s: NDArray[np.float64], lookup: Lookup, max_gap_s: float
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """(T, 3) poses at the times, and (T,) whether there is one close enough.

        Interpolation needs entries on both sides, at most the gap apart; headings turn the shorter
        way. The nearest entry may be up to the gap away.
        """
        if self.is_static:
            return np.repeat(self.poses, len(times_s), axis=0), np.ones(len(times_s), np.bool_)
        if len(self.times_s) == 0:
            return np.zeros((len(times_s), 3)), np.zeros(len(times_s), np.bool_)
        after = np.clip(np.searchsorted(self.times_s, times_s), 0, len(self.times_s) - 1)
        before = np.where(self.times_s[after] > times_s, np.maximum(after - 1, 0), after)
        since, until = times_s - self.times_s[before], self.times_s[after] - times_s
        if lookup == "nearest":
            # Beyond the last entry both are that entry, and the distance to it is negative.
            chosen = np.where(np.abs(since) <= np.abs(until), before, after)
            return self.poses[chosen], np.abs(times_s - self.times_s[chosen]) <= max_gap_s
        inside = (since >= 0) & (until >= 0) & (since + until <= max_gap_s)
        span = since + until
        part = np.where(span > 0, since / np.where(span > 0, span, 1), 0)[:, None]
        step = self.poses[after] - self.poses[before]
        step[:, 2] = _half_turn(step[:, 2])
        poses = self.poses[before] + part * step
        poses[:, 2] = _half_turn(poses[:, 2])
        return poses, inside


class FrameTree:
    """Which frame is the child of which, from ``/tf`` and ``/tf_static``.

    Parameters
    ----------
    tracks : mapping of (parent, child) to PoseTrack
        Where each child lies in its parent.
    """

    def __init__(self, tracks: dict[tuple[str, str], PoseTrack]) -> None:
        self.tracks = tracks
        self._parent = {child: parent for parent, child in tracks}

    @property
    def frames(self) -> list[str]:
        """All frames, sorted."""
        return sorted({name for edge in self.tracks for name in edge})

    def chain(self, ancestor: str, frame: str) -> list[PoseTrack] | None:
        """The tracks from a frame's ancestor down to it, or None where there is none."""
        way: list[PoseTrack] = []
        seen = {frame}
        while frame != ancestor:
            parent = self._parent.get(frame)
            if parent is None or parent in seen:
                return None
            way.append(self.tracks[parent, frame])
            seen.add(parent)
            frame = parent
        return way[::-1]


def at_times(
    chain: list[PoseTrack], times_s: NDArray[np.float64], lookup: Lookup, max_gap_s: float
) -> tuple[NDArray[np.float64], NDArray[np.bool_], bool]:
    """Poses (T, 3) of a chain's last frame in its first, where known (T,), whether mirrored."""
    poses = np.zeros((len(times_s), 3))
    known = np.ones(len(times_s), np.bool_)
    mirrored = False
    for track in chain:
        inner, there = track.at(times_s, lookup, max_gap_s)
        known &= there
        side = -1.0 if mirrored else 1.0
        cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
        x, y = inner[:, 0], side * inner[:, 1]
        poses = np.column_stack(
            [
                poses[:, 0] + cos * x - sin * y,
                poses[:, 1] + sin * x + cos * y,
                _half_turn(poses[:, 2] + side * inner[:, 2]),
            ]
        )
        mirrored ^= track.mirrored
    return poses, known, mirrored


def planar(position: Any, orientation: Any) -> tuple[float, float, float, bool]:
    """x, y, heading of the x axis, and whether the z axis points down, of a ROS pose.

    The rotation matrix of the quaternion (x, y, z, w) has, where it is of unit length, the entries
    ``R00 = 1 - 2 (y² + z²)``, ``R10 = 2 (x y + w z)`` and ``R22 = 1 - 2 (x² + y²)``; without that
    division they are known up to a common factor, which neither the angle nor the sign needs.
    """
    x, y, z, w = orientation.x, orientation.y, orientation.z, orientation.w
    size = x * x + y * y + z * z + w * w
    heading = np.arctan2(2 * (x * y + w * z), size - 2 * (y * y + z * z))
    return float(position.x), float(position.y), float(heading), bool(size < 2 * (x * x + y * y))


def _half_turn(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angles from -pi to pi; those that are already there stay as they are, bit for bit."""
    inside = np.abs(angles) <= np.pi
    turned: NDArray[np.float64] = np.where(
        inside, angles, np.mod(angles + np.pi, 2 * np.pi) - np.pi
    )
    return turned
