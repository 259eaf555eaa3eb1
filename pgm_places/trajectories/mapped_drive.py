"""A drive and the labelled map that it goes through."""

from dataclasses import dataclass

from pgm_places._arguments import public
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.trajectories.trajectory import Trajectory


@public
@dataclass(frozen=True, eq=False)
class MappedDrive:
    """A drive and the labelled map that it goes through.

    Parameters
    ----------
    map : LabelledMap
        Its cells lie in the frame of the drive's poses.
    drive : Trajectory
        With the true place of each step, -1 where unknown, or without labels.
    """

    map: LabelledMap
    drive: Trajectory

    @property
    def building(self) -> str | None:
        """The building of the drive, or of its map if the drive names none."""
        return self.drive.building or self.map.building
