"""FrameBuffer: where frames were in each other during the last seconds, from transforms."""

from bisect import bisect_left, bisect_right
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.io.logs.bag_poses import PoseTrack, at_times

KEEP_S = 10.0
"""How long transforms are kept, as long as tf2 does."""

Place = tuple[float, float, float, bool]


class SoughtPose(NamedTuple):
    """A pose that was looked up, or why there is none.

    Parameters
    ----------
    pose : (3,) float or None
        x, y in metres and heading in radians.
    mirrored : bool
        Whether the frame is upside down.
    may_come : bool
        Whether a transform that is still on its way could tell.
    problem : str
        Why there is no pose.
    """

    pose: NDArray[np.float64] | None
    mirrored: bool = False
    may_come: bool = False
    problem: str = ""


@dataclass
class _Edge:
    """Where a frame lies in its parent, by time."""

    parent: str
    is_static: bool
    times_s: list[float] = field(default_factory=list)
    places: list[Place] = field(default_factory=list)

    def add(self, time_s: float, place: Place) -> None:
        if self.is_static or (self.times_s and time_s < self.times_s[-1] - KEEP_S):
            self.times_s.clear()  # the last word counts; or the clock has jumped back
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
        """The entries before and after a time that lies between the first and the last."""
        at = 0 if self.is_static else bisect_left(self.times_s, time_s)
        part = slice(max(at - 1, 0), at + 1)
        entries = zip(self.times_s[part], self.places[part], strict=True)
        return PoseTrack.from_entries(
            ((time, *place) for time, place in entries), is_static=self.is_static
        )


class FrameBuffer:
    """The tree of coordinate frames, seen from above, over the last ten seconds.

    A pose is that of its own time, interpolated between two transforms; none is made up beyond
    the latest. A leading ``/`` of a frame's name means nothing.

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
        """Forget what is said of later times: the clock has gone back to this one."""
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
        """Take a transform: where ``child`` lies in ``parent`` at a time.

        Parameters
        ----------
        parent, child : str
        time_s : float
        place : (x, y, heading, mirrored)
            As :func:`~pgm_places.io.logs.bag_poses.planar` gives it.
        is_static : bool
            Whether it holds at all times.
        """
        parent, child = parent.lstrip("/"), child.lstrip("/")
        edge = self._edges.get(child)
        if edge is None or edge.parent != parent or edge.is_static != is_static:
            edge = self._edges[child] = _Edge(parent, is_static)
        edge.add(time_s, place)

    def pose(self, ancestor: str, frame: str, time_s: float) -> SoughtPose:
        """Where ``frame`` lay in ``ancestor`` at a time."""
        ancestor, frame = ancestor.lstrip("/"), frame.lstrip("/")
        chain: list[PoseTrack] = []
        child, seen = frame, {frame}
        while child != ancestor:
            edge = self._edges.get(child)
            if edge is None or edge.parent in seen:
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
            seen.add(edge.parent)
            child = edge.parent
        poses, _, mirrored = at_times(chain[::-1], np.array([time_s]), "interpolated", np.inf)
        return SoughtPose(poses[0], mirrored)

    def _unconnected(self, ancestor: str, frame: str) -> SoughtPose:
        known = ", ".join(self.frames) or "none"
        return SoughtPose(
            None,
            may_come=True,
            problem=f"no transforms lead from {ancestor!r} to {frame!r}; frames: {known}",
        )
