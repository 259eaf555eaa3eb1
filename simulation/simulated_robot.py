"""SimulatedRobot: simulated drives through a map, with scans and odometry."""

from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array, require_shape
from pgm_places._core import add_noise
from pgm_places.errors import InputError
from pgm_places.maps.occupancy_grid import UNKNOWN, OccupancyGrid
from pgm_places.options import option_hints
from pgm_places.sensing._cell_caster import Cells, Noise
from pgm_places.sensing.ray_casting import cast_poses
from pgm_places.sensing.sensor import SensorNoise
from pgm_places.simulation.odometry_noise import OdometryNoise
from pgm_places.simulation.path_planning import PathPlanner
from pgm_places.simulation.robot_options import LaserOptions, RobotMotion
from pgm_places.trajectories.scan import ScanGeometry
from pgm_places.trajectories.trajectory import Trajectory

_PIECE_M = 0.05

_MOST_SCANS = 10_000_000

_LONGEST_M = 500e3
"""Longest path; a longer one would not fit into memory."""


@dataclass(frozen=True, eq=False)
class SimulatedRobot(RobotMotion):
    """A round robot with a laser in its middle.

    Its other options are those of
    :class:`~pgm_places.simulation.robot_options.RobotMotion`.

    Parameters
    ----------
    geometry : ScanGeometry
        The laser's beams; by default 180 over the half circle ahead, up to 30 m.
    sensor_noise : SensorNoise or None
        Errors of the laser; None for exact ranges.
    odometry_noise : OdometryNoise or None
        Errors of the wheels; None for a trajectory without odometry.

    Raises
    ------
    ConfigError
        A size, speed or time is not positive.

    Examples
    --------
    >>> grid = OccupancyGrid(np.zeros((20, 60)), resolution_m=0.1)
    >>> robot = SimulatedRobot(ScanGeometry.full_circle(8, range_max_m=5.0))
    >>> robot.drive(grid, [[1.0, 1.0], [5.0, 1.0]])
    Trajectory('simulated', 51 steps, 4 m, 8 beams)
    """

    geometry: ScanGeometry = field(default_factory=ScanGeometry.half_circle)
    sensor_noise: SensorNoise | None = None
    odometry_noise: OdometryNoise | None = None

    @classmethod
    def of(
        cls, motion: RobotMotion, laser: LaserOptions, odometry_noise: OdometryNoise | None = None
    ) -> Self:
        """A robot with options of motion and laser."""
        moves = {name: getattr(motion, name) for name in option_hints(RobotMotion)}
        return cls(laser.geometry(), laser.noise(), odometry_noise, **moves)

    def drive(
        self, grid: OccupancyGrid, stops_m: ArrayLike, *, name: str = "simulated"
    ) -> Trajectory:
        """The trajectory of a drive from stop to stop (S, 2) on planned paths.

        Raises
        ------
        InputError
            There are fewer than two stops, or the robot does not fit at one.
        """
        stops = finite_array("stops_m", stops_m, ("S", 2))
        planner = PathPlanner(grid, radius_m=self.radius_m)
        return self.follow(grid, planner.way(*stops), name=name)

    def explore(
        self,
        grid: OccupancyGrid,
        *,
        start_m: ArrayLike | None = None,
        spacing_m: float = 3.0,
        max_length_m: float | None = None,
        window: ArrayLike | None = None,
        seed: int = 0,
        name: str = "simulated",
    ) -> Trajectory:
        """The trajectory of a coverage tour through all reachable free space.

        Parameters
        ----------
        grid : OccupancyGrid
            The map.
        start_m : (2,), optional
            The start; a random position, drawn with the seed, by default.
        spacing_m : float
            Largest distance of cells from the tour's nearest stop.
        max_length_m : float, optional
            The tour ends after this distance.
        window : (H, W) bool, optional
            The cells that the robot stays in; its laser sees all of the map.
        seed : int
            Seed of the start.
        name : str
            Name of the trajectory.

        Raises
        ------
        InputError
            The robot fits nowhere, or not at the start, or the window has another shape.
        """
        planner = PathPlanner(_inside(grid, window), radius_m=self.radius_m)
        rng = np.random.default_rng(seed)
        way = planner.tour(start_m=start_m, spacing_m=spacing_m, rng=rng)
        if max_length_m is not None:
            along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))])
            way = way[: max(2, int(np.searchsorted(along, max_length_m, "right")))]
        return self.follow(grid, way, name=name)

    def follow(
        self, grid: OccupancyGrid, way_m: ArrayLike, *, name: str = "simulated"
    ) -> Trajectory:
        """The trajectory along a path of points (P, 2)."""
        times, poses = self._motion(finite_array("way_m", way_m, ("P", 2)))
        trajectory = Trajectory(times, poses, name=name)
        noise = self.odometry_noise
        if noise is not None:
            trajectory = replace(trajectory, odometry=noise.odometry(poses))
        return scans_along(grid, trajectory, self.geometry, noise=self.sensor_noise)

    def _motion(
        self, way_m: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times and poses: the robot drives and turns at once, the slower motion sets the pace."""
        legs = np.diff(way_m, axis=0)
        lengths = np.hypot(legs[:, 0], legs[:, 1])
        moving = lengths > 0
        if not moving.any():
            raise InputError("a path needs at least two different points")
        if not lengths.sum() <= _LONGEST_M:
            raise InputError(f"a path must be at most {_LONGEST_M:g} m long, got {lengths.sum():g}")
        points = _finely(np.concatenate([way_m[:1], way_m[1:][moving]]))
        legs = np.diff(points, axis=0)
        headings = np.unwrap(np.arctan2(legs[:, 1], legs[:, 0]))
        headings = np.concatenate([headings, headings[-1:]])
        driving = np.hypot(legs[:, 0], legs[:, 1]) / self.speed_m_s
        turning = np.abs(np.diff(headings)) / self.turn_rad_s
        passed = np.concatenate([[0.0], np.cumsum(np.maximum(driving, turning))])
        n_scans = passed[-1] / self.scan_every_s
        if not n_scans <= _MOST_SCANS:
            raise InputError(
                f"a drive of {passed[-1]:g} s with a scan every {self.scan_every_s:g} s has "
                f"{n_scans:.2g} scans, more than {_MOST_SCANS:,}; give a larger scan_every_s"
            )
        times = np.arange(0.0, passed[-1] + self.scan_every_s, self.scan_every_s)
        x, y, heading = (np.interp(times, passed, values) for values in (*points.T, headings))
        heading = np.mod(heading + np.pi, 2 * np.pi) - np.pi
        return times, np.column_stack([x, y, heading])


def _inside(grid: OccupancyGrid, window: ArrayLike | None) -> OccupancyGrid:
    """The map with unknown cells outside the window."""
    if window is None:
        return grid
    inside = np.asarray(window, np.bool_)
    require_shape("window", inside.shape, grid.shape, of="the map's")
    return replace(grid, cells=np.where(inside, grid.cells, UNKNOWN))


def _finely(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The path with more points, so that turns take place only at its corners."""
    legs = np.diff(points, axis=0)
    pieces = np.ceil(np.hypot(legs[:, 0], legs[:, 1]) / _PIECE_M).astype(np.int64)
    leg = np.repeat(np.arange(len(legs)), pieces)
    piece = np.arange(len(leg)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    inner = points[leg] + legs[leg] * (piece / pieces[leg])[:, None]
    return np.concatenate([inner, points[-1:]])


def scans_along(
    grid: OccupancyGrid,
    trajectory: Trajectory,
    geometry: ScanGeometry,
    *,
    noise: SensorNoise | None = None,
) -> Trajectory:
    """A trajectory with scans simulated in a map of its frame.

    Parameters
    ----------
    grid : OccupancyGrid
        The map; beams end at obstacles and at unknown space. A pose inside a wall or off the map
        reads 0, or "no return" if the sensor has a shortest range.
    trajectory : Trajectory
        Poses in the map's frame.
    geometry : ScanGeometry
        The sensor.
    noise : SensorNoise, optional
        Its noise; a step's noise depends only on the seed and the step's number.

    Examples
    --------
    >>> grid = OccupancyGrid([[0, 0, 0, 100]], resolution_m=0.1)
    >>> path = Trajectory([0.0], [[0.12, 0.05, 0.0]])
    >>> scans_along(grid, path, ScanGeometry([0.0, np.pi], 5.0)).ranges_m.round(2)
    array([[0.18, 0.12]], dtype=float32)
    """
    reach = geometry.range_max_m
    ranges = cast_poses(grid, trajectory.poses, geometry.angles_rad, max_range_m=reach)
    if noise is not None and not noise.is_silent:
        steps = np.arange(len(ranges))  # each scan has its own cell number
        cells = Cells(steps, np.zeros_like(steps), steps.astype(np.int32))
        add_noise(ranges, cells, Noise.of(noise, reach))
    return trajectory.with_scans(geometry.cleaned(ranges), geometry)
