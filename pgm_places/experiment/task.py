"""Interface of the experiment tasks for each kind of nodes."""

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
"""The fitted labeler of each method by its id; a PlaceLabeler is shared by all its methods."""


class ScoredTest(NamedTuple):
    """A test source with the scores of its nodes, computed once for all methods.

    Parameters
    ----------
    items : sequence of TestItem
        A map, a drive, a graph, or a map and the drive through it.
    label : callable
        From the id of a method to its labelling of each item.
    doors : callable
        From a method's labellings and the label of doorways to the door counts of each item; () if
        doors are not counted.
    gates : callable
        From the label of doorways to the counts of doors matched by gates on each item; () without
        gates.
    """

    items: Sequence[TestItem]
    label: Callable[[str], Sequence[Labeling]]
    doors: Callable[[Sequence[Labeling], int], tuple[DoorScores, ...]] = lambda *_: ()
    gates: Callable[[int], tuple[DoorScores, ...]] = lambda _: ()


Tested = Literal["maps", "drives", "graphs"]


class Task(Protocol):
    """The task of a configuration: training and test labelling of one kind of nodes.

    The constructor builds the labelers and reports invalid options before anything is read. A task
    is trained once.
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
