"""Log files: their lines, and the trajectory that they hold, with warnings."""

import gzip
import io
import os
import time
import zlib
from array import array
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import IO, BinaryIO, TypeVar

import numpy as np

from pgm_places.errors import LogError
from pgm_places.io.input_file import open_input
from pgm_places.trajectories.scan import Scan, ScanGeometry
from pgm_places.trajectories.trajectory import Trajectory

__all__ = ["LogLines", "follow_files", "follow_lines"]

MAX_LINE = 4 << 20
"""The longest line in bytes: a scan of half a million beams."""
MAX_BYTES = 4 << 30
"""The largest log in bytes, unpacked."""
AnyBytes = TypeVar("AnyBytes", bytes, bytearray)
_GZIP_MAGIC = b"\x1f\x8b"


class LogLines:
    """The lines of a file or a pipe, plain or gzip by its first bytes, not by its name.

    If the compressed data are truncated or damaged, the lines before that point are yielded, and
    :attr:`damage` then holds the reason. At most 4 GiB unpacked, and 4 MiB a line.
    """

    def __init__(self, path: Path | str, *, _max_bytes: int = MAX_BYTES) -> None:
        self.path, self._max_bytes = Path(path), _max_bytes
        self.damage: str | None = None
        """The damage of the compressed data, once the lines have been read; else None."""

    def __iter__(self) -> Iterator[bytes]:
        self.damage = None
        try:
            with open_input(self.path, LogError, "a CARMEN log", pipes=True) as raw:
                if raw.peek(2)[:2] == _GZIP_MAGIC:
                    with gzip.GzipFile(fileobj=raw) as unpacked:
                        yield from self._bounded(io.BufferedReader(unpacked))
                else:
                    yield from self._bounded(raw)
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            cut = isinstance(error, EOFError)
            self.damage = "the compressed data are truncated" if cut else f"damaged data: {error}"
        except OSError as error:
            reason = error.strerror or str(error)
            raise LogError(f"{self.path}: cannot be read: {reason}") from None

    def _bounded(self, stream: IO[bytes]) -> Iterator[bytes]:
        n_bytes = 0
        while line := stream.readline(MAX_LINE + 1):
            n_bytes += len(line)
            if n_bytes > self._max_bytes:
                allowed = f"{self._max_bytes} bytes when unpacked"
                raise LogError(f"{self.path}: more than {allowed}; split it")
            yield _checked(line, str(self.path))


def follow_lines(
    stream: BinaryIO, *, poll_s: float | None = 0.2, is_over: Callable[[], bool] = lambda: False
) -> Iterator[bytes]:
    """Complete lines of a growing file or of standard input, as they arrive.

    Parameters
    ----------
    stream : binary file
        An open plain file, or ``sys.stdin.buffer``. It is read line by line, never ahead.
    poll_s : float or None
        At the end of the data, read again after this many seconds, for a growing file. None stops
        there, for a pipe, whose end is final.
    is_over : callable
        Called at each end of the data; true ends the lines.

    A last line without a newline is yielded once the data are certain to end. A line of more than
    4 MiB is a LogError.
    """
    part = bytearray()
    while True:
        piece = stream.readline(MAX_LINE + 1)
        part += piece
        if part.endswith(b"\n"):
            yield bytes(part)
            part.clear()
        elif not piece:
            if poll_s is None or is_over():
                break
            time.sleep(poll_s)
        _checked(part, "the log")
    if part:
        yield bytes(part)


def follow_files(path: Path, *, poll_s: float = 0.2) -> Iterator[Iterator[bytes]]:
    """The lines of a growing file, and of every file that replaces it under its name.

    A log may be truncated and restarted, or moved away and replaced (as logrotate does). The rest
    of the old file is yielded first, then the new one from its beginning.
    """
    while True:
        with open_input(path, LogError, "a log") as stream:
            yield _until_replaced(path, stream, poll_s)


def _until_replaced(path: Path, stream: BinaryIO, poll_s: float) -> Iterator[bytes]:
    """The lines of one file until it is replaced; an incomplete last line is dropped."""
    ends = partial(_is_replaced, path, stream)
    for line in follow_lines(stream, poll_s=poll_s, is_over=ends):
        if line.endswith(b"\n") or not ends():
            yield line


def _is_replaced(path: Path, stream: IO[bytes]) -> bool:
    """Whether another file has the name now, or the file is shorter than the read position."""
    ours = os.fstat(stream.fileno())
    if ours.st_size < stream.tell():
        return True
    try:
        named = path.stat()
    except FileNotFoundError:
        return False  # moved away; the next one does not exist yet
    return (named.st_dev, named.st_ino) != (ours.st_dev, ours.st_ino)


def _checked(line: AnyBytes, where: str) -> AnyBytes:
    if len(line) > MAX_LINE:
        raise LogError(f"{where}: a line has more than {MAX_LINE} bytes; is it a CARMEN log?")
    return line


MAX_SCANS = 5_000_000
MAX_READINGS = 500_000_000
_MAX_KINDS = 1000

# Walls never give such a share of readings of exactly the same distance, the longest of all.
_CODE_SHARE = 0.005
_CODE_READINGS = 20


@dataclass(frozen=True)
class LoadedLog:
    """A trajectory, with warnings about its file and counts of its messages.

    Parameters
    ----------
    trajectory : Trajectory
    path : Path
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
    """

    def __init__(self, path: Path, most_scans: int = MAX_SCANS) -> None:
        self.path, self._most_scans = path, most_scans
        self.n_scans = self._n_readings = 0
        self._kinds: dict[int, _Kind] = {}

    def add(self, scan: Scan) -> None:
        """Add a scan; too many scans, readings or kinds of beams are a LogError."""
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
