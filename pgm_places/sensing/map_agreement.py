"""How well a drive agrees with a map: poses on free cells, scan end points on occupied cells.

A drive and a map in different frames, or of different buildings, give confident but meaningless
labels: beams are cast from the wrong positions. Two shares distinguish the cases. On the logs of
building 79 and of the Intel lab, both are above 0.97 on the map of the log. On maps of other
buildings, and for poses moved by 1 m or turned by 10 degrees, at least one is below 0.55.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from pgm_places._checks import finite_array
from pgm_places.errors import InputError
from pgm_places.maps.occupancy_grid import OccupancyGrid, at_cells
from pgm_places.trajectories.trajectory import Trajectory

WARN_BELOW = 0.9
"""Agreement below which a user should check the frames."""

REFUSE_BELOW = 0.5
"""Agreement below which labels are meaningless."""

TOLERANCE_M = 0.3
"""Distance from an occupied cell within which the end point of a beam agrees with the map."""

_MOST_STEPS = 200
_FARTHEST_M = 15.0  # an error of the heading moves the end points of longer beams too far


@dataclass(frozen=True)
class MapAgreement:
    """Agreement of a drive with a map."""

    poses: float  # share of the poses that lie on free cells
    # share of the beams' end points, up to 15 m away, within 0.3 m of an occupied cell; None
    # without scans, or where the map has no occupied cells
    scans: float | None = None

    @property
    def share(self) -> float:
        """The lower of the two shares."""
        return self.poses if self.scans is None else min(self.poses, self.scans)

    def message(self, drive: str, map_name: str) -> str | None:
        """A one-line warning for a poor agreement; None for a good one."""
        if self.share >= WARN_BELOW:
            return None
        scans = (
            "" if self.scans is None else f", {100 * self.scans:.0f} % of its beams end at walls"
        )
        return (
            f"{drive} does not fit {map_name}: {100 * self.poses:.0f} % of its poses lie in free "
            f"space{scans}; check that both are of the same building and in the same frame"
        )


def map_agreement(grid: OccupancyGrid, drive: Trajectory) -> MapAgreement:
    """Agreement of up to 200 steps of a drive with a map; InputError for a drive without steps."""
    if not len(drive):
        raise InputError(f"{drive.name} has no step to compare with a map")
    steps = np.unique(np.linspace(0, len(drive) - 1, _MOST_STEPS).astype(np.int64))
    on_free = on_mask(grid, grid.free, drive.poses[steps, :2]).mean()
    if drive.ranges_m is None or drive.geometry is None:
        return MapAgreement(float(on_free))
    ranges, geometry = drive.ranges_m[steps], drive.geometry
    used = geometry.returned(ranges) & (ranges > geometry.range_min_m) & (ranges < _FARTHEST_M)
    occupied = grid.occupied
    if not used.any() or not occupied.any():
        return MapAgreement(float(on_free))
    x, y, heading = (column[:, None] for column in drive.poses[steps].T)
    angles = heading + geometry.angles_rad
    ends = np.stack([x + ranges * np.cos(angles), y + ranges * np.sin(angles)], axis=-1)[used]
    tolerance = TOLERANCE_M / grid.resolution_m + 1e-6  # tolerance for rounding
    near = ndimage.distance_transform_edt(~occupied) <= tolerance
    return MapAgreement(float(on_free), float(on_mask(grid, near, ends).mean()))


def on_mask(
    grid: OccupancyGrid, mask: NDArray[np.bool_], positions_m: ArrayLike
) -> NDArray[np.bool_]:
    """(N,) whether positions (N, 2) in the map frame lie on marked cells of the map (H, W)."""
    positions = finite_array("positions_m", positions_m, ("N", 2))
    return at_cells(mask, grid.cells_at_m(positions), False)


def check_agreement(
    grid: OccupancyGrid, drive: Trajectory, map_name: str, *, force: bool, otherwise: str
) -> str | None:
    """A warning about a drive that does not fit a map, or None.

    InputError with the advice ``otherwise`` if less than half of poses or scans agree, without
    ``force``.
    """
    agreement = map_agreement(grid, drive)
    message = agreement.message(drive.name, map_name)
    if message is not None and agreement.share < REFUSE_BELOW and not force:
        raise InputError(f"{message}; {otherwise}")
    return message
