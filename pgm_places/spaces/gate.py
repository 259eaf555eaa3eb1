"""Gate: an oriented rectangle, the opening between two segments."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.maps.occupancy_grid import FREE, OccupancyGrid

_FARTHEST = 2.0**40
"""A distance in cells beyond every map."""


@dataclass(frozen=True)
class Gate:
    """An oriented rectangle, the opening between two segments.

    Parameters
    ----------
    centre_m : (float, float)
        Its centre in the map frame.
    heading_rad : float
        The direction of passage in the map frame, in (-pi/2, pi/2].
    width_m : float
        Across the heading, from wall to wall.
    depth_m : float
        Along the heading.
    """

    centre_m: tuple[float, float]
    heading_rad: float
    width_m: float
    depth_m: float

    @property
    def corners_m(self) -> NDArray[np.float64]:
        """(4, 2) corners in the map frame, counter-clockwise.

        Examples
        --------
        >>> Gate((2.0, 1.0), 0.0, width_m=1.0, depth_m=0.2).corners_m.round(2).tolist()
        [[1.9, 0.5], [2.1, 0.5], [2.1, 1.5], [1.9, 1.5]]
        """
        cos, sin = np.cos(self.heading_rad), np.sin(self.heading_rad)
        half = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2 * [self.depth_m, self.width_m]
        return np.asarray(half @ [[cos, sin], [-sin, cos]] + self.centre_m)

    def contains(
        self, points_m: ArrayLike, *, wider_m: float = 0.0, deeper_m: float = 0.0
    ) -> NDArray[np.bool_]:
        """(n,) whether points (n, 2) of the map frame are inside.

        ``wider_m`` and ``deeper_m`` extend the width and the depth at either end.
        """
        along, across = map(np.abs, self.in_frame_m(points_m))
        inside = (along <= self.depth_m / 2 + deeper_m) & (across <= self.width_m / 2 + wider_m)
        return np.asarray(inside)

    def distance_m(self, points_m: ArrayLike) -> NDArray[np.float64]:
        """(n,) distance of points (n, 2) of the map frame from the rectangle; 0 inside.

        Examples
        --------
        >>> Gate((2.0, 1.0), 0.0, width_m=1.0, depth_m=0.5).distance_m([[2, 1.5], [3.25, 1]])
        array([0., 1.])
        """
        along, across = map(np.abs, self.in_frame_m(points_m))
        beyond = np.maximum(along - self.depth_m / 2, 0), np.maximum(across - self.width_m / 2, 0)
        return np.asarray(np.hypot(*beyond))

    def in_frame_m(self, points_m: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(n,) signed distances of points (n, 2) from the centre, along the heading and across."""
        offset = np.asarray(points_m, np.float64).reshape(-1, 2) - self.centre_m
        cos, sin = np.cos(self.heading_rad), np.sin(self.heading_rad)
        return offset @ [cos, sin], offset @ [-sin, cos]

    def cells(
        self, grid: OccupancyGrid, *, wider_m: float = 0.0, deeper_m: float = 0.0
    ) -> NDArray[np.int64]:
        """(n, 2) row and column of the free cells with their centres inside, in row-major order."""
        reach = np.hypot(self.width_m / 2 + wider_m, self.depth_m / 2 + deeper_m)
        low, high = grid.cells_at_m([self.centre_m])[0] + np.array([[-1], [1]]) * (
            int(min(reach / grid.resolution_m, _FARTHEST)) + 1
        )
        low, high = np.maximum(low, 0), np.minimum(high + 1, grid.shape)
        if (low >= high).any():
            return np.empty((0, 2), np.int64)
        part = grid.cells[low[0] : high[0], low[1] : high[1]]
        cells = np.argwhere(part == FREE) + low
        inside = self.contains(grid.cell_centres_m(cells), wider_m=wider_m, deeper_m=deeper_m)
        return np.asarray(cells[inside])
