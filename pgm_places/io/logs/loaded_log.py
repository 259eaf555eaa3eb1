"""The result of reading a robot's log: the trajectory, and warnings about the file."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

import numpy as np

from pgm_places.trajectories.scan import Scan
from pgm_places.trajectories.trajectory import Trajectory

__all__ = ["LoadedLog", "code_warnings", "kind_warnings", "most_frequent_kind", "order_warnings"]

# A wall does not stand at one and the same distance, the longest of all, for so many readings.
_CODE_SHARE = 0.005
_CODE_READINGS = 20


@dataclass(frozen=True)
class LoadedLog:
    """A trajectory and what happened while its file was read.

    Parameters
    ----------
    trajectory : Trajectory
        What was read.
    path : Path
        From where.
    warnings : tuple of str
        One sentence each about what was left out, or what may be wrong with the rest.
    counts : mapping of str to int
        How many messages of each kind the file holds, those that were skipped among them.
    """

    trajectory: Trajectory
    path: Path
    warnings: tuple[str, ...] = ()
    counts: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "counts", MappingProxyType(dict(self.counts)))


def order_warnings(trajectory: Trajectory) -> list[str]:
    """Warnings about the time stamps."""
    backward = trajectory.n_backward_times
    if not backward:
        return []
    steps = "step has an earlier stamp" if backward == 1 else "steps have earlier stamps"
    return [f"{backward} {steps} than the step before; the order of the file is kept"]


def most_frequent_kind(scans: Sequence[Scan]) -> list[Scan]:
    """The scans of the most frequent geometry, the earlier one where two are as frequent.

    Readers give scans with the same beams the same geometry object.
    """
    frequency = Counter(id(scan.geometry) for scan in scans)
    kind = frequency.most_common(1)[0][0]
    return [scan for scan in scans if id(scan.geometry) == kind]


def kind_warnings(scans: Sequence[Scan], kept: Sequence[Scan]) -> list[str]:
    """Warnings about scans whose number of beams changes."""
    if len(kept) == len(scans):
        return []
    return [
        f"the scans have different beams: {len(kept)} of {kept[0].geometry} are kept, "
        f"{len(scans) - len(kept)} of other kinds left out"
    ]


def code_warnings(trajectory: Trajectory) -> list[str]:
    """A warning where the longest reading is so frequent that it must stand for "nothing seen"."""
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
