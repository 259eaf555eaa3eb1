"""Experiments on the steps of drives, alone or joined with the cells of their maps."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from pgm_places.experiment.comparison import TestDrive, TestItem, TestMap
from pgm_places.experiment.drives import SourceDrive
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.setup import joint_labeler, step_labeler, step_methods
from pgm_places.graph.layout import GridLayout
from pgm_places.inference.labeling import Labeling
from pgm_places.labelers.joint_labeler import JointLabeler
from pgm_places.labelers.tracking import map_of_scans
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.trajectories.mapped_drive import MappedDrive

__all__ = ["LabelledItems", "StepLabeler", "label_drives", "learn_steps"]

StepLabeler = TrajectoryLabeler | JointLabeler


class LabelledItems(NamedTuple):
    """What was tested and, per method, the labelling of each item and the seconds it took.

    Parameters
    ----------
    items : tuple of TestMap or TestDrive
    labelings : mapping of str to tuple of Labeling
    seconds : mapping of str to float
    """

    items: tuple[TestItem, ...]
    labelings: Mapping[str, tuple[Labeling, ...]]
    seconds: Mapping[str, float]


def learn_steps(
    experiment: Experiment, maps: Sequence[LabelledMap], drives: Sequence[SourceDrive]
) -> dict[str, StepLabeler]:
    """A fitted labeler per method of a configuration with ``nodes = "steps"`` or ``"both"``.

    They share the lists, and each method learns from the same held-out scores.
    """
    config = experiment.config
    methods = step_methods(config)
    n_threads, progress = experiment.n_threads, experiment.progress
    with experiment.learning():
        if config.nodes == "both":
            pairs = [MappedDrive(_map_of(item), item.trajectory) for item in drives]
            return dict(
                joint_labeler(config).fit_methods(
                    methods, pairs, maps, n_threads=n_threads, progress=progress
                )
            )
        return dict(
            step_labeler(config).fit_methods(
                methods,
                maps,
                [item.trajectory for item in drives],
                known_map=[item.grid for item in drives],
                n_threads=n_threads,
                progress=progress,
            )
        )


def label_drives(
    experiment: Experiment, labelers: Mapping[str, StepLabeler], drives: Sequence[SourceDrive]
) -> LabelledItems:
    """Every test drive labelled by every method, with its map's cells where they are joined."""
    first = next(iter(labelers.values()))
    scored: list[tuple[Callable[[Any], list[Labeling]], int]] = []
    items: list[TestItem] = []
    for drive in drives:
        with experiment.timed("score steps"):
            if isinstance(first, JointLabeler):
                found, label = _joint(experiment, first, drive)
            else:
                found, label = _steps(experiment, first, drive)
        items += found
        scored.append((label, len(found)))
    labelings, seconds = {}, {}
    for name, labeler in labelers.items():
        start = time.perf_counter()
        with experiment.progress.stage(f"labelling with {name}") as stage:
            parts: list[Labeling] = []
            for done, (label, _) in enumerate(scored):
                parts += label(labeler)
                stage.update((done + 1) / len(scored))
        seconds[name] = time.perf_counter() - start
        labelings[name] = tuple(parts)
    return LabelledItems(tuple(items), labelings, seconds)


def _steps(
    experiment: Experiment, first: TrajectoryLabeler, drive: SourceDrive
) -> tuple[list[TestItem], Callable[[Any], list[Labeling]]]:
    path = drive.trajectory
    scores = first.scores(
        path, known_map=drive.grid, n_threads=experiment.n_threads, progress=experiment.progress
    )
    grid = drive.grid if drive.grid is not None else map_of_scans(path)

    def label(labeler: TrajectoryLabeler) -> list[Labeling]:
        return [labeler.infer(path, scores, map_prior=drive.prior, truth=path.labels)]

    return [TestDrive(path.name, path, grid)], label


def _joint(
    experiment: Experiment, first: JointLabeler, drive: SourceDrive
) -> tuple[list[TestItem], Callable[[Any], list[Labeling]]]:
    path, known = drive.trajectory, _map_of(drive)
    scores = first.scores(
        known.grid,
        path,
        mask=known.cells,
        n_threads=experiment.n_threads,
        progress=experiment.progress,
    )
    cells = scores.graph.cells
    assert cells is not None and isinstance(cells.layout, GridLayout)
    window = np.ones(known.grid.shape, np.bool_) if known.window is None else known.window
    items: list[TestItem] = [
        TestMap(f"{path.name}: cells", known.grid, known.labels, cells.layout, window),
        TestDrive(f"{path.name}: steps", path, known.grid),
    ]

    def label(labeler: JointLabeler) -> list[Labeling]:
        found = labeler.infer(scores)
        assert found.cells is not None and found.steps is not None  # there are a map and a drive
        # Score and history belong to all nodes together; they are reported once, with the cells.
        return [found.cells, replace(found.steps, score=None, bound=None, info={})]

    return items, label


def _map_of(drive: SourceDrive) -> Any:
    assert drive.map is not None  # the configuration has been checked
    return drive.map
