"""What reading a robot's log gives: the trajectory, and what there is to say about the file."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

from pgm_places.trajectory import Trajectory

__all__ = ["LoadedLog"]


@dataclass(frozen=True)
class LoadedLog:
    """A trajectory and the story of its file.

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
    """What there is to say about the time stamps."""
    backward = trajectory.n_backward_times
    if not backward:
        return []
    steps = "step has an earlier stamp" if backward == 1 else "steps have earlier stamps"
    return [f"{backward} {steps} than the step before; the order of the file is kept"]
