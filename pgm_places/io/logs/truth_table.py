"""True places of a log's steps, from a table with as many rows."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from pgm_places.errors import LogError
from pgm_places.io.logs.pose_csv import read_pose_csv
from pgm_places.trajectories.trajectory import Trajectory


def with_truth(
    trajectory: Trajectory,
    path: Path,
    label_names: Sequence[str],
    *,
    label_column: str | None = None,
    classes: Mapping[str, str] | None = None,
) -> Trajectory:
    """The trajectory with the true places in a table of as many rows as it has steps.

    Parameters
    ----------
    trajectory : Trajectory
    path : Path
        A table as :func:`pgm_places.io.logs.pose_csv.read_pose_csv` reads it.
    label_names : sequence of str
        The places to distinguish.
    label_column : str, optional
        The column of places, if it has none of the usual names.
    classes : mapping of str to str, optional
        From the table's names to label names; all others are unknown places.

    Raises
    ------
    LogError
        There is no such column, or there are more or fewer rows than steps.
    LabelError
        Without ``classes``: a place that is not among the labels.
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
    """The trajectory with its places by their new names; without ``classes``, by their own.

    Places that are not among the labels become unknown.
    """
    own = trajectory.label_names or ()
    chosen = {name: name for name in own if name in label_names} if classes is None else classes
    return trajectory.relabelled(
        {name: chosen[name] for name in own if name in chosen}, label_names
    )
