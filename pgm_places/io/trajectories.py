"""Trajectories from files and to files, whatever their format."""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from pgm_places.errors import InputError, LogError
from pgm_places.io.loaded_log import LoadedLog
from pgm_places.trajectory import Trajectory

__all__ = ["read_trajectory", "write_trajectory"]


def read_trajectory(
    path: Path | str,
    *,
    laser: Literal["front", "rear"] = "front",
    range_max_m: float | None = None,
    label_column: str | None = None,
    label_names: Sequence[str] | None = None,
) -> LoadedLog:
    """The trajectory in a file, with what there is to say about the file.

    Parameters
    ----------
    path : path
        A CARMEN log, plain or gzip (:func:`~pgm_places.io.carmen.read_carmen`), or a table of
        poses whose name ends in ``.csv`` (:func:`~pgm_places.io.pose_csv.read_pose_csv`).
    laser, range_max_m
        For CARMEN logs; see there.
    label_column, label_names
        For tables; see there.

    Raises
    ------
    LogError
        The file is missing, damaged, or holds no trajectory.
    """
    path = Path(path)
    if not path.exists():
        raise LogError(f"cannot read the log {path}: there is no such file; check the path")
    if path.suffix.lower() == ".csv":
        from pgm_places.io.pose_csv import read_pose_csv

        return read_pose_csv(path, label_column=label_column, label_names=label_names)
    from pgm_places.io.carmen import read_carmen

    return read_carmen(path, laser=laser, range_max_m=range_max_m)


def write_trajectory(path: Path | str, trajectory: Trajectory) -> Path:
    """The path, once the trajectory is written in the format that its name asks for.

    ``.log`` and ``.log.gz`` are CARMEN logs (:func:`~pgm_places.io.carmen_writer.write_carmen`),
    ``.csv`` a table of times, poses and labels
    (:func:`~pgm_places.io.pose_csv.write_pose_csv`).

    Raises
    ------
    InputError
        The name ends in something else, or the format cannot hold the trajectory.
    OutputError
        The file cannot be written; nothing is left half-written.
    """
    path = Path(path)
    if path.name.lower().removesuffix(".gz").endswith(".log"):
        from pgm_places.io.carmen_writer import write_carmen

        return write_carmen(path, trajectory)
    if path.suffix.lower() == ".csv":
        from pgm_places.io.pose_csv import write_pose_csv

        return write_pose_csv(path, trajectory)
    raise InputError(
        f"a trajectory can be written as .log, .log.gz or .csv, but the name is {path.name!r}"
    )
