"""Why a cell or a place has its label, as data: votes, questions, pulls of neighbours, gates."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places.spaces.gate import Gate
from pgm_places.topology.regions import Region


@dataclass(frozen=True)
class FeatureVote:
    """What one feature added to the log-odds of a question.

    Parameters
    ----------
    name : str
    of_space : bool
        Whether it describes the place around the cell rather than the cell's scan.
    value : float
        Of the cell.
    threshold : float
        The one that weighed most.
    log_odds : float
        Added for the class if positive, against it if negative.
    """

    name: str
    of_space: bool
    value: float
    threshold: float
    log_odds: float


@dataclass(frozen=True)
class Question:
    """One class of the decision list: whether the cell is of this class or of one asked later.

    ``log_odds = bias + sum of votes``, exactly; ``exp(log_odds)`` are the odds of yes.

    Parameters
    ----------
    label : str
    bias : float
        What the calibration and the trees say before the cell is looked at.
    votes : tuple of FeatureVote
        All features that were asked about, those that weighed most first.
    """

    label: str
    bias: float
    votes: tuple[FeatureVote, ...]

    @property
    def log_odds(self) -> float:
        """Of this class against all that are asked for later."""
        return self.bias + sum(vote.log_odds for vote in self.votes)

    @property
    def from_scan(self) -> float:
        """The part of the cell's own scan."""
        return sum(vote.log_odds for vote in self.votes if not vote.of_space)

    @property
    def from_spaces(self) -> float:
        """The part of the segments and of the place around the cell."""
        return sum(vote.log_odds for vote in self.votes if vote.of_space)


@dataclass(frozen=True)
class NeighbourPull:
    """A neighbour in the graph, and where it pulls.

    Parameters
    ----------
    x_m, y_m : float
    label : str
        Its label in the end.
    towards : float
        How much more probable it finds the cell's final label than the one that the cell would get
        alone, -1 to 1; without probabilities 1, 0 or -1 by its label.
    """

    x_m: float
    y_m: float
    label: str
    towards: float


@dataclass(frozen=True, eq=False)
class CellExplanation:
    """Why a cell has its label.

    Parameters
    ----------
    x_m, y_m : float
        Centre of the cell that was labelled.
    label, alone : str
        Its label in the end, and the one that it would get without neighbours.
    painted : bool
        Whether its label was painted: nothing else matters then.
    probabilities, probabilities_alone : dict of str to float, or None
        After and before the graph.
    ranges_m, angles_rad : (B,) float
        The simulated scan: the length and the direction in the map frame of every beam.
    questions : tuple of Question
        In the order of the list.
    gate_probability : float or None
        Of the gate at which the cell lies; 0 for none. None where gates do not count.
    gate_log_odds : float
        What the gate, or its absence, adds to the log-odds of a doorway.
    networks : dict of str to float, or None
        How probable the networks that see the whole floor find each label, where the method looks
        at them; where their views differ, the less sure.
    network_shares : dict of str to float
        Their weight in the log-odds of each label; the rest is that of questions and gate.
    doorway_log_odds : float
        What is added to the log-odds of a doorway in the end, by where the accepted gates are; see
        :func:`~pgm_places.labelers.place_problem.doorway_log_odds`.
    neighbours : tuple of NeighbourPull
        Those in the graph.
    region : Region or None
        The place that it belongs to.
    """

    x_m: float
    y_m: float
    label: str
    alone: str
    painted: bool
    probabilities: dict[str, float] | None
    probabilities_alone: dict[str, float] | None
    ranges_m: NDArray[np.float32]
    angles_rad: NDArray[np.float64]
    questions: tuple[Question, ...]
    gate_probability: float | None
    gate_log_odds: float
    networks: dict[str, float] | None
    network_shares: dict[str, float]
    doorway_log_odds: float
    neighbours: tuple[NeighbourPull, ...]
    region: Region | None


@dataclass(frozen=True, eq=False)
class RegionExplanation:
    """What is known of a place.

    Parameters
    ----------
    region : Region
    features : dict of str to float
        Shape features of the place between gates that holds most of it; empty where the labeler
        knows no spaces.
    gates : tuple of (Gate, float)
        Gates beside it, accepted or not, with their probabilities, the most probable first.
    """

    region: Region
    features: dict[str, float]
    gates: tuple[tuple[Gate, float], ...]
