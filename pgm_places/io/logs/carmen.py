"""CARMEN logs: one message per line, the format of most public laser data sets.

Lines that carry poses or scans (the last three fields of each are two time stamps with the
computer's name between them)::

    FLASER  n r_1 ... r_n  x y heading  odom_x odom_y odom_heading  time host logged
    RLASER  the same, of a laser that faces back
    ROBOTLASER1 type start fov step max_range accuracy remission n r_1 ... r_n k s_1 ... s_k
                laser_x laser_y laser_heading robot_x robot_y robot_heading
                tv rv forward_safety side_safety turn_axis  time host logged
    ROBOTLASER2 the same, of a laser that faces back
    ODOM    x y heading tv rv accel  time host logged
    PARAM   name value  time host logged

Every other line is counted and skipped.
"""

import gzip
from array import array
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from math import isfinite
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import FARTHEST_M
from pgm_places.errors import InputError, LogError
from pgm_places.io.atomic import write_bytes
from pgm_places.io.input_file import user_path
from pgm_places.io.logs import log_files
from pgm_places.io.logs.log_files import LogLines
from pgm_places.options import Positive, check_option
from pgm_places.trajectories.scan import Scan, ScanGeometry
from pgm_places.trajectories.trajectory import Trajectory

_RESOLUTION_M = 0.001


def write_carmen(path: Path | str, trajectory: Trajectory) -> Path:
    """Write a CARMEN log, compressed if the name ends in ``.gz``; returns its path.

    Parameters
    ----------
    path : path
        Parent folders are created.
    trajectory : Trajectory
        With scans. Those of a scanner over a half circle, as
        :meth:`~pgm_places.trajectories.scan.ScanGeometry.half_circle` makes it, become ``FLASER``
        lines, which every reader supports; other evenly spaced beams become ``ROBOTLASER1`` lines,
        which contain the beams' directions. Each is preceded by an ``ODOM`` line.

    Poses and times are written so that they are read back bit for bit, ranges in millimetres. A
    log holds neither labels nor a shortest range.

    Raises
    ------
    InputError
        There are no scans, or their beams are not evenly spaced.
    OutputError
        The file cannot be written; no partial file remains.
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
    """The text of a message before its readings, after them, and after its poses."""
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
    # Rounding must not turn a wall just within reach into "no return", or the reverse.
    longest = np.ceil(geometry.range_max_m / _RESOLUTION_M - 1e-6) * _RESOLUTION_M
    met: NDArray[np.float64] = np.clip(rounded, None, longest - _RESOLUTION_M)
    return np.where(geometry.returned(ranges_m), met, longest)


Laser = Literal["front", "rear"]

_LASERS: dict[Laser, tuple[bytes, bytes]] = {
    "front": (b"FLASER", b"ROBOTLASER1"),
    "rear": (b"RLASER", b"ROBOTLASER2"),
}

_KNOWN = {b"ODOM", b"PARAM", *(kind for kinds in _LASERS.values() for kind in kinds)}

_MAX_WORDS, _LONGEST_WORD = 1000, 40

_LONGEST_M = 81.83
"""Limit of the SICK LMS in centimetre mode; larger readings are codes (error, no return)."""


@dataclass
class CarmenReader:
    """Parses a log line by line and counts unusable lines.

    Parameters
    ----------
    laser : {"front", "rear"}
        Which of the robot's lasers to read.
    range_max_m : float or None
        Readings of at least this mean no return. None takes it from the message
        (``ROBOTLASER1``), else from the log's parameter ``robot_front_laser_max`` (or ``rear``),
        else 81.83 m.

    Examples
    --------
    >>> reader = CarmenReader()
    >>> scan = reader.scan(b"FLASER 3 1.5 2.0 81.91 0.1 0.2 0.3 0.1 0.2 0.3 7.5 host 7.5")
    >>> scan.ranges_m, scan.time_s
    (array([ 1.5 ,  2.  , 81.83], dtype=float32), 7.5)
    >>> reader.scan(b"SYNC laser"), dict(reader.counts)
    (None, {'FLASER': 1, 'SYNC': 1})
    """

    laser: Laser = "front"
    range_max_m: float | None = None
    counts: Counter[str] = field(default_factory=Counter)
    """Lines per first word, comments and empty lines left out."""
    n_damaged: int = 0
    """Lines of a known kind whose fields could not be read."""
    odometry: "array[float]" = field(default_factory=lambda: array("d"), repr=False)
    """time, x, y, heading of one ODOM line after the other, where :attr:`keep_odometry` is set."""
    keep_odometry: bool = False
    _limit_m: float | None = None
    _geometries: dict[tuple[float | int, ...], ScanGeometry] = field(
        default_factory=dict, repr=False
    )

    def __post_init__(self) -> None:
        check_option("laser", Laser, self.laser)
        check_option("range_max_m", Positive | None, self.range_max_m)

    def scan(self, line: bytes) -> Scan | None:
        """The scan of a line; None for other or unreadable lines."""
        fields = line.split()
        if not fields or fields[0].startswith(b"#"):
            return None
        kind = fields[0]
        word = kind[:_LONGEST_WORD].decode("ascii", "replace")
        self.counts[word if word in self.counts or len(self.counts) < _MAX_WORDS else "other"] += 1
        if kind not in _KNOWN:
            return None
        plain, described = _LASERS[self.laser]
        try:
            if kind == plain:
                return self._plain_scan(fields)
            if kind == described:
                return self._described_scan(fields)
            if kind == b"PARAM":
                self._take_parameter(fields)
            elif kind == b"ODOM" and self.keep_odometry:
                x, y, heading = _pose(fields[1:4])
                self.odometry.extend((_finite(fields[7:8])[0], x, y, heading))
        except (ValueError, IndexError):
            self.n_damaged += 1
        return None

    def _take_parameter(self, fields: list[bytes]) -> None:
        if fields[1] == f"robot_{self.laser}_laser_max".encode():
            limit = float(fields[2])
            self._limit_m = limit if isfinite(limit) and limit > 0 else None

    def _plain_scan(self, fields: list[bytes]) -> Scan:
        n_beams = int(fields[1])
        limit = self.range_max_m or self._limit_m or _LONGEST_M
        rest = fields[2 + n_beams :]
        if n_beams < 1 or len(rest) < 7:
            raise ValueError
        key = (n_beams, limit)
        if key not in self._geometries:
            self._geometries[key] = ScanGeometry.half_circle(n_beams, range_max_m=limit)
        return _scan(self._geometries[key], fields[2 : 2 + n_beams], rest[:6], rest[6])

    def _described_scan(self, fields: list[bytes]) -> Scan:
        start, _, spacing, reach = _finite(fields[2:6])
        n_beams = int(fields[8])
        n_remissions = int(fields[9 + n_beams])
        rest = fields[10 + n_beams + n_remissions :]
        if n_beams < 1 or n_remissions < 0 or len(rest) < 12:
            raise ValueError
        limit = self.range_max_m or reach
        key = (n_beams, limit, start, spacing)
        if key not in self._geometries:
            angles = start + spacing * np.arange(n_beams, dtype=np.float64)
            self._geometries[key] = ScanGeometry(angles, range_max_m=limit)
        return _scan(self._geometries[key], fields[9 : 9 + n_beams], rest[:6], rest[11])


def _finite(fields: list[bytes]) -> tuple[float, ...]:
    numbers = tuple(map(float, fields))
    if not all(map(isfinite, numbers)):
        raise ValueError
    return numbers


def _pose(fields: list[bytes]) -> tuple[float, ...]:
    """A pose as finite numbers within the limits of a robot's pose."""
    numbers = _finite(fields)
    if any(abs(number) > FARTHEST_M for number in numbers):
        raise ValueError
    return numbers


def _scan(geometry: ScanGeometry, readings: list[bytes], poses: list[bytes], time: bytes) -> Scan:
    place, wheels = np.array(_pose(poses)).reshape(2, 3)
    ranges = geometry.cleaned(list(map(float, readings)))
    return Scan(_finite([time])[0], place, ranges, geometry, wheels)


def iter_carmen_scans(
    lines: Iterable[bytes], *, reader: CarmenReader | None = None
) -> Iterator[Scan]:
    """The scans among the lines of a log, one by one as the lines come.

    The lines are those of a file opened in binary mode, of
    :class:`~pgm_places.io.logs.log_files.LogLines`, or of a growing file
    (:func:`~pgm_places.io.logs.log_files.follow_lines`). The reader chooses laser and limit, and
    counts the lines that are not scans. Scans may differ in their number of beams: each carries its
    geometry.
    """
    reader = reader or CarmenReader()
    for line in lines:
        scan = reader.scan(line)
        if scan is not None:
            yield scan


def read_carmen(
    path: Path | str, *, laser: Laser = "front", range_max_m: float | None = None
) -> log_files.LoadedLog:
    """The trajectory in a CARMEN log, plain or gzip, with warnings about the file.

    Parameters
    ----------
    path : path
        The log.
    laser : {"front", "rear"}
        Which of the robot's lasers.
    range_max_m : float, optional
        Readings of at least this mean no return; see :class:`CarmenReader`.

    Poses are the laser's; the odometry of the same lines is stored if it differs. Imperfect files
    are read as far as possible, with a warning: up to the point where compressed data are truncated
    or damaged; only the most frequent kind of scans if the number of beams changes; the ``ODOM``
    lines as a trajectory without scans if the log has no scans.

    Raises
    ------
    LogError
        The file cannot be read, or holds neither scans nor odometry.
    InputError
        An option is invalid.
    """
    path = user_path(path, LogError)
    lines = LogLines(path)
    reader = CarmenReader(laser, range_max_m, keep_odometry=True)
    scans = log_files.ScanColumns(path)
    for scan in iter_carmen_scans(lines, reader=reader):
        scans.add(scan)
    warnings = []
    if lines.damage:
        warnings.append(f"{lines.damage}; everything before it was read ({scans.n_scans} scans)")
    if reader.n_damaged:
        lines_are = "line" if reader.n_damaged == 1 else "lines"
        warnings.append(
            f"{reader.n_damaged} damaged {lines_are} could not be read and were skipped"
        )
    name = path.name.removesuffix(".gz").removesuffix(".log")
    if scans.n_scans:
        trajectory, left_out = scans.trajectory(name)
        odometry = trajectory.odometry
        if odometry is not None and np.array_equal(odometry, trajectory.poses):
            trajectory = replace(trajectory, odometry=None)  # as in logs that were corrected
        warnings += left_out
        if range_max_m is None:
            warnings += log_files.code_warnings(trajectory)
    else:
        trajectory = _odometry_only(reader, path, name)
        kinds = " and ".join(kind.decode() for kind in _LASERS[laser])
        warnings.append(
            f"no scans of the {laser} laser ({kinds} lines); the {len(trajectory)} ODOM lines make "
            "a trajectory without scans"
        )
    warnings += log_files.order_warnings(trajectory)
    return log_files.LoadedLog(trajectory, path, tuple(warnings), reader.counts)


def _odometry_only(reader: CarmenReader, path: Path | str, name: str) -> Trajectory:
    if not reader.odometry:
        kinds = ", ".join(f"{count} {kind[:20]}" for kind, count in reader.counts.most_common(5))
        raise LogError(
            f"{path} holds no readable laser scans or odometry "
            f"(lines: {kinds or 'none'}); is it a complete CARMEN log?"
        )
    rows = np.frombuffer(reader.odometry).reshape(-1, 4)
    if len(rows) > log_files.MAX_SCANS:
        raise LogError(f"{path}: more than {log_files.MAX_SCANS} ODOM lines; split it")
    return Trajectory(rows[:, 0], rows[:, 1:], name=name)
