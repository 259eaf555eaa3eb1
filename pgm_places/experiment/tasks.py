"""The kinds of nodes by name; methods learned, and run on everything that is tested."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from pgm_places.experiment.config import ExperimentConfig
from pgm_places.experiment.evaluated_items import TestItem
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.node_tasks import CellTask, GraphTask, StepAndCellTask, StepTask
from pgm_places.experiment.setup import AnyMethod
from pgm_places.experiment.sources import Source, Sources
from pgm_places.experiment.task import Labelers, Task
from pgm_places.inference.labeling import Labeling
from pgm_places.spaces.door_truth import DoorScores

TASKS: Mapping[str, type[Task]] = {
    "cells": CellTask,
    "steps": StepTask,
    "both": StepAndCellTask,
    "graph": GraphTask,
}


def task_of(config: ExperimentConfig) -> Task:
    """What the configuration labels, with its methods built; bad options are refused."""
    return TASKS[config.nodes](config)


def tests_of(config: ExperimentConfig, sources: Sources) -> list[Source]:
    """Those of the sources that can be tested on."""
    return list(getattr(sources, TASKS[config.nodes].tested))


@dataclass(frozen=True, eq=False)
class Trained:
    """Fitted methods, and the experiment with the options of their training.

    Parameters
    ----------
    task : Task
    experiment : Experiment
    labelers : mapping of str to labeler
        By the id of the method. A labeler of maps has all methods and stands at each of them.
    """

    task: Task
    experiment: Experiment
    labelers: Labelers

    @property
    def labeler(self) -> Any:
        """The first method's: of maps the only one."""
        return next(iter(self.labelers.values()))

    @property
    def methods(self) -> dict[str, AnyMethod]:
        """The fitted methods, with the unary of each."""
        return {name: self.task.method(name, item) for name, item in self.labelers.items()}

    @property
    def label_names(self) -> tuple[str, ...]:
        """The labels of results: those of the configuration, unless halls are taken for others."""
        return tuple(self.labeler.label_names_)


def learned(task: Task, experiment: Experiment, sources: Sources) -> Trained:
    """The methods of a task, fitted on the sources."""
    return Trained(task, experiment, task.learn(experiment, sources))


class Labelled(NamedTuple):
    """What was tested and, by the id of each method, how it labelled that.

    Parameters
    ----------
    items : tuple of TestItem
    labelings : mapping of str to tuple of Labeling
        One per item.
    doors : mapping of str to tuple of DoorScores
        One per item, or () where there is no label for doorways.
    seconds : mapping of str to float
        To label all items.
    gates : tuple of DoorScores
        One per item, or () where there are no gates or no label for doorways.
    """

    items: tuple[TestItem, ...]
    labelings: Mapping[str, tuple[Labeling, ...]]
    doors: Mapping[str, tuple[DoorScores, ...]]
    seconds: Mapping[str, float]
    gates: tuple[DoorScores, ...]


def label_tests(trained: Trained, tests: Sequence[Source]) -> Labelled:
    """Everything that is tested, labelled by every method."""
    experiment, labelers, names = trained.experiment, trained.labelers, trained.label_names
    doorway = experiment.config.topology.doorway_label
    scored = [trained.task.scored(experiment, labelers, item) for item in tests]
    labelings, doors, seconds = {}, {}, {}
    for name in labelers:
        start, parts = time.perf_counter(), []
        stage_name = f"labelling with {name}"
        with experiment.timed("label"), experiment.progress.stage(stage_name) as stage:
            for item in scored:
                parts.append(item.label(name))
                stage.update(len(parts) / len(scored))
        seconds[name] = time.perf_counter() - start
        labelings[name] = tuple(found for part in parts for found in part)
        doors[name] = tuple(
            scores
            for item, part in zip(scored, parts, strict=True)
            if doorway in names
            for scores in item.doors(part, names.index(doorway))
        )
    items = tuple(item for part in scored for item in part.items)
    gates = tuple(
        scores for item in scored if doorway in names for scores in item.gates(names.index(doorway))
    )
    return Labelled(items, labelings, doors, seconds, gates)
