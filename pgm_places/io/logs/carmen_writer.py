"""Writing a trajectory as a CARMEN log."""

import gzip
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.io.atomic import write_bytes
from pgm_places.trajectories.scan import ScanGeometry
from pgm_places.trajectories.trajectory import Trajectory

__all__ = ["write_carmen"]

_RESOLUTION_M = 0.001


def write_carmen(path: Path | str, trajectory: Trajectory) -> Path:
    """The path, once the log is written; compressed where the name ends in ``.gz``.

    Parameters
    ----------
    path : path
        Parent folders are made.
    trajectory : Trajectory
        With scans. Those of a scanner over a half circle, as
        :meth:`~pgm_places.trajectories.scan.ScanGeometry.half_circle` makes it, become ``FLASER``
        lines, which every reader knows; other evenly spaced beams become ``ROBOTLASER1`` lines,
        which say where the beams point. Each is preceded by an ``ODOM`` line.

    Poses and times are written so that they are read back bit for bit, ranges in millimetres. A
    log holds neither labels nor a shortest range.

    Raises
    ------
    InputError
        There are no scans, or their beams are not evenly spaced.
    OutputError
        The file cannot be written; nothing is left half-written.
    """
    text = "\n".join(_lines(trajectory)) + "\n"
    data = text.encode("ascii")
    if Path(path).suffix == ".gz":
        data = gzip.compress(data, compresslevel=6, mtime=0)  # the same log, the same bytes
    return write_bytes(path, data)


def _lines(trajectory: Trajectory) -> Iterator[str]:
    ranges, geometry = trajectory.ranges_m, trajectory.geometry
    if ranges is None or geometry is None:
        raise InputError(
            f"{trajectory.name} has no scans to write as a CARMEN log; a table of its poses can be "
            "written as .csv"
        )
    reach = geometry.range_max_m
    odometry = trajectory.poses if trajectory.odometry is None else trajectory.odometry
    head, tail = _message_ends(geometry)
    yield "# message formats defined: PARAM ODOM FLASER RLASER ROBOTLASER1 ROBOTLASER2"
    yield f"PARAM robot_front_laser_max {reach!r} 0 nohost 0"
    readings = _in_millimetres(ranges, geometry)
    times = trajectory.times_s.tolist()
    start = times[0] if times else 0.0
    steps = zip(times, trajectory.poses.tolist(), odometry.tolist(), readings, strict=True)
    for time, pose, wheels, row in steps:
        stamp = f"{time!r} nohost {time - start!r}"
        yield f"ODOM {_numbers(wheels)} 0 0 0 {stamp}"
        beams = " ".join([f"{value:.3f}" for value in row.tolist()])
        yield f"{head} {beams} {tail[0]}{_numbers(pose)} {_numbers(wheels)} {tail[1]}{stamp}"


def _numbers(values: list[float]) -> str:
    return " ".join(map(repr, values))


def _message_ends(geometry: ScanGeometry) -> tuple[str, tuple[str, str]]:
    """What a message has before its readings, after them, and after its poses."""
    n_beams, reach = geometry.n_beams, geometry.range_max_m
    front = ScanGeometry.half_circle(n_beams, range_max_m=reach, range_min_m=geometry.range_min_m)
    if geometry.same_as(front):
        return f"FLASER {n_beams}", ("", "")
    start, spacing = float(geometry.angles_rad[0]), geometry.spacing_rad
    if spacing is None:
        raise InputError(
            f"a CARMEN log can only hold evenly spaced beams, and those of {geometry} are not; "
            "choose another format or other beams"
        )
    span = spacing * n_beams
    head = f"ROBOTLASER1 0 {start!r} {span!r} {spacing!r} {reach!r} 0.01 0 {n_beams}"
    return head, ("0 ", "0 0 0 0 0 ")


def _in_millimetres(ranges_m: NDArray[np.float32], geometry: ScanGeometry) -> NDArray[np.float64]:
    """Rounded ranges; one with a return stays below the maximum range."""
    rounded = np.round(ranges_m.astype(np.float64), 3)
    # Rounding must not turn a wall just within reach into "nothing seen", nor the other way round.
    below = np.ceil(geometry.range_max_m / _RESOLUTION_M - 1e-6) * _RESOLUTION_M - _RESOLUTION_M
    met: NDArray[np.float64] = np.clip(rounded, None, below)
    longest = np.ceil(geometry.range_max_m / _RESOLUTION_M - 1e-6) * _RESOLUTION_M
    return np.where(geometry.returned(ranges_m), met, longest)
