"""The drives of an experiment with their true labels, read from logs or simulated."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import ConfigError, LabelError, LogError
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.maps import load_grid, load_map_of
from pgm_places.experiment.source_config import WITHIN_S, DriveConfig, SourceConfig
from pgm_places.io.logs.object_counts import read_object_counts
from pgm_places.io.logs.pose_csv import translated, with_truth
from pgm_places.io.logs.trajectories import read_trajectory
from pgm_places.labelers.map_prior import MapPrior
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.persistence.map_prior import read_labelled_map
from pgm_places.simulation.simulated_robot import SimulatedRobot, scans_along
from pgm_places.trajectories.trajectory import Trajectory
from pgm_places.vision.object_counts import ObjectCounts


@dataclass(frozen=True, eq=False)
class SourceDrive:
    """A drive with its true labels, and its map, if there is one.

    Parameters
    ----------
    trajectory : Trajectory
        With true labels by the experiment's label names, -1 where unknown.
    map : LabelledMap or None
        In the frame of the poses; all labels are -1 without a label file.
    prior : MapPrior or None
        A labelled map, in the frame of the poses.
    counts : ObjectCounts or None
        Object counts of a camera.
    within_s : float
        Longest time between a step and its counts.
    """

    trajectory: Trajectory
    map: LabelledMap | None
    prior: MapPrior | None = None
    counts: ObjectCounts | None = None
    within_s: float = WITHIN_S

    def count_columns(self, names: Sequence[str]) -> NDArray[np.float32] | None:
        """(T, D) counts of these objects at each step; None without names.

        Raises
        ------
        ConfigError
            The drive has no counts.
        """
        if not names:
            return None
        if self.counts is None:
            raise ConfigError(
                f"{self.name} has no object counts, but other drives have; add counts to every "
                "drive of [[train]] and [[test]], or to none"
            )
        return self.counts.at(self.trajectory.times_s, within_s=self.within_s, object_names=names)

    @property
    def name(self) -> str:
        """Name of the drive."""
        return self.trajectory.name

    @property
    def grid(self) -> OccupancyGrid | None:
        """The map without its labels."""
        return None if self.map is None else self.map.grid

    @property
    def labels(self) -> NDArray[np.int64]:
        """(T,) true label of each step, -1 where unknown."""
        assert self.trajectory.labels is not None  # checked by load_drives
        return self.trajectory.labels

    @property
    def building(self) -> str | None:
        """The building; drives and maps of one building are held out together."""
        return self.trajectory.building

    @property
    def positions_m(self) -> NDArray[np.float64]:
        """(T, 2) positions of the robot."""
        return self.trajectory.poses[:, :2]

    def with_labels_at(self, chosen: NDArray[np.bool_]) -> "SourceDrive":
        """The drive with true labels only at the steps of a mask (T,)."""
        labels, names = np.where(chosen, self.labels, -1), self.trajectory.label_names
        assert names is not None
        return replace(self, trajectory=self.trajectory.with_labels(labels, names))


def load_drives(experiment: Experiment, part: str) -> list[SourceDrive]:
    """The drives among the sources of ``"train"`` or ``"test"``, in order.

    Raises
    ------
    LogError, MapError, LabelError
        A file cannot be read, or no step of a drive has a true label.
    """
    return experiment.loaded(part, "drives", lambda item: item.is_drive, _load)


def _load(experiment: Experiment, source: SourceConfig, where: str) -> SourceDrive:
    if source.drive is not None:
        drive = _simulated(experiment, source.drive, where)
    else:
        drive = _recorded(experiment, source, where)
    if source.map_labels is not None:
        folder = experiment.resolve(source.map_labels)
        prior = read_labelled_map(folder, experiment.config.labels.names).prior
        drive = replace(drive, prior=prior)
    return _windowed(source, drive, where)


def _simulated(experiment: Experiment, drive: DriveConfig, where: str) -> SourceDrive:
    known = load_map_of(experiment, drive, f"{where}.drive")
    robot = SimulatedRobot.of(drive, drive.laser)
    path = robot.explore(
        known.grid,
        spacing_m=drive.spacing_m,
        max_length_m=drive.length_m,
        window=known.window,
        seed=drive.seed,
        name=f"drive {drive.seed} through {known.name}",
    )
    path = replace(path, building=known.building)
    return SourceDrive(path.labelled_by(known, experiment.config.labels.names), known)


def _recorded(experiment: Experiment, source: SourceConfig, where: str) -> SourceDrive:
    names = experiment.config.labels.names
    log = experiment.resolve(str(source.log))
    is_table = log.suffix.lower() == ".csv" and source.truth is None
    label_column = source.label_column if is_table else None
    read = read_trajectory(log, range_max_m=source.range_max_m, label_column=label_column)
    for message in read.warnings:
        experiment.warn(f"{log.name}: {message}")
    if log.is_file():
        experiment.record_input(log)
    path = read.trajectory
    if source.frame is not None:
        path = path.transformed(source.frame)
    known = None if source.map is None else load_grid(experiment, source)
    if source.truth is not None:
        truth = experiment.resolve(source.truth)
        path = with_truth(
            path, truth, names, label_column=source.label_column, classes=source.classes
        )
        experiment.record_input(truth)
    elif path.labels is not None:
        path = translated(path, names, source.classes)
    if source.resample_m is not None:
        path = path.resampled(source.resample_m)
    has_map_labels = source.truth is None and known is not None and (known.labels >= 0).any()
    if has_map_labels and (path.labels is None or source.resample_m is not None):
        assert known is not None
        path = path.labelled_by(known, names)
    if path.labels is None:
        raise LabelError(
            f"{where}: {log.name} has no true labels; add truth (a table), or map and labels in "
            "the log's frame"
        )
    if source.laser is not None:
        assert known is not None  # checked by SourceConfig
        geometry, noise = source.laser.geometry(), source.laser.noise()
        path = scans_along(known.grid, path, geometry, noise=noise)
    building = str(log) if known is None else known.building
    counts = None
    if source.counts is not None:
        table = experiment.resolve(source.counts)
        counts = read_object_counts(table)
        experiment.record_input(table)
        if not (counts.seconds_from(path.times_s) <= source.counts_within_s).any():
            experiment.warn(
                f"{where}: no object counts within {source.counts_within_s:g} s of any step: do "
                "the log and the counts use the same clock? (counts_within_s)"
            )
    path = replace(path, building=building)
    return SourceDrive(path, known, counts=counts, within_s=source.counts_within_s)


def counted_objects(drives: Sequence[SourceDrive]) -> tuple[str, ...]:
    """The names of all counted objects, in the order of first occurrence."""
    counts = [count.counts for count in drives if count.counts is not None]
    return tuple(dict.fromkeys(name for count in counts for name in count.object_names))


def _windowed(source: SourceConfig, drive: SourceDrive, where: str) -> SourceDrive:
    """The configured range of steps, with unknown labels outside the configured region."""
    path = drive.trajectory
    first, last = source.from_step or 0, source.to_step
    if last is not None or first:
        if not first < min(len(path) if last is None else last, len(path)):
            raise LogError(
                f"{where}: from_step {first} to to_step {'the end' if last is None else last} "
                f"contains no step; the log has {len(path)}"
            )
        path = path[slice(first, last)]
    assert path.labels is not None and path.label_names is not None
    labels = path.labels
    if source.region is not None:
        low, high = np.array(source.region[:2]), np.array(source.region[2:])
        xy = path.poses[:, :2]
        labels = np.where(((xy >= low) & (xy <= high)).all(axis=1), labels, -1)
    if not (labels >= 0).any():
        raise LabelError(
            f"{where} ({path.name}): no step has a true label; check that the truth belongs to "
            "this drive, and check its frame, steps and region"
        )
    path = path.with_labels(labels, path.label_names)
    named = replace(path, name=source.name or path.name, building=source.building or path.building)
    return replace(drive, trajectory=named)
