"""Loading the training and test data of an experiment: maps, drives and graphs."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import ConfigError, LabelError, LogError
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.graphs import SourceGraph, load_graphs
from pgm_places.experiment.source_config import WITHIN_S, DriveConfig, MapConfig, SourceConfig
from pgm_places.features.object_counts import ObjectCounts
from pgm_places.io.logs.object_counts import read_object_counts
from pgm_places.io.logs.pose_csv import translated, with_truth
from pgm_places.io.logs.trajectories import read_trajectory
from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.map_server import load_map
from pgm_places.io.maps.regions import load_regions
from pgm_places.labelers.map_prior import MapPrior
from pgm_places.maps.coarsening import coarsen, coarsen_labels
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid, at_cells
from pgm_places.maps.windows import window_mask
from pgm_places.persistence.map_prior import read_labelled_map
from pgm_places.simulation.simulated_robot import SimulatedRobot, scans_along
from pgm_places.teaching.paint import Paint
from pgm_places.trajectories.trajectory import Trajectory


def load_maps(experiment: Experiment, part: str) -> list[LabelledMap]:
    """The maps among the sources of ``"train"`` or ``"test"``, resampled and with windows."""
    return experiment.loaded(part, "maps", lambda item: not item.is_drive, load_map_of)


def load_map_of(experiment: Experiment, source: MapConfig, where: str) -> LabelledMap:
    """A labelled map as configured; ``where`` names it in messages.

    LabelError if no free cell inside the window has a label.
    """
    limits = source.window
    if source.generated is None:
        grid, labels, origin = _read_map(experiment, source)
    else:
        grid, labels, origin, split = _generated(experiment, source.generated, source.drawn)
        if source.half is not None:
            limits["columns"] = (0, split) if source.half == "left" else (split, None)
    name = source.name or _default_name(source, origin)
    building = source.building or str(origin)
    fine = LabelledMap(grid, labels, window_mask(grid, **limits), name, building, source.domain)
    made = (_coarsened if source.simulated is None else _simulated)(experiment, source, fine)
    if not made.labelled_cells.any():
        raise LabelError(
            f"{where} ({name}): no free cell inside the window has a label; check that the labels "
            "belong to this map and that the window covers them"
        )
    return made


def _coarsened(experiment: Experiment, _source: MapConfig, fine: LabelledMap) -> LabelledMap:
    """A map with cells of the configured size."""
    grid, target_m = fine.grid, experiment.config.resolution_m
    if target_m is None or np.isclose(target_m, grid.resolution_m, rtol=1e-3, atol=0):
        return fine
    coarse = coarsen(grid, target_m)
    # A coarse cell belongs to the window that contains its centre.
    centres = coarse.cell_centres_m(np.argwhere(np.ones(coarse.shape, np.bool_)))
    assert fine.window is not None
    chosen = at_cells(fine.window, grid.cells_at_m(centres), False)
    labels = coarsen_labels(fine.labels, grid, coarse)
    return replace(fine, grid=coarse, labels=labels, window=chosen.reshape(coarse.shape))


def _simulated(experiment: Experiment, source: MapConfig, plan: LabelledMap) -> LabelledMap:
    """The simulated robot map of a plan, with cells of the configured size."""
    from pgm_places.simulation.simulated_map import simulate_map

    config = experiment.config
    made = simulate_map(
        plan,
        config.labels.names,
        seed=source.simulated or 0,
        options=source.simulation,
        resolution_m=config.resolution_m,
    )
    return replace(made, name=source.name or made.name, domain=source.domain)


def load_grid(experiment: Experiment, source: MapConfig) -> LabelledMap:
    """The map of a log, with cells of the configured size; all labels are -1 without a file."""
    grid, labels, origin = _read_map(experiment, source)
    name = source.name or _default_name(source, origin)
    window = window_mask(grid, **source.window)
    return _coarsened(experiment, source, LabelledMap(grid, labels, window, name, str(origin)))


def _read_map(
    experiment: Experiment, source: MapConfig
) -> tuple[OccupancyGrid, NDArray[np.int16], Path]:
    names = experiment.config.labels.names
    yaml_path = experiment.resolve(str(source.map))
    loaded = load_map(yaml_path, compat=source.compat, unknown_value=source.unknown_value)
    for message in loaded.warnings:
        experiment.warn(f"{loaded.name}: {message}")
    for path in (loaded.yaml_path, loaded.image_path):
        experiment.record_input(path)
    labels = np.full(loaded.grid.shape, -1, np.int16)
    if source.labels is not None:
        with experiment.input_path(source.labels) as path:
            labels = load_labels(path, names, grid=loaded.grid, classes=source.classes)
    elif source.regions is not None:
        with experiment.input_path(source.regions) as path:
            labels = load_regions(path, names, loaded.grid, classes=source.classes)
    if source.corrections is not None:
        with experiment.input_path(source.corrections) as path:
            known = Paint.read(path, loaded.grid, names).labels
        labels = np.where(known >= 0, known, labels)
    return loaded.grid, labels, yaml_path


def _generated(
    experiment: Experiment, seed: int, drawn: dict[str, Any]
) -> tuple[OccupancyGrid, NDArray[np.int16], Path, int]:
    """A generated building with the configuration's labels, its title, and the border column."""
    from pgm_places.simulation.building import generate_building

    building = generate_building(seed, **drawn)
    names = experiment.config.labels.names
    numbers = [names.index(name) if name in names else -1 for name in building.label_names]
    # The last entry is for -1, "no label".
    labels = np.array([*numbers, -1], np.int16)[building.labels]
    how = ", ".join(f"{key} {value}" for key, value in drawn.items())
    title = Path(f"generated building {seed}" + (f" ({how})" if how else ""))
    return building.grid, labels, title, building.split_column


def _default_name(source: MapConfig, origin: Path) -> str:
    name = origin.stem if origin.stem != "map" else origin.parent.name
    parts = [] if source.half is None else [f"{source.half} half"]
    for axis, limits in source.window.items():
        low, high = ("" if value is None else f"{value:g}" for value in limits)
        parts.append(f"{axis} {low}..{high}")
    return f"{name} ({', '.join(parts)})" if parts else name


@dataclass(frozen=True, eq=False)
class SourceDrive:
    """A drive with its true labels, and its map, if there is one.

    The map is in the frame of the poses; without a label file, all its labels are -1. ``prior`` is
    another labelled map in this frame, ``counts`` are object counts of a camera, at most
    ``within_s`` from a step.
    """

    trajectory: Trajectory
    map: LabelledMap | None
    prior: MapPrior | None = None
    counts: ObjectCounts | None = None
    within_s: float = WITHIN_S

    def count_columns(self, names: Sequence[str]) -> NDArray[np.float32] | None:
        """(T, D) counts of these objects at each step; None without names."""
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

    LogError, MapError or LabelError if a file cannot be read, or no step of a drive has a true
    label.
    """
    return experiment.loaded(part, "drives", lambda item: item.is_drive, _load_drive)


def _load_drive(experiment: Experiment, source: SourceConfig, where: str) -> SourceDrive:
    if source.drive is not None:
        drive = _simulated_drive(experiment, source.drive, where)
    else:
        drive = _recorded(experiment, source, where)
    if source.map_labels is not None:
        folder = experiment.resolve(source.map_labels)
        prior = read_labelled_map(folder, experiment.config.labels.names).prior
        drive = replace(drive, prior=prior)
    return _windowed(source, drive, where)


def _simulated_drive(experiment: Experiment, drive: DriveConfig, where: str) -> SourceDrive:
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
        with experiment.input_path(source.truth) as truth:
            path = with_truth(
                path, truth, names, label_column=source.label_column, classes=source.classes
            )
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
        with experiment.input_path(source.counts) as table:
            counts = read_object_counts(table)
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


Source = LabelledMap | SourceDrive | SourceGraph


class Sources(NamedTuple):
    """Maps and drives to train or to test on, or user-defined graphs."""

    maps: Sequence[LabelledMap] = ()
    drives: Sequence[SourceDrive] = ()
    graphs: Sequence[SourceGraph] = ()

    @property
    def all(self) -> list[Source]:
        """Maps, then drives, then graphs."""
        return [*self.maps, *self.drives, *self.graphs]


def load_sources(experiment: Experiment, part: str, like: Sources | None = None) -> Sources:
    """The sources of ``"train"`` or ``"test"``; graphs must have the features of ``like``.

    LogError, MapError, LabelError or InputError if a file cannot be read, or has no true label.
    """
    if experiment.config.nodes == "graph":
        return Sources(graphs=load_graphs(experiment, part, () if like is None else like.graphs))
    maps = load_maps(experiment, part)
    if experiment.config.nodes == "cells":
        return Sources(maps)
    return Sources(maps, load_drives(experiment, part))
