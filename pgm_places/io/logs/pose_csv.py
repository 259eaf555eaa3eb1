"""Pose tables (CSV): one step per line, columns by name."""

import csv
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import FARTHEST_M, plain_names
from pgm_places.errors import LabelError, LogError, quoted
from pgm_places.io.atomic import write_text
from pgm_places.io.csv_table import CsvTable, csv_text, open_table
from pgm_places.io.input_file import user_path
from pgm_places.io.logs.log_files import LoadedLog, order_warnings
from pgm_places.trajectories.path import headings_along
from pgm_places.trajectories.trajectory import Trajectory

MAX_BYTES = 1 << 30
_TIME = ("t_s", "time_s", "timestamp", "time", "t")
_X = ("x_m", "x")
_Y = ("y_m", "y")
_HEADING = ("heading_rad", "yaw_rad", "theta_rad", "heading", "yaw", "theta")
_HEADING_DEGREES = ("heading_deg", "yaw_deg", "theta_deg")
_LABEL = ("label", "place")


def read_pose_csv(
    path: Path | str, *, label_column: str | None = None, label_names: Sequence[str] | None = None
) -> LoadedLog:
    """The trajectory in a table of comma-separated values with a header line.

    Parameters
    ----------
    path : path
        UTF-8 text. Columns may come in any order, other columns are ignored:

        - time in seconds: ``t_s``, ``time_s``, ``timestamp``, ``time`` or ``t``; without such a
          column, steps are numbered;
        - position in metres: ``x_m`` or ``x``, ``y_m`` or ``y``;
        - heading: ``heading_rad``, ``yaw_rad``, ``theta_rad``, or these without ``_rad``, in
          radians, or with ``_deg`` in degrees; without one, the direction of travel;
        - place: ``label`` or ``place``; an empty field is an unknown place.
    label_column : str, optional
        Another column of places.
    label_names : sequence of str, optional
        The labels in the order of their numbers; by default the names in the file, sorted.

    Raises
    ------
    LogError
        The file cannot be read or is not such a table: a column is missing or appears twice, a
        row has a different number of fields, a field is not a number, a pose is beyond 10^7 m.
    LabelError
        A place is not among ``label_names``.
    """
    path = user_path(path, LogError)
    with open_table(path, LogError, "a table of poses (CSV)", max_bytes=MAX_BYTES) as table:
        place = _required(table, "the places", (label_column,)) if label_column else None
        place = table.index(*_LABEL) if label_column is None else place
        columns = _Columns.of(table)
        numbers, texts = table.read(columns.numbers, [] if place is None else [place])
    time, heading, degrees = columns.time, columns.heading, columns.degrees
    values = dict(zip(columns.optional, numbers.T[2:], strict=True))
    times = np.arange(len(numbers), dtype=np.float64) if time is None else values[time]
    if heading is not None:
        headings = values[heading]
    elif degrees is not None:
        headings = np.deg2rad(values[degrees])
    else:
        headings = headings_along(numbers[:, :2])
    poses = np.column_stack([numbers[:, :2], headings])
    far = np.flatnonzero((np.abs(poses) > FARTHEST_M).any(axis=1))
    if len(far):
        raise _too_far(path, int(far[0]) + 1, poses[far[0]])
    trajectory = Trajectory(times, poses, name=path.stem)
    if place is not None:
        trajectory = _labelled(trajectory, table, table.names[place], texts[0], label_names)
    return LoadedLog(trajectory, path, tuple(order_warnings(trajectory)), {"rows": len(trajectory)})


class _Columns(NamedTuple):
    """The columns of a pose table."""

    x: int
    y: int
    time: int | None
    heading: int | None
    degrees: int | None

    @classmethod
    def of(cls, table: CsvTable) -> Self:
        x, y = _required(table, "x in metres", _X), _required(table, "y in metres", _Y)
        heading = table.index(*_HEADING)
        degrees = table.index(*_HEADING_DEGREES) if heading is None else None
        return cls(x, y, table.index(*_TIME), heading, degrees)

    @property
    def optional(self) -> list[int]:
        return [column for column in self[2:] if column is not None]

    @property
    def numbers(self) -> list[int]:
        return [self.x, self.y, *self.optional]


def iter_pose_csv(path: Path, lines: Iterable[bytes]) -> Iterator[tuple[float, NDArray[Any]]]:
    """The time and the pose (3,) of each row of a pose table, as its lines arrive, header first.

    Errors as of :func:`read_pose_csv`, at the offending row.
    """
    table = CsvTable(path, _fields(path, lines), LogError)
    columns = _Columns.of(table)
    before, heading = None, 0.0
    for number, (values, _) in enumerate(table.rows(columns.numbers)):
        values_of = dict(zip(columns.numbers, values, strict=True))
        here = np.array(values[:2])
        if columns.heading is not None:
            heading = values_of[columns.heading]
        elif columns.degrees is not None:
            heading = float(np.deg2rad(values_of[columns.degrees]))
        elif before is not None and (here != before).any():
            heading = float(np.arctan2(*(here - before)[::-1]))
        before = here
        time_s = float(number) if columns.time is None else values_of[columns.time]
        pose = np.array([*here, heading])
        if (np.abs(pose) > FARTHEST_M).any():
            raise _too_far(path, number + 1, pose)
        yield time_s, pose


def _too_far(path: Path, row: int, pose: NDArray[np.float64]) -> LogError:
    """The error of a pose beyond the limits."""
    x, y, heading = pose
    return LogError(
        f"{path}, row {row} after the header: the pose ({x:g}, {y:g}, {heading:g}) must be metres "
        f"and radians up to {FARTHEST_M:g}; correct or remove the row"
    )


def _fields(path: Path, lines: Iterable[bytes]) -> Iterator[list[str]]:
    """The fields of each line that is not empty."""
    try:
        for row in csv.reader(line.decode("utf-8-sig") for line in lines):
            if row:
                yield row
    except (csv.Error, UnicodeDecodeError) as problem:
        raise LogError(f"{path} is not a table of poses (CSV): {quoted(problem)}") from None


def _required(table: CsvTable, what: str, names: Sequence[str]) -> int:
    column = table.index(*names)
    if column is None:
        raise LogError(
            f"{table.path}: no column for {what}: wanted {' or '.join(names)}, the columns are "
            f"{quoted(table.names)}"
        )
    return column


def _labelled(
    trajectory: Trajectory,
    table: CsvTable,
    column: str,
    texts: Sequence[str],
    label_names: Sequence[str] | None,
) -> Trajectory:
    places = [text.strip() for text in texts]
    names = list(label_names or ())
    if label_names is None:
        names = list(plain_names(f"{table.path}: {column}", sorted(set(places) - {""})))
    numbers = {name: number for number, name in enumerate(names)} | {"": -1}
    for number, place in enumerate(places, 1):
        if place not in numbers:
            raise LabelError(
                f"{table.path}, row {number} after the header: {column} is {quoted(place)}, but "
                f"the labels are {', '.join(names)}"
            )
    return trajectory.with_labels([numbers[place] for place in places], names)


def write_pose_csv(path: Path | str, trajectory: Trajectory) -> Path:
    """Write a trajectory's times, poses and labels as a pose table; returns its path.

    Columns ``t_s, x_m, y_m, heading_rad`` and, if it has labels, ``label``; numbers are written so
    that they are read back bit for bit.
    """
    columns: list[list[object]] = [trajectory.times_s.tolist()]
    columns += [column.tolist() for column in trajectory.poses.T]
    names = ["t_s", "x_m", "y_m", "heading_rad"]
    if trajectory.labels is not None and trajectory.label_names is not None:
        texts = (*trajectory.label_names, "")  # index -1 is the last entry
        columns.append([texts[label] for label in trajectory.labels.tolist()])
        names.append("label")
    return write_text(path, csv_text([names, *zip(*columns, strict=True)]))


def with_truth(
    trajectory: Trajectory,
    path: Path,
    label_names: Sequence[str],
    *,
    label_column: str | None = None,
    classes: Mapping[str, str] | None = None,
) -> Trajectory:
    """The trajectory with true places from a table with a row for each step.

    ``classes`` maps the table's names to label names, and other names to unknown places; without
    it, a place that is not among the labels is a LabelError.
    """
    names = None if classes is not None else label_names
    table = read_pose_csv(path, label_column=label_column, label_names=names).trajectory
    if table.labels is None:
        raise LogError(f"{path} has no column of place labels, such as 'label'")
    if len(table) != len(trajectory):
        raise LogError(
            f"{path} has {len(table)} rows but the log {len(trajectory)} steps; give a "
            "table with one row per step, such as 'pgm-places simulate' writes"
        )
    table = translated(table, label_names, classes)
    assert table.labels is not None
    return trajectory.with_labels(table.labels, label_names)


def translated(
    trajectory: Trajectory, label_names: Sequence[str], classes: Mapping[str, str] | None
) -> Trajectory:
    """The trajectory with its places renamed by ``classes``; unknown if not among the labels."""
    own = trajectory.label_names or ()
    chosen = {name: name for name in own if name in label_names} if classes is None else classes
    return trajectory.relabelled(
        {name: chosen[name] for name in own if name in chosen}, label_names
    )
