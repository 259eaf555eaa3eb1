"""Reading and writing trajectories in any supported format."""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from pgm_places.errors import InputError, LogError
from pgm_places.io.input_file import file_kind, user_path
from pgm_places.io.logs.bag_access import is_bag
from pgm_places.io.logs.log_files import LoadedLog
from pgm_places.trajectories.trajectory import Trajectory


def read_trajectory(
    path: Path | str,
    *,
    laser: Literal["front", "rear"] = "front",
    range_max_m: float | None = None,
    label_column: str | None = None,
    label_names: Sequence[str] | None = None,
    scan_topic: str | None = None,
    pose_topic: str | None = None,
    fixed_frame: str | None = None,
) -> LoadedLog:
    """The trajectory in a file, with warnings about the file.

    Parameters
    ----------
    path : path
        A CARMEN log, plain or gzip (:func:`~pgm_places.io.logs.carmen.read_carmen`); a ROS bag, a
        file (``.bag``, ``.mcap``) or a folder (:func:`~pgm_places.io.logs.bags.read_bag`); or a
        table of poses whose name ends in ``.csv``
        (:func:`~pgm_places.io.logs.pose_csv.read_pose_csv`).
    laser
        For CARMEN logs; see ``read_carmen``.
    range_max_m
        For logs and bags: readings of at least this mean no return.
    scan_topic, pose_topic, fixed_frame
        For bags; see ``read_bag``.
    label_column, label_names
        For tables; see ``read_pose_csv``.

    Raises
    ------
    LogError
        The file is missing, damaged, or holds no trajectory.
    """
    path = user_path(path, LogError)
    if file_kind(path) is None:
        raise LogError(f"{path}: no such file; expected a log, a bag or a table of poses")
    if path.suffix.lower() == ".csv":
        from pgm_places.io.logs.pose_csv import read_pose_csv

        return read_pose_csv(path, label_column=label_column, label_names=label_names)
    if is_bag(path):
        from pgm_places.io.logs.bags import read_bag

        return read_bag(
            path,
            scan_topic=scan_topic,
            pose_topic=pose_topic,
            fixed_frame=fixed_frame,
            range_max_m=range_max_m,
        )
    if file_kind(path) == "folder":
        raise LogError(f"{path} is a folder without a metadata.yaml, so it is not a ROS 2 bag")
    from pgm_places.io.logs.carmen import read_carmen

    return read_carmen(path, laser=laser, range_max_m=range_max_m)


def write_trajectory(path: Path | str, trajectory: Trajectory) -> Path:
    """Write a trajectory in the format of its file name; returns the path.

    ``.log`` and ``.log.gz`` are CARMEN logs
    (:func:`~pgm_places.io.logs.carmen.write_carmen`), ``.csv`` a table of times, poses and
    labels (:func:`~pgm_places.io.logs.pose_csv.write_pose_csv`), ``.bag``, ``.mcap`` and names
    without an ending ROS bags (:func:`~pgm_places.io.logs.bag_writer.write_bag`).

    Raises
    ------
    InputError
        The name has another ending, or the format cannot hold the trajectory.
    OutputError
        The file cannot be written; no partial file remains.
    """
    path = Path(path)
    check_name(path)
    if _is_carmen(path):
        from pgm_places.io.logs.carmen import write_carmen

        return write_carmen(path, trajectory)
    if path.suffix.lower() == ".csv":
        from pgm_places.io.logs.pose_csv import write_pose_csv

        return write_pose_csv(path, trajectory)
    from pgm_places.io.logs.bag_writer import write_bag

    return write_bag(path, trajectory)


def check_name(path: Path | str) -> None:
    """Refuse a name whose ending is not a trajectory format."""
    path = Path(path)
    if not _is_carmen(path) and path.suffix.lower() not in ("", ".csv", ".bag", ".mcap"):
        raise InputError(
            "a trajectory can be written as .log, .log.gz, .csv, .bag, .mcap, or as the folder of "
            f"a ROS 2 bag (no ending), but the name is {path.name!r}"
        )


def _is_carmen(path: Path) -> bool:
    return path.name.lower().removesuffix(".gz").endswith(".log")
