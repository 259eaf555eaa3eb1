"""A labelling problem: a graph, the label names, and the evidence about each node."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places import _checks
from pgm_places._arguments import public
from pgm_places.errors import InfeasibleError, InputError, quoted
from pgm_places.graph.cliques import Cliques, check_cliques
from pgm_places.graph.known_labels import keep_known
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.description import ProblemDescription, describe
from pgm_places.inference.potentials import with_unseen_nodes, with_unseen_rows


@public
@dataclass(frozen=True, eq=False)
class LabelingProblem:
    """A graph with label names and evidence, the input of methods.

    Parameters
    ----------
    graph : LabelGraph
        N nodes, E edges.
    label_names : sequence of str
        The K labels; label ``k`` everywhere means ``label_names[k]``.
    unary : (N, K) float64 or float32, optional
        Log-probabilities of the labels from a classifier of single nodes. Single precision takes
        half the memory; all methods but ``relaxation`` make a copy in double precision. A row of
        NaN is a node without observation, see ``unseen``.
    node_features : (N, D) float, optional
        Features of the nodes, for models that learn their own unary potentials. Sparse ones of
        SciPy (words of a sentence, codes of a vocabulary) stay sparse.
    edge_features : (E, F) float, optional
        Features of the edges, for models that learn weights of edges; associative models need them
        to be at least 0. Rows are those of ``graph.edges``; ``graph.edge_order(pairs).values``
        brings rows of other pairs there.
    known : (N,) int, optional
        Observed label index of nodes, -1 elsewhere. Every method keeps these labels and labels the
        other nodes conditioned on them; likewise for labels that ``-inf`` in ``unary`` forbids.
        ``amn`` and ``crf`` also learn the other labels conditioned on these (see
        :mod:`pgm_places.models.observed_labels`). Models do not store them.
    cliques : Cliques, optional
        C sets of nodes that tend to share a label, such as superpixels; the graph's by default.
        ``potts``, ``amn`` and ``crf`` support them.
    clique_features : (C, G) float, optional
        Features of the cliques, at least 0, for models that learn weights of cliques: the
        similarity of their nodes, the confidence in the clique, or 1 in the column of its kind.
    unseen : (N,) bool, optional
        Nodes without observation, in addition to nodes whose row of ``unary`` is NaN; None without
        such nodes. Their row becomes ``-log K``, which methods do not treat as an observation:
        ``independent`` returns equal beliefs, all others use the neighbours, and ``relaxation``
        starts with the labels' shares in training. Networks with ``unary`` as input get the mean
        of the other nodes instead.

    At least one of ``unary``, ``node_features`` and ``known`` is needed; with ``known`` alone the
    unary is 0 for all labels.

    Raises
    ------
    InputError
        Arrays do not fit the graph or the labels, or a node has no allowed label.

    Examples
    --------
    >>> import numpy as np
    >>> graph = LabelGraph.from_edges(2, [(0, 1)])
    >>> unary = np.log([[0.9, 0.1], [0.5, 0.5]])
    >>> LabelingProblem(graph, ["room", "corridor"], unary=unary)
    LabelingProblem(LabelGraph(2 nodes, 1 edges), labels room, corridor; unary (2, 2))
    """

    graph: LabelGraph
    label_names: Sequence[str]
    unary: NDArray[np.float64] | None = None
    node_features: NDArray[np.float64] | None = None
    edge_features: NDArray[np.float64] | None = None
    known: NDArray[np.int64] | None = None
    cliques: Cliques | None = None
    clique_features: NDArray[np.float64] | None = None
    unseen: NDArray[np.bool_] | None = None

    def __post_init__(self) -> None:
        _checks.require_type("graph", self.graph, LabelGraph)
        if isinstance(self.label_names, str) or not isinstance(self.label_names, Iterable):
            raise InputError(
                f"label_names must be a list of names, got {self.label_names!r}; a list of one is "
                "['name']"
            )
        names = tuple(str(name) for name in self.label_names)
        if len(names) < 1 or len(set(names)) != len(names):
            raise InputError(f"label_names must be at least one name, each once, got {list(names)}")
        _checks.set_frozen(self, label_names=names)
        n, e = self.graph.n_nodes, self.graph.n_edges
        if self.known is not None:
            known = _checks.integer_array("known", self.known, (n,), low=-1, high=len(names))
            _checks.set_frozen(self, known=known)
            if self.unary is None and self.node_features is None:
                _checks.set_frozen(self, unary=np.zeros((n, len(names))))
        self._check_cliques()
        if self.unary is None and self.node_features is None:
            raise InputError(
                f"a problem needs unary log-probabilities of shape ({n}, {len(names)}) or "
                f"node_features of shape ({n}, D); it has neither"
            )
        if self.unary is not None:
            unary, unseen = with_unseen_nodes(self.unary, self.unseen, n, len(names))
            _checks.set_frozen(self, unary=unary, unseen=unseen)
            self._check_allowed()
        elif self.unseen is not None:
            raise InputError("unseen marks rows of unary, but the problem has no unary")
        if self.node_features is not None:
            nodes = _checks.feature_rows("node_features", self.node_features, n)
            _checks.set_frozen(self, node_features=nodes)
        if self.edge_features is not None:
            edges = _checks.finite_array("edge_features", self.edge_features, (e, "F"))
            _checks.set_frozen(self, edge_features=edges)

    def _check_cliques(self) -> None:
        """Use the graph's cliques by default, and check the features of cliques."""
        if self.cliques is None:
            _checks.set_frozen(self, cliques=self.graph.cliques)
        if self.cliques is not None:
            check_cliques(self.cliques, self.graph.n_nodes)
        if self.clique_features is None:
            return
        if self.cliques is None:
            raise InputError("clique_features need cliques, the sets of nodes that they are of")
        features = _checks.finite_array(
            "clique_features", self.clique_features, (len(self.cliques.sizes), "G")
        )
        if features.min(initial=0.0) < 0:
            raise InputError(
                f"clique_features must be at least 0, got {features.min():g}; split signed "
                "features into a positive and a negative column"
            )
        _checks.set_frozen(self, clique_features=features)

    def __repr__(self) -> str:
        extras = [
            f"{name} {values.shape}"
            for name in ("unary", "node_features", "edge_features", "known", "clique_features")
            if (values := getattr(self, name)) is not None
        ]
        if self.cliques is not None and self.cliques is not self.graph.cliques:
            extras.append(f"{len(self.cliques.sizes)} cliques")
        names = ", ".join(self.label_names)
        return f"LabelingProblem({self.graph!r}, labels {names}; {', '.join(extras)})"

    @classmethod
    def from_probabilities(
        cls,
        graph: LabelGraph,
        label_names: Sequence[str],
        probabilities: ArrayLike,
        *,
        node_features: NDArray[np.float64] | None = None,
        edge_features: NDArray[np.float64] | None = None,
        known: NDArray[np.int64] | None = None,
    ) -> Self:
        """The problem with the logarithm of (N, K) probabilities, such as a classifier's, as unary.

        A probability of 0 forbids the label at the node; a row of NaN means no observation.

        Raises
        ------
        InputError
            A row is partly NaN, a probability is outside 0..1, or the sum of a row is not 1 within
            1e-3.
        """
        table, unseen = with_unseen_rows(
            "probabilities", probabilities, graph.n_nodes, len(label_names), probable=True
        )
        if table.size and (table.min() < 0 or table.max() > 1):
            raise InputError(
                f"probabilities must be from 0 to 1, got values from {table.min():g} to "
                f"{table.max():g}; log-probabilities go in as unary"
            )
        wrong = np.flatnonzero(np.abs(table.sum(axis=1) - 1) > 1e-3)
        if len(wrong):
            raise InputError(
                f"probabilities must sum to 1 in every row, got {table[wrong[0]].sum():g} in row "
                f"{int(wrong[0])}"
            )
        with np.errstate(divide="ignore"):
            unary = np.log(table)
        return cls(graph, label_names, unary, node_features, edge_features, known, unseen=unseen)

    @property
    def n_labels(self) -> int:
        """K, the number of labels."""
        return len(self.label_names)

    def subproblem(self, nodes: ArrayLike) -> Self:
        """The problem on the nodes where the mask (N,) is true, renumbered in order."""
        keep = _checks.node_mask(nodes, self.graph.n_nodes)
        graph = self.graph.subgraph(keep)
        inside = keep[self.graph.edges].all(axis=1)
        sets, of_sets = self.cliques, self.clique_features
        if sets is not None and of_sets is not None:
            of_sets = of_sets[sets.sizes_among(keep) > 0]
        return type(self)(
            graph,
            self.label_names,
            None if self.unary is None else self.unary[keep],
            None if self.node_features is None else self.node_features[keep],
            None if self.edge_features is None else self.edge_features[inside],
            None if self.known is None else self.known[keep],
            graph.cliques if sets is self.graph.cliques or sets is None else sets.among(keep),
            of_sets,
            None if self.unseen is None else self.unseen[keep],
        )

    def describe(self, labels: ArrayLike | None = None) -> ProblemDescription:
        """Statistics of the problem, with warnings: degree, label balance, scale of the unary.

        Parameters
        ----------
        labels : (N,) int, optional
            The training labels, -1 where unknown; ``known`` by default.

        Examples
        --------
        >>> graph = LabelGraph.from_edges(3, [(0, 1), (1, 2)])
        >>> problem = LabelingProblem(graph, ["a", "b"], [[0.0, 1.0], [0.0, 0.4], [0.5, 0.0]])
        >>> print(problem.describe([0, 0, 1]))
        3 nodes, 2 edges, 2 labels
        1.3 neighbours in the mean, 0 nodes with none
        100 % of the nodes have a label
        of these: a 66.7 %, b 33.3 %
        unary: best label over second 0.50 (median)
        neighbours decide at Potts weights above 0.38
        """
        truth = np.full(self.graph.n_nodes, -1) if self.known is None else self.known
        if labels is not None:
            truth = _checks.integer_array("labels", labels, truth.shape, low=-1, high=self.n_labels)
        return describe(self.graph, self.label_names, truth, self.unary, self.cliques)

    def with_unary(self, unary: NDArray[np.float64]) -> Self:
        """The problem with other scores (N, K); forbidden labels (-inf) stay forbidden.

        Only rows of NaN are unseen in it.
        """
        if self._forbids_some:
            _checks.require_shape("unary", unary.shape, (self.graph.n_nodes, self.n_labels))
            unary = np.where(self.unary == -np.inf, -np.inf, unary)
        return replace(self, unary=unary, unseen=None)

    def with_evidence(self, scores: NDArray[np.float64]) -> NDArray[np.float64]:
        """Scores (N, K) with -inf for every forbidden label, by which methods respect evidence.

        Labels are forbidden where ``unary`` is -inf, and at a node with a known label all others.
        Without forbidden labels the array itself is returned.
        """
        _checks.require_shape("scores", scores.shape, (self.graph.n_nodes, self.n_labels))
        if scores is not self.unary and self._forbids_some:
            scores = np.where(self.unary == -np.inf, -np.inf, scores)
        return keep_known(scores, self.known)

    @property
    def evidence(self) -> NDArray[np.bool_]:
        """(N,) whether a label is known or forbidden at each node."""
        known = np.zeros(self.graph.n_nodes, np.bool_)
        if self.known is not None:
            known |= self.known >= 0
        if self._forbids_some:
            assert self.unary is not None
            known |= (self.unary == -np.inf).any(axis=1)
        return known

    @property
    def _forbids_some(self) -> bool:
        return self.unary is not None and self.unary.min(initial=0.0) == -np.inf

    def _name(self, node: int) -> str:
        names = self.graph.node_names
        return str(node) if names is None else repr(names[node])

    def _check_allowed(self) -> None:
        """Refuse a node without an allowed label; checked in blocks, to save memory."""
        assert self.unary is not None
        for some in _checks.row_blocks(len(self.unary)):
            best = self.unary[some].max(axis=1, initial=-np.inf)
            barred = some.start + np.flatnonzero(best == -np.inf)
            if len(barred):
                raise InfeasibleError(
                    f"unary forbids every label at node {self._name(int(barred[0]))}; "
                    "allow at least one, or give a row of zeros where nothing is known"
                )
        if self.known is None:
            return
        nodes = np.flatnonzero(self.known >= 0)
        barred = nodes[self.unary[nodes, self.known[nodes]] == -np.inf]
        if len(barred):
            node = int(barred[0])
            raise InputError(
                f"node {self._name(node)} is known to be "
                f"{self.label_names[self.known[node]]!r}, which unary forbids there (-inf)"
            )


ONE_BY_ONE = "; the problems of a list are labelled one by one"


def require_no_cliques(problem: LabelingProblem) -> None:
    """Refuse a problem with cliques, for a method that does not support them."""
    if problem.cliques is not None:
        raise InputError(
            "only the methods 'potts', 'amn' and 'crf' support cliques; use one of them, or "
            "leave the cliques out"
        )


def evident_unary(
    problem: LabelingProblem,
    method: str,
    *,
    with_cliques: bool = False,
    single: bool = False,
    observed: bool = False,
) -> NDArray[np.float64]:
    """(N, K) the unary with known and forbidden labels applied, for a method that needs one.

    It has double precision, unless the method supports ``single`` and the problem has single
    precision. With ``observed``, allowed labels are NaN at nodes without observation. InputError
    for a problem without unary, or with cliques, which the method does not support.
    """
    _checks.require_type("the problem", problem, LabelingProblem, ONE_BY_ONE)
    if not with_cliques:
        require_no_cliques(problem)
    if problem.unary is None and problem.known is None:
        raise InputError(
            f"{method!r} needs unary log-probabilities; the problem has none. Give its unary, or "
            "put a classifier in front: StructuredLabeler(method, classifier)"
        )
    even = np.zeros((problem.graph.n_nodes, problem.n_labels))
    unary = problem.with_evidence(even if problem.unary is None else problem.unary)
    if observed and problem.unseen is not None:
        unary = np.where(problem.unseen[:, None] & (unary > -np.inf), np.nan, unary)
    return unary if single else unary.astype(np.float64, copy=False)


def listed_problems(problems: Iterable[LabelingProblem]) -> list[LabelingProblem]:
    """The problems as a list; InputError for a single problem or other objects."""
    if isinstance(problems, LabelingProblem):
        raise InputError("problems must be a list, got a single LabelingProblem; write [problem]")
    if not isinstance(problems, Iterable) or isinstance(problems, np.ndarray):
        raise InputError(f"problems must be a list of LabelingProblem, got {quoted(problems)}")
    listed = list(problems)
    for index, problem in enumerate(listed):
        _checks.require_type(f"problems[{index}]", problem, LabelingProblem)
    return listed


def labelled_problems(
    problems: Sequence[LabelingProblem], labelings: Sequence[ArrayLike]
) -> list[tuple[LabelingProblem, NDArray[np.int64]]]:
    """Training data: each problem with its true labels (N,), -1 where unknown.

    InputError if the list is empty, the number of labellings differs, problems have different
    labels, or a labelling does not fit its problem.
    """
    problems = listed_problems(problems)
    if not isinstance(labelings, Iterable) or (
        isinstance(labelings, np.ndarray) and not labelings.ndim
    ):
        raise InputError(f"labelings must be a list, one per problem, got {quoted(labelings)}")
    labelings = list(labelings)
    if not problems or len(problems) != len(labelings):
        raise InputError(
            "training needs at least one problem and a labelling for each, got "
            f"{len(problems)} problems and {len(labelings)} labelings"
        )
    names = problems[0].label_names
    for problem in problems:
        if problem.label_names != names:
            raise InputError(
                f"problems have different labels: {list(names)} and {list(problem.label_names)}"
            )
    truths = [
        _checks.integer_array(
            f"labelings[{m}]", labels, (problem.graph.n_nodes,), low=-1, high=len(names)
        )
        for m, (problem, labels) in enumerate(zip(problems, labelings, strict=True))
    ]
    return list(zip(problems, truths, strict=True))
