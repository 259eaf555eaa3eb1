"""What a kind of node needs for an experiment: labelers, learning, and labels for tests."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, Literal, NamedTuple, Protocol

from pgm_places.experiment.config import ExperimentConfig
from pgm_places.experiment.evaluated_items import TestItem
from pgm_places.experiment.experiment import Experiment
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


class ScoredTest(NamedTuple):
    """A source to test on with the scores of its nodes, computed once for all methods.

    Parameters
    ----------
    items : sequence of TestItem
        What is labelled: a map, a drive, a graph, or a map with the drive through it.
    label : callable
        From the id of a method to its labelling of each item.
    doors : callable
        From a method's labellings and the label for doorways to its doors on each item; () where
        doors are not counted.
    gates : callable
        From the label for doorways to the doors that gates match on each item; () without gates.
    """

    items: Sequence[TestItem]
    label: Callable[[str], Sequence[Labeling]]
    doors: Callable[[Sequence[Labeling], int], tuple[DoorScores, ...]] = lambda *_: ()
    gates: Callable[[int], tuple[DoorScores, ...]] = lambda _: ()


Tested = Literal["maps", "drives", "graphs"]


class Task(Protocol):
    """A kind of node to label, as one configuration describes it.

    It is made from the configuration: that builds the labelers and refuses bad options, before
    anything is read. It learns once.
    """

    tested: ClassVar[Tested]
    """Which of the sources are tested on."""

    def __init__(self, config: ExperimentConfig) -> None:
        """Build the labelers."""

    def check_savable(self) -> None:
        """Refuse to train what cannot be saved as one model."""

    def learn(self, experiment: Experiment, sources: Sources) -> Labelers:
        """A fitted labeler for each method."""

    def scored(self, experiment: Experiment, labelers: Any, source: Any, /) -> ScoredTest:
        """A source to test on, scored for every method."""

    def method(self, name: str, labeler: Any, /) -> AnyMethod:
        """A fitted method by its id, with its unary."""
