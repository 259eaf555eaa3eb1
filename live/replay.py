"""Replay: a recorded log processed as by the live node, scan by scan and map by map."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pgm_places.errors import LogError
from pgm_places.io.logs.bags import MapMessage
from pgm_places.labelers.tracking import PathMap
from pgm_places.live.live_map import LiveLabels, LiveMap
from pgm_places.live.live_options import LiveOptions
from pgm_places.live.place_finder import FoundPlace, MapView, PlaceFinder
from pgm_places.maps.occupancy_grid import UNKNOWN, OccupancyGrid
from pgm_places.trajectories.scan import Scan
from pgm_places.trajectories.trajectory import Trajectory

MARGIN = 1
"""Cells of unknown space around the known cells of a map drawn from scans."""

LONGEST_STAMP_M = 5.0
"""Distance driven (m) under one stamp from which on stamps count as unusable."""


@dataclass(frozen=True, eq=False)
class Replay:
    """A recorded drive, in which each map is labelled before the next scan.

    A live node labels maps in parallel to the scans, with some delay. In a replay, each scan uses
    all maps sent before it, so that results are equal on every machine.
    In a log with unusable stamps, a metre driven counts as a second. Recorded maps are in the frame
    of the poses; without any, a map is drawn from the scans.
    """

    drive: Trajectory
    finder: PlaceFinder
    live_map: LiveMap
    options: LiveOptions
    maps: Sequence[MapMessage] = ()

    def __post_init__(self) -> None:
        if self.drive.ranges_m is None or self.drive.geometry is None or not len(self.drive):
            raise LogError(f"{self.drive.name} has no scans to replay")

    @property
    def counts_metres(self) -> bool:
        """Whether stamps are unusable: more than 5 m are driven under one of them."""
        _, stamp = np.unique(self.drive.times_s, return_inverse=True)
        driven_m = np.bincount(stamp[:-1], self.drive.step_lengths_m)
        return float(driven_m.max(initial=0.0)) > LONGEST_STAMP_M

    def __iter__(self) -> Iterator[FoundPlace | LiveLabels]:
        """The place of each scan, and between them the labelled maps."""
        ranges, geometry = self.drive.ranges_m, self.drive.geometry
        assert ranges is not None and geometry is not None  # checked in the constructor
        maps = _SentMaps(self.maps) if self.maps else _Drawn(self.drive)
        labelled_s = -np.inf
        clock_s = self.drive.times_s  # the clock of the options
        if self.counts_metres:
            clock_s = np.concatenate([[0.0], np.cumsum(self.drive.step_lengths_m)])
        for step, now_s in enumerate(clock_s.tolist()):
            scan = Scan(self.drive.times_s[step], self.drive.poses[step], ranges[step], geometry)
            maps.add(scan)
            if now_s - labelled_s >= self.options.relabel_min_period_s:
                grid = maps.take(scan.time_s)
                if grid is not None and grid.free.any():
                    labelled_s = now_s
                    labelled = self.live_map.on_map(grid)
                    self.finder.use(MapView.of(labelled))
                    yield labelled
            yield self.finder.step(scan, now_s=now_s)
        last = maps.take(np.inf)  # so that the result covers the complete drive
        if last is not None and last.free.any():
            yield self.live_map.on_map(last)


class _SentMaps:
    """The maps of a bag."""

    def __init__(self, maps: Sequence[MapMessage]) -> None:
        self._maps, self._next = sorted(maps, key=lambda item: item.time_s), 0

    def add(self, scan: Scan) -> None:
        """Do nothing: scans do not change recorded maps."""

    def take(self, time_s: float) -> OccupancyGrid | None:
        """The latest map sent up to a time, unless it was taken before."""
        first = self._next
        while self._next < len(self._maps) and self._maps[self._next].time_s <= time_s:
            self._next += 1
        return self._maps[self._next - 1].grid if self._next > first else None


class _Drawn:
    """A map that grows as the scans are drawn into it."""

    def __init__(self, drive: Trajectory) -> None:
        self._map = PathMap(drive.poses[:, :2])

    def add(self, scan: Scan) -> None:
        """Draw a scan."""
        self._map.add(scan.pose, scan.ranges_m, scan.geometry)

    def take(self, _time_s: float) -> OccupancyGrid | None:
        """The map so far, cropped to its known cells, so that its origin moves as it grows."""
        return _cut(self._map.grid())


def _cut(grid: OccupancyGrid) -> OccupancyGrid | None:
    known = grid.cells != UNKNOWN
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if not len(rows):
        return None
    low = np.array([rows[0], columns[0]]) - MARGIN
    low = np.maximum(low, 0)
    part = grid.cells[low[0] : rows[-1] + 1 + MARGIN, low[1] : columns[-1] + 1 + MARGIN]
    x, y = grid.origin_xy_m
    corner = (x + float(low[1]) * grid.resolution_m, y + float(low[0]) * grid.resolution_m)
    return OccupancyGrid(part, grid.resolution_m, corner)
