"""Experiments on the steps of drives, alone or joined with the cells of their maps."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import ClassVar

from pgm_places.errors import ConfigError
from pgm_places.experiment.config import ExperimentConfig
from pgm_places.experiment.doors import passage_scores
from pgm_places.experiment.drives import SourceDrive, counted_objects
from pgm_places.experiment.evaluated_items import EvalDrive
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.map_task import tested_map
from pgm_places.experiment.setup import joint_labeler, one_method, step_labeler, step_methods
from pgm_places.experiment.sources import Sources
from pgm_places.experiment.task import ScoredTest, Tested
from pgm_places.inference.labeling import Labeling
from pgm_places.labelers.joint_labeler import JointLabeler
from pgm_places.labelers.place_labeler import PlaceMethod
from pgm_places.labelers.tracking import map_of_scans
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.spaces.door_truth import DoorScores
from pgm_places.trajectories.mapped_drive import MappedDrive


class _DriveTask:
    """What both kinds of drives share: a labeler for each method."""

    tested: ClassVar[Tested] = "drives"

    def __init__(self, config: ExperimentConfig) -> None:
        self.config, self.methods = config, step_methods(config)

    def check_savable(self) -> None:
        """A model has one method."""
        one_method(self.config, "drives")

    def method(self, _name: str, labeler: TrajectoryLabeler | JointLabeler) -> PlaceMethod:
        """The labeler's only one."""
        return PlaceMethod(labeler.method_, "laser")


class StepTask(_DriveTask):
    """The steps of drives."""

    def __init__(self, config: ExperimentConfig) -> None:
        super().__init__(config)
        self.labeler = step_labeler(config)

    def learn(self, experiment: Experiment, sources: Sources) -> dict[str, TrajectoryLabeler]:
        """The labelers share the lists and learn from the same held-out scores."""
        names = counted_objects(sources.drives)
        counts = [item.count_columns(names) for item in sources.drives]
        extra = [columns for columns in counts if columns is not None]
        with experiment.learning():
            learned = self.labeler.set_params(extra_names=tuple(names)).fit_methods(
                self.methods,
                sources.maps,
                [item.trajectory for item in sources.drives],
                extra=extra or None,
                known_map=[item.grid for item in sources.drives],
            )
        return {**learned}

    def scored(
        self,
        experiment: Experiment,
        labelers: Mapping[str, TrajectoryLabeler],
        source: SourceDrive,
    ) -> ScoredTest:
        """A drive, its steps scored by the list."""
        path, first = source.trajectory, next(iter(labelers.values()))
        extra = source.count_columns(first.scan_model_.extra_names)
        if extra is None and source.counts is not None:
            raise ConfigError(f"{source.name}: the training drives have no counts; remove these")
        with experiment.timed("score steps"):
            scores = first.scores(path, known_map=source.grid, extra=extra)
            grid = source.grid if source.grid is not None else map_of_scans(path)
        item = EvalDrive(path.name, path, grid)

        def label(name: str) -> Sequence[Labeling]:
            return [labelers[name].infer(path, scores, map_prior=source.prior, truth=path.labels)]

        def doors(found: Sequence[Labeling], doorway: int) -> tuple[DoorScores, ...]:
            return (passage_scores(item, found[0], doorway),)

        return ScoredTest([item], label, doors)


class StepAndCellTask(_DriveTask):
    """The steps of drives together with the cells of their maps."""

    def __init__(self, config: ExperimentConfig) -> None:
        super().__init__(config)
        self.labeler = joint_labeler(config)

    def learn(self, experiment: Experiment, sources: Sources) -> dict[str, JointLabeler]:
        """The labelers share both lists."""
        pairs = [MappedDrive(_map_of(item), item.trajectory) for item in sources.drives]
        with experiment.learning():
            return {**self.labeler.fit_methods(self.methods, pairs, sources.maps)}

    def scored(
        self, experiment: Experiment, labelers: Mapping[str, JointLabeler], source: SourceDrive
    ) -> ScoredTest:
        """A drive and its map, steps and cells scored by their lists."""
        path, known, first = source.trajectory, _map_of(source), next(iter(labelers.values()))
        with experiment.timed("score steps"):
            scores = first.scores(known.grid, path, mask=known.cells)
        cells = scores.graph.cells
        assert cells is not None  # there is a map
        on_map = tested_map(known, cells.grid_layout, f"{path.name}: cells")

        def label(name: str) -> Sequence[Labeling]:
            found = labelers[name].infer(scores)
            assert found.cells is not None and found.steps is not None  # a map and a drive
            # Score and history belong to all nodes together; they are reported with the cells.
            return [found.cells, replace(found.steps, score=None, bound=None, info={})]

        return ScoredTest([on_map, EvalDrive(f"{path.name}: steps", path, known.grid)], label)


def _map_of(drive: SourceDrive) -> LabelledMap:
    assert drive.map is not None  # the configuration has been checked
    return drive.map
