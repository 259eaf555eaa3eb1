"""No structure: every node takes its best label on its own, the baseline of every comparison."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pgm_places._checks import sealed
from pgm_places.errors import InputError
from pgm_places.labeling import Labeling, Status
from pgm_places.potentials import Potentials, score
from pgm_places.problem import LabelingProblem

__all__ = ["Independent"]


@dataclass(frozen=True)
class Independent:
    """Labels each node by the largest unary potential; edges are ignored.

    With the decision list's histogram z (paper eq. 8) as unary this is AdaBoost alone.
    """

    uses_node_features: ClassVar[bool] = False

    def infer(self, problem: LabelingProblem) -> Labeling:
        """The argmax of the unary at every node; beliefs are the normalised unaries.

        Raises
        ------
        InputError
            The problem has no unary, or forbids every label at some node.
        """
        if problem.unary is None:
            raise InputError("'independent' needs unary log-probabilities; the problem has none")
        unary = problem.unary
        best = unary.max(axis=1, keepdims=True, initial=-np.inf)
        forbidden = np.flatnonzero(~np.isfinite(best[:, 0]))
        if len(forbidden):
            raise InputError(f"unary forbids every label at node {forbidden[0]}")
        labels = unary.argmax(axis=1)
        beliefs = unary - best
        np.exp(beliefs, out=beliefs)
        beliefs /= beliefs.sum(axis=1, keepdims=True)
        total = score(problem.graph, Potentials(unary), labels)
        return Labeling(
            labels,
            Status.EXACT,
            beliefs=sealed(beliefs),
            score=total,
            bound=total,
        )
