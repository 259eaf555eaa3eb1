"""Reasons for a label as data: votes of features with their units, neighbours, gates."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places.spaces.gates import Gate
from pgm_places.topology.regions import Region


@dataclass(frozen=True)
class FeatureVote:
    """The contribution of one feature to the log-odds of a question, positive for the class.

    ``of_space``: of the place, not the scan. ``threshold``: the one with the largest weight.
    """

    name: str
    of_space: bool
    value: float
    threshold: float
    log_odds: float

    @property
    def unit(self) -> str:
        """The unit of the value and the threshold."""
        return unit_of(self.name, of_space=self.of_space)


@dataclass(frozen=True)
class Question:
    """One class of the decision list: whether the cell has this class, or a later one of the list.

    ``log_odds = bias + sum of votes``, exactly; ``exp(log_odds)`` are the odds of yes. ``bias``
    does not depend on the cell; votes are by descending weight.
    """

    label: str
    bias: float
    votes: tuple[FeatureVote, ...]

    @property
    def log_odds(self) -> float:
        """Log-odds of this class against all later classes of the list."""
        return self.bias + sum(vote.log_odds for vote in self.votes)

    @property
    def from_scan(self) -> float:
        """Contribution of the cell's own scan."""
        return sum(vote.log_odds for vote in self.votes if not vote.of_space)

    @property
    def from_spaces(self) -> float:
        """Contribution of the segments and of the place around the cell."""
        return sum(vote.log_odds for vote in self.votes if vote.of_space)


@dataclass(frozen=True)
class NeighbourPull:
    """A neighbour in the graph with its final label, and its influence on the label.

    ``towards``: its probability of the cell's final label less its first label's; else 1, 0 or -1.
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
        Its final label, and its label without neighbours.
    painted : bool
        Whether its label was painted, which overrides everything else.
    probabilities, probabilities_alone : dict of str to float, or None
        After and before the graph.
    ranges_m, angles_rad : (B,) float
        The simulated scan: the length and the direction in the map frame of every beam.
    questions : tuple of Question
        In the order of the list.
    gate_probability : float or None
        Probability of the gate at the cell; 0 for no gate. None if gates are not used.
    gate_log_odds : float
        Contribution of the gate, or of its absence, to the log-odds of a doorway.
    networks : dict of str to float, or None
        The floor networks' probability of each label, if the method uses them; closer to uniform
        where their views differ.
    network_shares : dict of str to float
        Their weight in the log-odds of each label; questions and gate have the remaining weight.
    doorway_log_odds : float
        Final contribution of the accepted gates' positions to the log-odds of a doorway; see
        :func:`~pgm_places.labelers.place_problem.doorway_zones`.
    neighbours : tuple of NeighbourPull
        The neighbours in the graph.
    region : Region or None
        The place of the cell.
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
    """The shape features and gates of a place.

    The features are those of the place between gates that contains most of it; empty if the labeler
    has no space features. Gates, accepted or not, have probabilities, the most probable first.
    """

    region: Region
    features: dict[str, float]
    gates: tuple[tuple[Gate, float], ...]


_LASER = {
    "m": ("f2", "f2_sd", "f3", "f6", "f8", "f8_sd", "f9", "f9_sd", "f17", "f18", "f25"),
    "m²": ("f5",),
    "1/m": ("f7",),
    "rad": ("f26",),
}
_SPACE = {
    "m": (
        *("radius", "clearance", "short", "long", "widest", "largest_radius"),
        *("way_out", "way_out_width"),
    ),
    "m²": ("area", "neighbour_area", "largest_area"),
    "1/m": (
        *("opening_density", "narrow_density"),
        *("gate_density", "gates_along", "one_gate_density"),
    ),
}
_OF_LASER, _OF_SPACE = (
    {name: unit for unit, names in table.items() for name in names} for table in (_LASER, _SPACE)
)


def unit_of(name: str, *, of_space: bool) -> str:
    """The unit of a laser or space feature; "" for shares, counts and ratios.

    Examples
    --------
    >>> unit_of("way_out[0.9]", of_space=True), unit_of("f14[0.5]", of_space=False)
    ('m', '')
    """
    return (_OF_SPACE if of_space else _OF_LASER).get(name.partition("[")[0], "")


def value_with_unit(name: str, value: float, *, of_space: bool) -> str:
    """A feature's value to three digits, with its unit if it has one.

    Examples
    --------
    >>> value_with_unit("way_out[0.9]", 3.14159, of_space=True)
    '3.14 m'
    >>> value_with_unit("f14[0.5]", 12.0, of_space=False)
    '12'
    """
    return f"{value:.3g} {unit_of(name, of_space=of_space)}".rstrip()
