"""A Markov random field with one weight, the simplest structured baseline."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pgm_places.errors import ConfigError, InputError
from pgm_places.labeling import Labeling
from pgm_places.models.decoding import decode, require_decoder
from pgm_places.potentials import Potentials
from pgm_places.problem import LabelingProblem

__all__ = ["PottsField"]


@dataclass(frozen=True)
class PottsField:
    """Smooths the unaries: every pair of neighbours that agrees earns the same weight.

    A labelling scores ``sum_i unary[i, y_i] + weight * sum_ij [y_i = y_j]`` (the Potts model);
    nothing is learned.

    Parameters
    ----------
    weight : float
        What a pair of neighbours earns by agreeing, in units of the unary log-probabilities. Eight
        neighbours earn eight times as much, and a map of half the cell size has twice as many
        along every border: a good weight is one for a resolution.
    inference : str
        A decoder of :mod:`pgm_places.models.decoding`: ``graph-cut``, ``trw-s``, ...
    certify : bool
        Whether to add an upper bound of the best score where the decoder has none.

    Examples
    --------
    >>> from pgm_places.graph import LabelGraph
    >>> unary = np.log([[0.9, 0.1], [0.4, 0.6], [0.9, 0.1]])
    >>> chain = LabelGraph.from_edges(3, [(0, 1), (1, 2)])
    >>> PottsField().infer(LabelingProblem(chain, ["room", "corridor"], unary)).labels.tolist()
    [0, 0, 0]
    """

    uses_node_features: ClassVar[bool] = False

    weight: float = 1.0
    inference: str = "graph-cut"
    certify: bool = False

    def __post_init__(self) -> None:
        if not np.isfinite(self.weight):
            raise ConfigError(f"weight must be a finite number, got {self.weight}")
        require_decoder(self.inference)

    def infer(self, problem: LabelingProblem) -> Labeling:
        """The labelling that the decoder finds, with its score and status.

        Raises
        ------
        InputError
            The problem has no unary, forbids every label at some node, or the decoder cannot take
            the weight (a graph cut wants it to be at least 0).
        """
        if problem.unary is None:
            raise InputError("'potts' needs unary log-probabilities; the problem has none")
        potentials = Potentials.potts(problem.unary, self.weight)
        return decode(problem.graph, potentials, self.inference, certify=self.certify)
