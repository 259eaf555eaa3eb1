"""Tasks of an experiment: training of methods, and labelling of test data with them."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Protocol

from pgm_places.experiment.config import ExperimentConfig
from pgm_places.experiment.evaluated_items import ScoredTest, Tested, TestItem
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.node_tasks import CellTask, GraphTask, StepAndCellTask, StepTask
from pgm_places.experiment.setup import AnyMethod
from pgm_places.experiment.sources import Source, Sources
from pgm_places.inference.labeling import Labeling
from pgm_places.labelers.joint_labeler import JointLabeler
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.labelers.structured_labeler import StructuredLabeler
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.spaces.doorways import DoorScores

AnyLabeler = PlaceLabeler | TrajectoryLabeler | JointLabeler | StructuredLabeler
Labelers = Mapping[str, AnyLabeler]
"""The fitted labeler of each method by its id; a PlaceLabeler is shared by all its methods."""


class Task(Protocol):
    """The task of a configuration: training, once, and test labelling of one kind of nodes.

    The constructor builds the labelers and reports invalid options before anything is read.
    """

    tested: ClassVar[Tested]
    """The kind of test sources."""

    def __init__(self, config: ExperimentConfig) -> None:
        """Build the labelers."""

    def check_savable(self) -> None:
        """Check that the trained labelers can be saved as one model."""

    def learn(self, experiment: Experiment, sources: Sources) -> Labelers:
        """A fitted labeler for each method."""

    def scored(self, experiment: Experiment, labelers: Any, source: Any, /) -> ScoredTest:
        """A test source with its scores."""

    def method(self, name: str, labeler: Any, /) -> AnyMethod:
        """A fitted method by its id, with its unary."""


TASKS: Mapping[str, type[Task]] = {
    "cells": CellTask,
    "steps": StepTask,
    "both": StepAndCellTask,
    "graph": GraphTask,
}


def task_of(config: ExperimentConfig) -> Task:
    """The task of a configuration, with its methods built and its options checked."""
    return TASKS[config.nodes](config)


def tests_of(config: ExperimentConfig, sources: Sources) -> list[Source]:
    """The sources that can be test data."""
    return list(getattr(sources, TASKS[config.nodes].tested))


@dataclass(frozen=True, eq=False)
class Trained:
    """Fitted methods by id, and the experiment with the options of their training."""

    task: Task
    experiment: Experiment
    labelers: Labelers

    @property
    def labeler(self) -> Any:
        """The labeler of the first method."""
        return next(iter(self.labelers.values()))

    @property
    def methods(self) -> dict[str, AnyMethod]:
        """The fitted methods, with the unary of each."""
        return {name: self.task.method(name, each) for name, each in self.labelers.items()}

    @property
    def label_names(self) -> tuple[str, ...]:
        """The labels of results: the configuration's, unless halls get another label."""
        return tuple(self.labeler.label_names_)


def learned(task: Task, experiment: Experiment, sources: Sources) -> Trained:
    """Fit the methods of a task on the sources."""
    return Trained(task, experiment, task.learn(experiment, sources))


class Labelled(NamedTuple):
    """The labelled test items, and seconds to label them, by the id of each method.

    Labellings, doors and gates are one per item; the latter two are () without doorways.
    """

    items: tuple[TestItem, ...]
    labelings: Mapping[str, tuple[Labeling, ...]]
    doors: Mapping[str, tuple[DoorScores, ...]]
    seconds: Mapping[str, float]
    gates: tuple[DoorScores, ...]


def label_tests(trained: Trained, tests: Sequence[Source]) -> Labelled:
    """Label all test sources with every method."""
    experiment, labelers, names = trained.experiment, trained.labelers, trained.label_names
    doorway = experiment.config.topology.doorway_label
    scored = [trained.task.scored(experiment, labelers, source) for source in tests]
    labelings, doors, seconds = {}, {}, {}
    for name in labelers:
        start, by_source = time.perf_counter(), []
        stage_name = f"labelling with {name}"
        with experiment.timed("label"), experiment.progress.stage(stage_name) as stage:
            for test in scored:
                by_source.append(test.label(name))
                stage.update(len(by_source) / len(scored))
        seconds[name] = time.perf_counter() - start
        labelings[name] = tuple(labeling for of_source in by_source for labeling in of_source)
        doors[name] = tuple(
            scores
            for test, of_source in zip(scored, by_source, strict=True)
            if doorway in names
            for scores in test.doors(of_source, names.index(doorway))
        )
    items = tuple(item for test in scored for item in test.items)
    gates = tuple(
        scores for test in scored if doorway in names for scores in test.gates(names.index(doorway))
    )
    return Labelled(items, labelings, doors, seconds, gates)
