"""Independent labelling of nodes by their unaries: the baseline without structure."""

from dataclasses import dataclass
from typing import ClassVar

from pgm_places._checks import freeze
from pgm_places.inference.backends import Traits
from pgm_places.inference.labeling import Labeling, Status
from pgm_places.inference.potentials import Potentials, score
from pgm_places.inference.problem import LabelingProblem, evident_unary
from pgm_places.models.label_order import preference_order
from pgm_places.solvers.relaxation import starting_beliefs


@dataclass(frozen=True)
class Independent:
    """Labels each node by the largest unary potential; edges are ignored.

    With the decision list's histogram z (paper eq. 8) as unary this is AdaBoost alone.
    """

    traits: ClassVar[Traits] = Traits(uses_node_features=False)

    def infer(self, problem: LabelingProblem) -> Labeling:
        """The argmax of the unary at every node; beliefs are the normalised unaries.

        Ties go to the label that more nodes prefer, so that the order of labels does not matter.
        """
        unary = evident_unary(problem, "independent")
        order = preference_order(unary, problem.label_names)
        labels = freeze(order[unary[:, order].argmax(axis=1)])
        total = score(problem.graph, Potentials(unary), labels)
        beliefs = freeze(starting_beliefs(unary))
        return Labeling(labels, Status.EXACT, beliefs=beliefs, score=total, bound=total)
