"""The result of reading a robot's log: the trajectory, and warnings about the file."""

from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pgm_places.errors import LogError
from pgm_places.trajectories.scan import Scan, ScanGeometry
from pgm_places.trajectories.trajectory import Trajectory

MAX_SCANS = 5_000_000
MAX_READINGS = 500_000_000
_MAX_KINDS = 1000

# Walls never give such a share of readings of exactly the same distance, the longest of all.
_CODE_SHARE = 0.005
_CODE_READINGS = 20


@dataclass(frozen=True)
class LoadedLog:
    """A trajectory, with warnings and counts of its file.

    Parameters
    ----------
    trajectory : Trajectory
        The trajectory of the file.
    path : Path
        The file.
    warnings : tuple of str
        One sentence each about dropped or suspicious data.
    counts : mapping of str to int
        Number of messages of each kind in the file, skipped ones included.
    """

    trajectory: Trajectory
    path: Path
    warnings: tuple[str, ...] = ()
    counts: Mapping[str, int] = field(default_factory=dict)


def order_warnings(trajectory: Trajectory) -> list[str]:
    """Warnings about the time stamps."""
    backward = trajectory.n_backward_times
    if not backward:
        return []
    steps = "step has an earlier stamp" if backward == 1 else "steps have earlier stamps"
    return [f"{backward} {steps} than the step before; the steps stay in the order of the file"]


@dataclass
class _Kind:
    """Scans with the same beams."""

    geometry: ScanGeometry
    times_s: "array[float]" = field(default_factory=lambda: array("d"))
    poses: "array[float]" = field(default_factory=lambda: array("d"))
    odometry: "array[float]" = field(default_factory=lambda: array("d"))
    ranges_m: "array[float]" = field(default_factory=lambda: array("f"))


class ScanColumns:
    """The scans of a log as columns per geometry, a tenth of the memory of a list of scans.

    Readers share one geometry object between scans with the same beams.

    Parameters
    ----------
    path : Path
        The log, for messages.
    most_scans : int
    """

    def __init__(self, path: Path, most_scans: int = MAX_SCANS) -> None:
        self.path, self._most_scans = path, most_scans
        self.n_scans = self._n_readings = 0
        self._kinds: dict[int, _Kind] = {}

    def add(self, scan: Scan) -> None:
        """Add a scan.

        Raises
        ------
        LogError
            The log has too many scans, or too many kinds of beams.
        """
        kind = self._kinds.setdefault(id(scan.geometry), _Kind(scan.geometry))
        kind.times_s.append(scan.time_s)
        kind.poses.frombytes(scan.pose.tobytes())
        kind.ranges_m.frombytes(scan.ranges_m.tobytes())
        if scan.odometry is not None:
            kind.odometry.frombytes(scan.odometry.tobytes())
        self.n_scans += 1
        self._n_readings += scan.geometry.n_beams
        if self.n_scans > self._most_scans or self._n_readings > MAX_READINGS:
            raise LogError(
                f"{self.path}: more than {self._most_scans} scans or {MAX_READINGS} readings; "
                "split it"
            )
        if len(self._kinds) > _MAX_KINDS:
            raise LogError(
                f"{self.path}: the beams change more than {_MAX_KINDS} times; is it the log of one "
                "laser?"
            )

    def trajectory(self, name: str) -> tuple[Trajectory, list[str]]:
        """The scans of the most frequent kind (of equals, the first), and a warning of the rest."""
        kind = max(self._kinds.values(), key=lambda kind: len(kind.times_s))
        n_kept = len(kind.times_s)
        odometry = np.frombuffer(kind.odometry).reshape(-1, 3)
        trajectory = Trajectory(
            np.frombuffer(kind.times_s),
            np.frombuffer(kind.poses).reshape(n_kept, 3),
            np.frombuffer(kind.ranges_m, np.float32).reshape(n_kept, kind.geometry.n_beams),
            kind.geometry,
            odometry=odometry if len(odometry) == n_kept else None,
            name=name,
        )
        if n_kept == self.n_scans:
            return trajectory, []
        return trajectory, [
            f"the scans have different beams: {n_kept} of {kind.geometry} are read, "
            f"{self.n_scans - n_kept} of other kinds left out"
        ]


def code_warnings(trajectory: Trajectory) -> list[str]:
    """A warning if the longest reading is so frequent that it must mean "no return"."""
    ranges, geometry = trajectory.ranges_m, trajectory.geometry
    if ranges is None or geometry is None:
        return []
    met = ranges[geometry.returned(ranges)]
    if met.size == 0:
        return []
    longest = met.max()
    readings = np.count_nonzero(met == longest)
    share = readings / ranges.size
    if share < _CODE_SHARE or readings < _CODE_READINGS:
        return []
    return [
        f"{100 * share:.1f} % of the readings are exactly {longest:g} m, the longest of all: "
        f"if that is how the sensor reports no return, give {longest:g} as range_max_m"
    ]
