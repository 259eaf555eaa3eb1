"""Experiments on the steps of drives, alone or joined with the cells of their maps."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from pgm_places.errors import ConfigError
from pgm_places.experiment.config import ExperimentConfig
from pgm_places.experiment.doors import passage_scores
from pgm_places.experiment.drives import SourceDrive, counted_objects
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.labelled_items import TestDrive
from pgm_places.experiment.map_task import tested_map
from pgm_places.experiment.setup import joint_labeler, step_labeler, step_methods
from pgm_places.experiment.sources import Sources
from pgm_places.experiment.task import Evidence, Task
from pgm_places.inference.labeling import Labeling
from pgm_places.labelers.joint_labeler import JointLabeler
from pgm_places.labelers.place_labeler import PlaceMethod
from pgm_places.labelers.tracking import map_of_scans
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.spaces.door_truth import DoorScores
from pgm_places.trajectories.mapped_drive import MappedDrive

StepLabeler = TrajectoryLabeler | JointLabeler


def _learn_steps(experiment: Experiment, sources: Sources) -> dict[str, StepLabeler]:
    """A fitted labeler per method: they share the lists and learn from the same held-out scores."""
    names = counted_objects(sources.drives)
    counts = [item.count_columns(names) for item in sources.drives]
    extra = [columns for columns in counts if columns is not None]
    with experiment.learning():
        learned = step_labeler(experiment.config, names).fit_methods(
            step_methods(experiment.config),
            sources.maps,
            [item.trajectory for item in sources.drives],
            extra=extra or None,
            known_map=[item.grid for item in sources.drives],
        )
    return {**learned}


def _learn_both(experiment: Experiment, sources: Sources) -> dict[str, StepLabeler]:
    """The same for methods that label steps and cells together."""
    pairs = [MappedDrive(_map_of(item), item.trajectory) for item in sources.drives]
    with experiment.learning():
        learned = joint_labeler(experiment.config).fit_methods(
            step_methods(experiment.config), pairs, sources.maps
        )
    return {**learned}


def _steps(
    experiment: Experiment, labelers: Mapping[str, TrajectoryLabeler], drive: SourceDrive
) -> Evidence:
    path, first = drive.trajectory, next(iter(labelers.values()))
    extra = drive.count_columns(first.scan_model_.extra_names)
    if extra is None and drive.counts is not None:
        raise ConfigError(f"{drive.name}: the training drives have no counts; remove these")
    with experiment.timed("score steps"):
        scores = first.scores(path, known_map=drive.grid, extra=extra)
        grid = drive.grid if drive.grid is not None else map_of_scans(path)
    item = TestDrive(path.name, path, grid)

    def label(name: str) -> Sequence[Labeling]:
        return [labelers[name].infer(path, scores, map_prior=drive.prior, truth=path.labels)]

    def doors(_name: str, found: Sequence[Labeling], doorway: int) -> tuple[DoorScores, ...]:
        return (passage_scores(item, found[0], doorway),)

    return Evidence([item], label, doors)


def _both(
    experiment: Experiment, labelers: Mapping[str, JointLabeler], drive: SourceDrive
) -> Evidence:
    path, known, first = drive.trajectory, _map_of(drive), next(iter(labelers.values()))
    with experiment.timed("score steps"):
        scores = first.scores(known.grid, path, mask=known.cells)
    cells = scores.graph.cells
    assert cells is not None  # there is a map
    on_map = tested_map(known, cells.grid_layout, f"{path.name}: cells")

    def label(name: str) -> Sequence[Labeling]:
        found = labelers[name].infer(scores)
        assert found.cells is not None and found.steps is not None  # there are a map and a drive
        # Score and history belong to all nodes together; they are reported once, with the cells.
        return [found.cells, replace(found.steps, score=None, bound=None, info={})]

    return Evidence([on_map, TestDrive(f"{path.name}: steps", path, known.grid)], label)


def _map_of(drive: SourceDrive) -> LabelledMap:
    assert drive.map is not None  # the configuration has been checked
    return drive.map


def _method(_config: ExperimentConfig, _name: str, labeler: StepLabeler) -> PlaceMethod:
    return PlaceMethod(labeler.method_, "laser")


STEPS = Task(step_methods, _learn_steps, "drives", _steps, _method)
STEPS_AND_CELLS = Task(step_methods, _learn_both, "drives", _both, _method)
