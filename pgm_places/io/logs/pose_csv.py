"""Tables of poses: one step per line, with columns found by name."""

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import LabelError, LogError
from pgm_places.io.atomic import write_text
from pgm_places.io.logs.loaded_log import LoadedLog, order_warnings
from pgm_places.io.text_file import read_text
from pgm_places.trajectories.trajectory import Trajectory, headings_along

__all__ = ["read_pose_csv", "write_pose_csv"]

MAX_BYTES = 1 << 30
_TIME = ("t_s", "time_s", "timestamp", "time", "t")
_X = ("x_m", "x")
_Y = ("y_m", "y")
_HEADING = ("heading_rad", "yaw_rad", "theta_rad", "heading", "yaw", "theta")
_HEADING_DEGREES = ("heading_deg", "yaw_deg", "theta_deg")
_LABEL = ("label", "place")


@dataclass(frozen=True)
class _Table:
    path: Path
    names: list[str]
    rows: list[list[str]]

    def index(self, *names: str) -> int | None:
        """The first of the names that is a column."""
        return next((self.names.index(name) for name in names if name in self.names), None)

    def required(self, what: str, names: Sequence[str]) -> int:
        column = self.index(*names)
        if column is None:
            raise LogError(
                f"{self.path}: no column for {what}: wanted {' or '.join(names)}, the columns are "
                f"{', '.join(self.names) or 'none'}"
            )
        return column

    def numbers(self, column: int) -> NDArray[np.float64]:
        """(T,) the column's values."""
        values = np.empty(len(self.rows))
        for step, row in enumerate(self.rows):
            try:
                values[step] = float(row[column])
            except ValueError:
                values[step] = np.nan
            if not isfinite(values[step]):
                raise LogError(
                    f"{self.path}, row {step + 1} after the heading: {self.names[column]} must be "
                    f"a finite number, got {row[column]!r}"
                )
        return values


def read_pose_csv(
    path: Path | str,
    *,
    label_column: str | None = None,
    label_names: Sequence[str] | None = None,
) -> LoadedLog:
    """The trajectory in a table of comma-separated values with a heading line.

    Parameters
    ----------
    path : path
        UTF-8 text. Columns may come in any order, other columns are ignored:

        - time in seconds: ``t_s``, ``time_s``, ``timestamp``, ``time`` or ``t``; where there is
          none, steps are numbered;
        - position in metres: ``x_m`` or ``x``, ``y_m`` or ``y``;
        - heading: ``heading_rad``, ``yaw_rad``, ``theta_rad``, or these without ``_rad``, in
          radians, or with ``_deg`` in degrees; where there is none, the direction of travel;
        - place: ``label`` or ``place``; an empty field is an unknown place.
    label_column : str, optional
        Another column to take the places from.
    label_names : sequence of str, optional
        The labels in the order of their numbers; the names found, sorted, by default.

    Raises
    ------
    LogError
        The file cannot be read or is not such a table: a column is missing or appears twice, a
        row has a different number of fields, a field is not a number.
    LabelError
        A place is not among ``label_names``.
    """
    table = _read_table(Path(path))
    x = table.numbers(table.required("x in metres", _X))
    y = table.numbers(table.required("y in metres", _Y))
    time_column = table.index(*_TIME)
    times = np.arange(len(x), dtype=np.float64)
    if time_column is not None:
        times = table.numbers(time_column)
    poses = np.column_stack([x, y, _headings(table, x, y)])
    trajectory = Trajectory(times, poses, name=Path(path).stem)
    wanted = _LABEL if label_column is None else (label_column,)
    column = table.index(*wanted)
    if label_column is not None:
        column = table.required("the places", wanted)
    if column is not None:
        trajectory = _labelled(trajectory, table, column, label_names)
    return LoadedLog(
        trajectory, table.path, tuple(order_warnings(trajectory)), {"rows": len(trajectory)}
    )


def _read_table(path: Path) -> _Table:
    text = read_text(path, LogError, "a table of poses (CSV)", max_bytes=MAX_BYTES)
    try:
        lines = [row for row in csv.reader(io.StringIO(text, newline=None), strict=True) if row]
    except csv.Error as error:
        raise LogError(f"{path} is not a table of comma-separated values: {error}") from None
    if not lines:
        raise LogError(f"{path} is empty; expected a line of column names and one row per step")
    names = [name.strip() for name in lines[0]]
    twice = {name for name in names if names.count(name) > 1}
    if twice:
        raise LogError(f"{path}: the column {sorted(twice)[0]!r} appears twice")
    if len(lines) == 1:
        raise LogError(f"{path} has column names but no rows")
    for number, row in enumerate(lines[1:], 1):
        if len(row) != len(names):
            raise LogError(
                f"{path}, row {number} after the heading: {len(row)} fields, but there are "
                f"{len(names)} columns"
            )
    return _Table(path, names, lines[1:])


def _headings(table: _Table, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    column = table.index(*_HEADING)
    if column is not None:
        return table.numbers(column)
    column = table.index(*_HEADING_DEGREES)
    if column is not None:
        return np.deg2rad(table.numbers(column))
    return headings_along(np.column_stack([x, y]))


def _labelled(
    trajectory: Trajectory, table: _Table, column: int, label_names: Sequence[str] | None
) -> Trajectory:
    places = [row[column].strip() for row in table.rows]
    names = sorted(set(places) - {""}) if label_names is None else list(label_names)
    numbers = {name: number for number, name in enumerate(names)} | {"": -1}
    for number, place in enumerate(places, 1):
        if place not in numbers:
            raise LabelError(
                f"{table.path}, row {number} after the heading: {table.names[column]} is "
                f"{place!r}, but the labels are {', '.join(names)}"
            )
    return trajectory.with_labels([numbers[place] for place in places], names)


def write_pose_csv(path: Path | str, trajectory: Trajectory) -> Path:
    """The path, once a trajectory's times, poses and labels are written as such a table.

    Columns ``t_s, x_m, y_m, heading_rad`` and, where there are labels, ``label``; numbers are
    written so that they are read back bit for bit.

    Raises
    ------
    OutputError
        The file cannot be written; nothing is left half-written.
    """
    columns: list[list[object]] = [trajectory.times_s.tolist()]
    columns += [column.tolist() for column in trajectory.poses.T]
    names = ["t_s", "x_m", "y_m", "heading_rad"]
    if trajectory.labels is not None and trajectory.label_names is not None:
        texts = (*trajectory.label_names, "")  # the last one is what -1 points at
        columns.append([texts[label] for label in trajectory.labels.tolist()])
        names.append("label")
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(zip(*columns, strict=True))
    return write_text(path, text.getvalue())
