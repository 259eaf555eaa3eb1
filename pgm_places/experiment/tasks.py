"""The kinds of nodes by name, and every method of a task on everything that is tested."""

import time
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from pgm_places.experiment.config import ExperimentConfig
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.graph_task import GRAPHS
from pgm_places.experiment.labelled_items import TestItem
from pgm_places.experiment.map_task import CELLS
from pgm_places.experiment.sources import Source, Sources
from pgm_places.experiment.step_task import STEPS, STEPS_AND_CELLS
from pgm_places.experiment.task import Labelers, Task
from pgm_places.inference.labeling import Labeling
from pgm_places.spaces.door_truth import DoorScores

_TASKS: Mapping[str, Task] = {
    "cells": CELLS,
    "steps": STEPS,
    "both": STEPS_AND_CELLS,
    "graph": GRAPHS,
}


def task_of(config: ExperimentConfig) -> Task:
    """What the configuration labels."""
    return _TASKS[config.nodes]


def tests_of(config: ExperimentConfig, sources: Sources) -> list[Source]:
    """Those of the sources that can be tested on."""
    return list(getattr(sources, task_of(config).tests))


def label_names(labelers: Labelers) -> tuple[str, ...]:
    """The labels of results: those of the configuration, unless halls are taken for others."""
    return next(iter(labelers.values())).label_names_


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


def label_tests(experiment: Experiment, labelers: Labelers, tests: Sequence[Source]) -> Labelled:
    """Everything that is tested, labelled by every method."""
    task = task_of(experiment.config)
    names, doorway = label_names(labelers), experiment.config.topology.doorway_label
    evidence = [task.evidence(experiment, labelers, item) for item in tests]
    labelings, doors, seconds = {}, {}, {}
    for name in labelers:
        start, parts = time.perf_counter(), []
        stage_name = f"labelling with {name}"
        with experiment.timed("label"), experiment.progress.stage(stage_name) as stage:
            for item in evidence:
                parts.append(item.label(name))
                stage.update(len(parts) / len(evidence))
        seconds[name] = time.perf_counter() - start
        labelings[name] = tuple(found for part in parts for found in part)
        doors[name] = tuple(
            scores
            for item, part in zip(evidence, parts, strict=True)
            if doorway in names
            for scores in item.doors(name, part, names.index(doorway))
        )
    items = tuple(item for part in evidence for item in part.items)
    gates = tuple(
        scores
        for item in evidence
        if doorway in names
        for scores in item.gates(names.index(doorway))
    )
    return Labelled(items, labelings, doors, seconds, gates)
