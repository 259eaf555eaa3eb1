"""Markov random fields without learning: independent nodes, and the Potts field."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import freeze
from pgm_places.errors import InputError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.backends import Traits
from pgm_places.inference.labeling import Labeling, Status
from pgm_places.inference.potentials import Potentials, score
from pgm_places.inference.problem import LabelingProblem, evident_unary, labelled_problems
from pgm_places.inference.temperature import Temperature, tempered
from pgm_places.models.cliques import decode_cliques_as
from pgm_places.models.decoders import Damping, Decoder, gives_beliefs
from pgm_places.models.evidence_weight import Evidence, divided_share, without_prior
from pgm_places.models.label_order import preference_order
from pgm_places.options import AtLeastZero, Options, Positive, Whole
from pgm_places.options.marks import Gt, Le
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


# Candidate weights, in units of the default, which wins among equals.
FACTORS = (1.0, 0.0, 0.125, 0.25, 0.5, 2.0, 4.0)

# Total reward of a node's neighbours; docs/own_problem.md compares weights on graphs.
NEIGHBOURHOOD = 2.0


@dataclass(frozen=True)
class PottsField(Options):
    """Smooths the unaries by a reward for every pair of neighbours that agrees.

    A labelling scores ``sum_i unary[i, y_i] + weight * sum_ij w_ij [y_i = y_j]`` (the Potts
    model); nothing is learned.

    Parameters
    ----------
    weight : float or "auto"
        Reward of a pair of agreeing neighbours, in units of the unary log-probabilities. A map of
        half the cell size has twice as many pairs along every border, so a good weight depends on
        the resolution. ``"auto"`` is 2 divided by the mean degree of the graph's nodes, a total of
        2 for all neighbours of a node: 1 on a chain, a quarter on a grid with diagonals.
    inference : str
        The name of a decoder (docs/inference.md): ``graph-cut``, ``trw-s``, ...
    certify : bool
        Whether to add an upper bound of the best score if the decoder has none.
    evidence : {"posterior", "likelihood"} or float
        Whether to use the unary as posteriors, or, with ``likelihood``, to divide it by the labels'
        ``shares``; a number from 0 to 1 is the exponent of the shares. Posteriors include the
        prior, which neighbours then count repeatedly: smoothing posteriors loses rare labels.
    shares : list of K float, optional
        Share of each label to divide by; labelers set the shares of the labelled nodes
        (:meth:`with_shares`).
    edge_weights : {"equal", "given"}
        Whether ``w_ij`` is 1 for all edges, or the problem's one column of ``edge_features``:
        strength of a tie, similarity of two ends.
    clique_weight : float
        Reward per node of a set in the problem's ``cliques`` whose nodes all agree.
    clique_dissent : float
        The share of its nodes that may differ before a set earns nothing; see
        :mod:`pgm_places.solvers.set_terms`.
    max_iterations : int, optional
        Limit of the decoder's iterations instead of its own.
    damping : float, optional
        Weight of the old value in updates of messages and beliefs, instead of the decoder's
        default, for ``max-product``, ``sum-product`` and ``mean-field``.
    temperature : float or "auto"
        Divisor of the logarithms of a decoder's beliefs; labels never change. ``"auto"`` is fitted
        by a labeler of maps or problems by maximum likelihood on held-out scores; otherwise 1.

    Examples
    --------
    >>> from pgm_places.graph.label_graph import LabelGraph
    >>> unary = np.log([[0.9, 0.1], [0.4, 0.6], [0.9, 0.1]])
    >>> chain = LabelGraph.from_edges(3, [(0, 1), (1, 2)])
    >>> PottsField().infer(LabelingProblem(chain, ["room", "corridor"], unary)).labels.tolist()
    [0, 0, 0]
    """

    traits: ClassVar[Traits] = Traits(uses_node_features=False)

    weight: float | Literal["auto"] = "auto"
    inference: Decoder = "graph-cut"
    certify: bool = False
    evidence: Evidence = "posterior"
    shares: tuple[Positive, ...] | None = None
    edge_weights: Literal["equal", "given"] = "equal"
    clique_weight: AtLeastZero = 0.5
    clique_dissent: Annotated[float, Gt(0), Le(1)] = 0.5
    max_iterations: Whole | None = None
    damping: Damping | None = None
    temperature: Temperature = "auto"

    @property
    def gives_beliefs(self) -> bool:
        """Whether its decoder returns beliefs."""
        return gives_beliefs(self.inference)

    def with_shares(self, labelings: Sequence[NDArray[np.int64]], n_labels: int) -> "PottsField":
        """A field with the labels' shares in these labels; itself if it does not divide by them.

        One node of each label is added, so that none has the share 0.
        """
        if not divided_share(self.evidence) or self.shares is not None:
            return self
        known = np.concatenate([labels[labels >= 0] for labels in labelings])
        counts = np.bincount(known, minlength=n_labels) + 1.0
        return replace(self, shares=tuple((counts / counts.sum()).tolist()))

    def chosen_on(
        self,
        problems: Sequence[LabelingProblem],
        labelings: Sequence[NDArray[np.int64]],
        *,
        factors: Sequence[float] = FACTORS,
    ) -> "PottsField":
        """A field with the weight that labels these problems best.

        The unaries should be held-out scores: on its training nodes a classifier hardly errs, and
        smoothing seems unnecessary.

        Parameters
        ----------
        problems : sequence of LabelingProblem
        labelings : sequence of (N,) int
            True labels, -1 where unknown: these nodes are smoothed, but not counted.
        factors : sequence of float
            Candidate weights, in units of ``"auto"`` of the first problem; among equals in accuracy
            the first.

        Examples
        --------
        >>> from pgm_places.graph.label_graph import LabelGraph
        >>> chain = LabelGraph.from_lattice((6,))
        >>> unary = np.array([[2.0, 0], [0, 1], [2, 0], [0, 2], [1, 0], [0, 2]])
        >>> problem = LabelingProblem(chain, ["room", "corridor"], unary)
        >>> PottsField().chosen_on([problem], [np.array([0, 0, 0, 1, 1, 1])]).weight
        1.2
        """
        pairs = labelled_problems(problems, labelings)
        unit = _by_degree(pairs[0][0].graph)
        candidates = [replace(self, weight=float(factor * unit)) for factor in factors]
        right = [
            sum(int((c.infer(p).labels == t)[t >= 0].sum()) for p, t in pairs) for c in candidates
        ]
        return candidates[int(np.argmax(right))]

    def infer(self, problem: LabelingProblem) -> Labeling:
        """The labelling that the decoder finds, with its score and status.

        Raises
        ------
        InputError
            The problem has no unary, forbids every label at some node, or lacks ``given`` edge
            weights; or the decoder does not support the weight (a graph cut needs at least 0).
        """
        return tempered(self._decoded(problem), self.temperature)

    def _decoded(self, problem: LabelingProblem) -> Labeling:
        unary = self._evidence(problem, evident_unary(problem, "potts", with_cliques=True))
        weight = _by_degree(problem.graph) if self.weight == "auto" else self.weight
        earned = weight * _edge_weights(problem) if self.edge_weights == "given" else weight
        potentials = Potentials.potts(unary, earned)
        return decode_cliques_as(self, problem, potentials, self.inference, self.clique_weight)

    def _evidence(
        self, problem: LabelingProblem, unary: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """The unary divided by shares per ``evidence``; nodes without observation stay."""
        share = divided_share(self.evidence)
        if not share:
            return unary
        if self.shares is None or len(self.shares) != problem.n_labels:
            came = "none" if self.shares is None else f"{len(self.shares)}"
            raise InputError(
                f"evidence={self.evidence!r} divides by the share of each of {problem.n_labels} "
                f"labels, got {came}; pass shares=[...], or label with a StructuredLabeler, which "
                "learns them"
            )
        return without_prior(problem, unary, np.asarray(self.shares) / np.sum(self.shares), share)


def _by_degree(graph: LabelGraph) -> float:
    """The weight with a total reward of 2 for the neighbours of a node of mean degree."""
    mean_degree = 2 * graph.n_edges / max(graph.n_nodes, 1)
    return NEIGHBOURHOOD / max(mean_degree, 1.0)


def _edge_weights(problem: LabelingProblem) -> NDArray[np.float64]:
    """(E,) the edge weights of the problem."""
    weights = problem.edge_features
    if weights is None or weights.shape[1] != 1:
        came = "none" if weights is None else f"shape {weights.shape}"
        raise InputError(
            f"edge_weights='given' needs edge_features of shape ({problem.graph.n_edges}, 1), one "
            f"weight per edge, got {came}"
        )
    return weights[:, 0]
