"""Tracked trajectories: labels, visits to places, and a map of the scans."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.inference.labeling import Labeling
from pgm_places.maps.occupancy_grid import UNKNOWN, OccupancyGrid
from pgm_places.sensing.local_map import LocalMap
from pgm_places.trajectories.scan import ScanGeometry
from pgm_places.trajectories.trajectory import Trajectory

# Longer readings are not drawn in a map of scans, to limit its size.
DRAWN_M = 15.0

# Most cells along a side of a map of scans; a longer path is drawn with larger cells.
DRAWN_CELLS = 3000


@dataclass(frozen=True)
class Visit:
    """Consecutive steps with one label.

    Parameters
    ----------
    label : int
    first, last : int
        Step numbers, both included.
    length_m : float
        Distance driven from the first step to the one after the last.
    """

    label: int
    first: int
    last: int
    length_m: float

    @property
    def n_steps(self) -> int:
        """Number of steps."""
        return self.last - self.first + 1


@dataclass(frozen=True, eq=False)
class Track:
    """A trajectory and its labelling.

    Parameters
    ----------
    trajectory : Trajectory
        May have true labels with the same names.
    labeling : Labeling
        Labels of its steps.
    label_names : tuple of str
    warnings : tuple of str
    """

    trajectory: Trajectory
    labeling: Labeling
    label_names: tuple[str, ...]
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if len(self.labeling.labels) != len(self.trajectory):
            raise InputError(
                f"{self.trajectory.name} has {len(self.trajectory)} steps, but there are "
                f"{len(self.labeling.labels)} labels"
            )

    @property
    def truth(self) -> NDArray[np.int64] | None:
        """(T,) the true labels, if the trajectory has labels of the same names."""
        if self.trajectory.label_names != self.label_names:
            return None
        return self.trajectory.labels

    @property
    def accuracy(self) -> float | None:
        """Share of correct labels among steps with a true label; None without such steps."""
        truth = self.truth
        if truth is None or not (known := truth >= 0).any():
            return None
        return float((self.labeling.labels[known] == truth[known]).mean())

    def visits(self) -> Iterator[Visit]:
        """The visits, in order."""
        labels = self.labeling.labels
        if not len(labels):
            return
        distance = np.concatenate([[0.0], np.cumsum(self.trajectory.step_lengths_m)])
        starts = np.concatenate([[0], np.flatnonzero(np.diff(labels)) + 1])
        ends = np.append(starts[1:], len(labels))
        for first, end in zip(starts.tolist(), ends.tolist(), strict=True):
            length = distance[min(end, len(labels) - 1)] - distance[first]
            yield Visit(int(labels[first]), first, end - 1, float(length))

    def totals(self) -> list[tuple[str, int, int, float]]:
        """The name, visits, steps and metres of each label."""
        of_label: list[list[Visit]] = [[] for _ in self.label_names]
        for visit in self.visits():
            of_label[visit.label].append(visit)
        return [
            (name, len(visits), sum(v.n_steps for v in visits), sum(v.length_m for v in visits))
            for name, visits in zip(self.label_names, of_label, strict=True)
        ]


def map_of_scans(trajectory: Trajectory, *, resolution_m: float = 0.05) -> OccupancyGrid:
    """A map drawn from the scans at their poses, in the frame of the poses.

    Without scans, all cells around the path are unknown.
    """
    if not len(trajectory):
        return OccupancyGrid(np.full((8, 8), UNKNOWN, np.int8), resolution_m)
    path_map = PathMap(trajectory.poses[:, :2], resolution_m=resolution_m)
    if trajectory.ranges_m is not None and trajectory.geometry is not None:
        for pose, row in zip(trajectory.poses, trajectory.ranges_m, strict=True):
            path_map.add(pose, row, trajectory.geometry)
    return path_map.grid()


class PathMap:
    """A map drawn scan by scan, large enough for a given path.

    Parameters
    ----------
    path_xy_m : (T, 2) float
        All positions of the path, at least one.
    resolution_m : float
        Side of a cell; larger for a long path.
    """

    def __init__(self, path_xy_m: NDArray[np.float64], *, resolution_m: float = 0.05) -> None:
        low, high = path_xy_m.min(axis=0), path_xy_m.max(axis=0)
        side = float((high - low).max()) + 2 * DRAWN_M
        cell = max(resolution_m, side / DRAWN_CELLS)
        self._map = LocalMap(side, cell, robot_radius_m=0.0)
        middle: Sequence[float] = [*(0.5 * (low + high)), 0.0]
        # Centre the window on the path once; scans do not move it.
        self._map.update(middle, [np.nan], [0.0], max_range_m=1.0)

    def add(
        self, pose: NDArray[np.float64], ranges_m: NDArray[np.float32], geometry: ScanGeometry
    ) -> None:
        """Draw a scan (M,) taken at a pose (3,)."""
        ranges = np.where(geometry.returned(ranges_m), ranges_m, np.nan)
        self._map.write(pose, ranges, geometry.angles_rad, max_range_m=DRAWN_M)

    def grid(self) -> OccupancyGrid:
        """The map drawn so far."""
        return self._map.to_grid()
