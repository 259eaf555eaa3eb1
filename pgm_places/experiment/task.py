"""What a kind of node needs for an experiment: checks, learning, and labels for what is tested."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from pgm_places.experiment.config import ExperimentConfig
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.labelled_items import TestItem
from pgm_places.experiment.setup import AnyMethod
from pgm_places.experiment.sources import Sources
from pgm_places.inference.labeling import Labeling
from pgm_places.labelers.joint_labeler import JointLabeler
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.labelers.structured_labeler import StructuredLabeler
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.spaces.door_truth import DoorScores

AnyLabeler = PlaceLabeler | TrajectoryLabeler | JointLabeler | StructuredLabeler
Labelers = Mapping[str, AnyLabeler]
"""The fitted labeler of each method by its id; one of maps serves all of its methods."""


class Evidence(NamedTuple):
    """A source to test on with what is computed once, whatever the number of methods.

    Parameters
    ----------
    items : sequence of TestItem
        What is labelled: a map, a drive, a graph, or a map with the drive through it.
    label : callable
        From the id of a method to its labelling of each item.
    doors : callable
        From a method's id and its labellings to its doors on each item, of a label for doorways;
        () where doors are not counted.
    gates : callable
        From a label for doorways to the doors that gates match on each item; () without gates.
    """

    items: Sequence[TestItem]
    label: Callable[[str], Sequence[Labeling]]
    doors: Callable[[str, Sequence[Labeling], int], tuple[DoorScores, ...]] = lambda *_: ()
    gates: Callable[[int], tuple[DoorScores, ...]] = lambda _: ()


@dataclass(frozen=True)
class Task:
    """A kind of node to label.

    Parameters
    ----------
    check : callable
        Refuses bad options before anything is read.
    learn : callable
        A fitted labeler for each method.
    tests : {"maps", "drives", "graphs"}
        Which of the sources are tested on.
    evidence : callable
        A source to test on, ready for every method.
    method : callable
        A fitted method by its id, with what it sees.
    """

    check: Callable[[ExperimentConfig], object]
    learn: Callable[[Experiment, Sources], Labelers]
    tests: Literal["maps", "drives", "graphs"]
    evidence: Callable[[Experiment, Any, Any], Evidence]
    method: Callable[[ExperimentConfig, str, Any], AnyMethod]
