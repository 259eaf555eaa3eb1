"""A labelling problem: a graph, the label names, and the evidence about each node."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array, frozen, integer_array
from pgm_places.errors import InputError
from pgm_places.graph.label_graph import LabelGraph

__all__ = ["LabelingProblem", "labelled_problems"]


@dataclass(frozen=True, eq=False)
class LabelingProblem:
    """What a backend needs to label a graph.

    Parameters
    ----------
    graph : LabelGraph
        N nodes, E edges.
    label_names : sequence of str
        The K labels; label ``k`` everywhere means ``label_names[k]``.
    unary : (N, K) float, optional
        Log-probabilities of the labels from a classifier that looks at each node alone.
    node_features : (N, D) float, optional
        Features of the nodes, for models that learn their own unary potentials.
    edge_features : (E, F) float, optional
        Non-negative features of the edges, for models that learn edge weights.

    At least one of ``unary`` and ``node_features`` is needed.

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

    def __post_init__(self) -> None:
        names = tuple(str(name) for name in self.label_names)
        if len(names) < 1 or len(set(names)) != len(names):
            raise InputError(f"label_names must be at least one name, each once, got {list(names)}")
        object.__setattr__(self, "label_names", names)
        n, e = self.graph.n_nodes, self.graph.n_edges
        if self.unary is None and self.node_features is None:
            raise InputError(
                f"a problem needs unary log-probabilities of shape ({n}, {len(names)}) or "
                f"node_features of shape ({n}, D); it has neither"
            )
        if self.unary is not None:
            unary = finite_array("unary", self.unary, (n, len(names)), allow_minus_inf=True)
            object.__setattr__(self, "unary", frozen(unary))
        if self.node_features is not None:
            nodes = finite_array("node_features", self.node_features, (n, "D"))
            object.__setattr__(self, "node_features", frozen(nodes))
        if self.edge_features is not None:
            edges = finite_array("edge_features", self.edge_features, (e, "F"))
            if (edges < 0).any():
                raise InputError(
                    f"edge_features must be at least 0, got {edges.min():g}; shift signed "
                    "features, or split each into a positive and a negative column"
                )
            object.__setattr__(self, "edge_features", frozen(edges))

    def __repr__(self) -> str:
        given = [
            f"{name} {values.shape}"
            for name in ("unary", "node_features", "edge_features")
            if (values := getattr(self, name)) is not None
        ]
        names = ", ".join(self.label_names)
        return f"LabelingProblem({self.graph!r}, labels {names}; {', '.join(given)})"

    @classmethod
    def from_probabilities(
        cls,
        graph: LabelGraph,
        label_names: Sequence[str],
        probabilities: ArrayLike,
        *,
        node_features: NDArray[np.float64] | None = None,
        edge_features: NDArray[np.float64] | None = None,
    ) -> Self:
        """The problem whose unary is the logarithm of (N, K) probabilities, such as a classifier's.

        A probability of 0 forbids the label there, whatever the neighbours say.

        Raises
        ------
        InputError
            A probability outside 0..1, or a row whose sum is not 1 within 1e-3.
        """
        table = finite_array("probabilities", probabilities, (graph.n_nodes, len(label_names)))
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
            return cls(graph, label_names, np.log(table), node_features, edge_features)

    @property
    def n_labels(self) -> int:
        """K, the number of labels."""
        return len(self.label_names)

    def subproblem(self, nodes: ArrayLike) -> Self:
        """The problem on the nodes where the mask (N,) is true, renumbered in order."""
        keep = np.asarray(nodes, np.bool_)
        graph = self.graph.subgraph(keep)
        inside = keep[self.graph.edges].all(axis=1)
        return type(self)(
            graph,
            self.label_names,
            None if self.unary is None else self.unary[keep],
            None if self.node_features is None else self.node_features[keep],
            None if self.edge_features is None else self.edge_features[inside],
        )


def labelled_problems(
    problems: Sequence[LabelingProblem], labelings: Sequence[ArrayLike]
) -> list[tuple[LabelingProblem, NDArray[np.int64]]]:
    """What a method learns from: each problem with its true labels (N,), -1 where unknown.

    Raises
    ------
    InputError
        No problem, another number of labelings, problems with different labels, or a labeling that
        does not fit its problem.
    """
    if not len(problems) or len(problems) != len(labelings):
        raise InputError(
            "learning takes at least one problem and as many labelings, got "
            f"{len(problems)} problems and {len(labelings)} labelings"
        )
    names = problems[0].label_names
    for problem in problems:
        if problem.label_names != names:
            raise InputError(
                f"problems have different labels: {list(names)} and {list(problem.label_names)}"
            )
    truths = [
        integer_array(f"labelings[{m}]", labels, (problem.graph.n_nodes,), low=-1, high=len(names))
        for m, (problem, labels) in enumerate(zip(problems, labelings, strict=True))
    ]
    return list(zip(problems, truths, strict=True))
