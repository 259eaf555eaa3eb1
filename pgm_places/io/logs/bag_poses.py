"""Poses over time from ROS transforms: tracks, frame trees, and a live transform buffer."""

from bisect import bisect_left, bisect_right
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import FARTHEST_M
from pgm_places.errors import LogError, quoted

Lookup = Literal["interpolated", "nearest"]


@dataclass(frozen=True)
class PoseTrack:
    """The planar poses (P, 3) of one coordinate frame in another over increasing times (P,) in s.

    A ``mirrored`` frame is upside down: its y axis points to the right of its x axis. A static one
    has a single entry, which holds at all times.
    """

    times_s: NDArray[np.float64]
    poses: NDArray[np.float64]
    mirrored: bool = False
    is_static: bool = False

    @classmethod
    def from_entries(
        cls, entries: Iterable[tuple[float, float, float, float, bool]], *, is_static: bool = False
    ) -> Self:
        """The track through entries (time, x, y, heading, mirrored), sorted by time."""
        rows = np.array(list(entries), np.float64).reshape(-1, 5)
        times, first = np.unique(rows[:, 0], return_index=True)
        if is_static:
            times, first = rows[-1:, 0], np.array([len(rows) - 1])  # the last entry counts
        mirrored = bool(rows[0, 4]) if len(rows) else False
        return cls(times, rows[first, 1:4], mirrored, is_static)

    def at(
        self, times_s: NDArray[np.float64], lookup: Lookup, max_gap_s: float
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """(T, 3) poses at the times, and (T,) whether an entry is close enough.

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
            # Beyond the last entry, both are the last entry, at a negative distance.
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
    """The tree of frames from ``/tf`` and ``/tf_static``: a track for each (parent, child)."""

    def __init__(self, tracks: dict[tuple[str, str], PoseTrack]) -> None:
        self.tracks = tracks
        self._parent = {child: parent for parent, child in tracks}

    @property
    def frames(self) -> list[str]:
        """All frames, sorted."""
        return sorted({name for edge in self.tracks for name in edge})

    def chain(self, ancestor: str, frame: str) -> list[PoseTrack] | None:
        """The tracks from an ancestor down to a frame; None if they are not connected."""
        way: list[PoseTrack] = []
        visited = {frame}
        while frame != ancestor:
            parent = self._parent.get(frame)
            if parent is None or parent in visited:
                return None
            way.append(self.tracks[parent, frame])
            visited.add(parent)
            frame = parent
        return way[::-1]


def at_times(
    chain: list[PoseTrack], times_s: NDArray[np.float64], lookup: Lookup, max_gap_s: float
) -> tuple[NDArray[np.float64], NDArray[np.bool_], bool]:
    """Poses (T, 3) of a chain's last frame in its first, whether known (T,), whether mirrored.

    Poses beyond 10^7 m or not finite are unknown.
    """
    poses = np.zeros((len(times_s), 3))
    known = np.ones(len(times_s), np.bool_)
    mirrored = False
    for track in chain:
        inner, there = track.at(times_s, lookup, max_gap_s)
        known &= there
        side = -1.0 if mirrored else 1.0
        cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
        x, y = inner[:, 0], side * inner[:, 1]
        with np.errstate(over="ignore", invalid="ignore"):
            poses = np.column_stack(
                [
                    poses[:, 0] + cos * x - sin * y,
                    poses[:, 1] + sin * x + cos * y,
                    _half_turn(poses[:, 2] + side * inner[:, 2]),
                ]
            )
        mirrored ^= track.mirrored
    with np.errstate(invalid="ignore"):
        known &= (np.abs(poses) <= FARTHEST_M).all(axis=1)
    poses[~known] = 0.0
    return poses, known, mirrored


def planar(position: Any, orientation: Any) -> tuple[float, float, float, bool]:
    """x, y, heading of the x axis, and whether the z axis points down, of a ROS pose.

    The rotation matrix of a unit quaternion (x, y, z, w) has the entries
    ``R00 = 1 - 2 (y² + z²)``, ``R10 = 2 (x y + w z)`` and ``R22 = 1 - 2 (x² + y²)``. Without
    normalisation they have a common positive factor, which changes neither the angle nor the sign.
    """
    x, y, z, w = orientation.x, orientation.y, orientation.z, orientation.w
    size = x * x + y * y + z * z + w * w
    heading = np.arctan2(2 * (x * y + w * z), size - 2 * (y * y + z * z))
    return float(position.x), float(position.y), float(heading), bool(size < 2 * (x * x + y * y))


def check_place(place: tuple[float, float, float, bool], parent: str, child: str) -> None:
    """Refuse a transform with numbers that are not finite or beyond 10^7 m."""
    x, y, heading, _ = place
    if not max(abs(x), abs(y), abs(heading)) <= FARTHEST_M or np.isnan([x, y, heading]).any():
        raise LogError(
            f"the transform from {quoted(parent)} to {quoted(child)} is "
            f"({x:g}, {y:g}, {heading:g}), "
            f"which must be metres and radians up to {FARTHEST_M:g}; the transform is ignored"
        )


def _half_turn(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angles wrapped to -pi to pi; angles within the range stay the same, bit for bit."""
    inside = np.abs(angles) <= np.pi
    turned: NDArray[np.float64] = np.where(
        inside, angles, np.mod(angles + np.pi, 2 * np.pi) - np.pi
    )
    return turned


KEEP_S = 10.0
"""Seconds of transforms in the buffer, as in tf2."""

Place = tuple[float, float, float, bool]


class SoughtPose(NamedTuple):
    """The result of a pose look-up: the pose (3,), or the problem that prevents it.

    ``may_come`` tells whether a later transform may make the pose available.
    """

    pose: NDArray[np.float64] | None
    mirrored: bool = False
    may_come: bool = False
    problem: str = ""


@dataclass
class _Edge:
    """The recent poses of a frame in its parent."""

    parent: str
    is_static: bool
    times_s: list[float] = field(default_factory=list)
    places: list[Place] = field(default_factory=list)

    def add(self, time_s: float, place: Place) -> None:
        if self.is_static or (self.times_s and time_s < self.times_s[-1] - KEEP_S):
            self.times_s.clear()  # the last entry counts; or the clock has jumped back
            self.places.clear()
        at = bisect_left(self.times_s, time_s)
        if at < len(self.times_s) and self.times_s[at] == time_s:
            self.places[at] = place
            return
        self.times_s.insert(at, time_s)
        self.places.insert(at, place)
        while self.times_s[0] < self.times_s[-1] - KEEP_S:
            del self.times_s[0], self.places[0]

    def around(self, time_s: float) -> PoseTrack:
        """The two entries around a time within the buffer."""
        at = 0 if self.is_static else bisect_left(self.times_s, time_s)
        part = slice(max(at - 1, 0), at + 1)
        entries = zip(self.times_s[part], self.places[part], strict=True)
        return PoseTrack.from_entries(
            ((time, *place) for time, place in entries), is_static=self.is_static
        )


class FrameBuffer:
    """A buffer of planar transforms over the last ten seconds.

    Poses are interpolated between two transforms and never extrapolated. A leading ``/`` of a
    frame's name is ignored.

    Examples
    --------
    >>> frames = FrameBuffer()
    >>> frames.add("map", "laser", 1.0, (0.0, 0.0, 0.0, False))
    >>> frames.add("map", "laser", 2.0, (1.0, 0.0, 0.0, False))
    >>> frames.pose("map", "laser", 1.5).pose
    array([0.5, 0. , 0. ])
    >>> frames.pose("map", "laser", 2.5).problem
    'the transform from map to laser is 0.50 s older than the scan'
    """

    def __init__(self) -> None:
        self._edges: dict[str, _Edge] = {}

    def forget_after(self, time_s: float) -> None:
        """Drop later transforms after the clock has jumped back to a time."""
        for child, edge in list(self._edges.items()):
            if not edge.is_static:
                at = bisect_right(edge.times_s, time_s)
                del edge.times_s[at:], edge.places[at:]
                if not edge.times_s:
                    del self._edges[child]

    def knows(self, child: str) -> bool:
        """Whether the frame has a parent."""
        return child.lstrip("/") in self._edges

    @property
    def frames(self) -> list[str]:
        """All frames, sorted."""
        return sorted({*self._edges, *(edge.parent for edge in self._edges.values())})

    def add(
        self, parent: str, child: str, time_s: float, place: Place, *, is_static: bool = False
    ) -> None:
        """Add the pose of ``child`` in ``parent`` at a time, as returned by :func:`planar`."""
        parent, child = parent.lstrip("/"), child.lstrip("/")
        edge = self._edges.get(child)
        if edge is None or edge.parent != parent or edge.is_static != is_static:
            edge = self._edges[child] = _Edge(parent, is_static)
        edge.add(time_s, place)

    def pose(self, ancestor: str, frame: str, time_s: float) -> SoughtPose:
        """The pose of ``frame`` in ``ancestor`` at a time."""
        ancestor, frame = ancestor.lstrip("/"), frame.lstrip("/")
        chain: list[PoseTrack] = []
        child, visited = frame, {frame}
        while child != ancestor:
            edge = self._edges.get(child)
            if edge is None or edge.parent in visited:
                return self._unconnected(ancestor, frame)
            if not edge.is_static and time_s > edge.times_s[-1]:
                late_s = time_s - edge.times_s[-1]
                return SoughtPose(
                    None,
                    may_come=True,
                    problem=f"the transform from {edge.parent} to {child} is {late_s:.2f} s older "
                    "than the scan",
                )
            if not edge.is_static and time_s < edge.times_s[0]:
                return SoughtPose(
                    None,
                    problem=f"the transforms from {edge.parent} to {child} begin "
                    f"{edge.times_s[0] - time_s:.2f} s after the scan",
                )
            chain.append(edge.around(time_s))
            visited.add(edge.parent)
            child = edge.parent
        poses, known, mirrored = at_times(chain[::-1], np.array([time_s]), "interpolated", np.inf)
        if not known[0]:
            problem = f"the transforms from {ancestor} to {frame} lead beyond {FARTHEST_M:g} m"
            return SoughtPose(None, problem=problem)
        return SoughtPose(poses[0], mirrored)

    def _unconnected(self, ancestor: str, frame: str) -> SoughtPose:
        known = ", ".join(self.frames) or "none"
        return SoughtPose(
            None,
            may_come=True,
            problem=f"no transforms lead from {ancestor!r} to {frame!r}; frames: {known}",
        )
