"""Labeling: the result of a method, with labels, beliefs, score, bound, and status."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places import plotting
from pgm_places._arguments import public
from pgm_places._checks import (
    finite_array,
    integer_array,
    require_at_least,
    row_blocks,
    set_frozen,
)
from pgm_places.errors import InputError
from pgm_places.graph.known_labels import keep_known
from pgm_places.inference.potentials import Potentials, score
from pgm_places.inference.problem import LabelingProblem
from pgm_places.plotting import axes_or_new

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Status(StrEnum):
    """The optimality status of a labelling."""

    EXACT = "exact"
    """Proved optimal for its potentials, up to rounding: no labelling scores more."""
    CONVERGED = "converged"
    """The method converged to a fixed point or a local optimum, which may not be the best."""
    STOPPED = "stopped"
    """The method stopped at a limit on iterations or time."""
    RELAXED = "relaxed"
    """A relaxation was solved; its solution was fractional and has been rounded."""
    REPAIRED = "repaired"
    """The method's labelling violated a constraint (-inf); this one, found by a search from there,
    violates none, and no change of a single node improves it. Or a plug-in ignored known or
    forbidden labels, and only the labels of these nodes were corrected."""
    INFEASIBLE = "infeasible"
    """The labelling violates a constraint (its score is -inf), and the search found no feasible
    labelling, though one may exist."""

    @property
    def meaning(self) -> str:
        """The meaning of the status, for summaries and reports."""
        return _MEANINGS[self]

    @property
    def note(self) -> str:
        """Status and meaning in parentheses; empty for the usual ones, exact and converged."""
        usual = self in (Status.EXACT, Status.CONVERGED)
        return "" if usual else f" ({self}: {self.meaning})"


# What a decoder's history holds.
_PROGRESS = {
    "graph-cut": "score",
    "trw-s": "bound",
    "icm": "changed nodes",
    **dict.fromkeys(("mean-field", "max-product", "sum-product"), "largest change"),
}

_MEANINGS = {
    Status.EXACT: "proved best for the method's scores",
    Status.CONVERGED: "no small change of the labels scores more; quite another labelling might",
    Status.STOPPED: "the method reached its iteration limit before it settled; the labels can be "
    "used, but more iterations might change some",
    Status.RELAXED: "the rounded solution of a relaxation",
    Status.REPAIRED: "changed afterwards so that no rule is broken",
    Status.INFEASIBLE: "breaks a rule; a search found no labelling that keeps all of them",
}


@public
@dataclass(frozen=True, eq=False)
class Labeling:
    """A label for every node.

    Parameters
    ----------
    labels : (N,) int64 or int32
        Label index per node.
    status : Status
        The optimality status.
    beliefs : (N, K) float64 or float32, or None
        Probability of each label at each node; rows sum to one. None for methods without beliefs.
    score : float or None
        The log-potential of ``labels`` under the method's potentials, computed by
        :func:`pgm_places.inference.potentials.score`; None for methods without a global objective.
    bound : float or None
        An upper bound of the best score; None for methods without a bound.
    info : mapping
        Further results of the method: iterations, residuals, history, seconds.

    Examples
    --------
    >>> Labeling(np.array([0, 1, 1]), Status.EXACT, score=-0.5, bound=-0.5)
    Labeling(3 nodes, exact, score -0.5, gap 0)
    """

    labels: NDArray[np.int64]
    status: Status
    beliefs: NDArray[np.floating[Any]] | None = None
    score: float | None = None
    bound: float | None = None
    info: Mapping[str, Any] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        labels = integer_array("labels", self.labels, ("N",), low=0, high=2**31, narrow=True)
        set_frozen(self, labels=labels)
        if self.beliefs is not None:
            beliefs = finite_array("beliefs", self.beliefs, (len(labels), "K"), dtype=None)
            parts = (beliefs[some] for some in row_blocks(len(beliefs)))
            if any(np.abs(part.sum(axis=1) - 1).max() > 1e-6 for part in parts):
                raise InputError("beliefs must sum to one in every row")
            set_frozen(self, beliefs=beliefs)
        set_frozen(self, info=MappingProxyType(dict(self.info)))

    def __repr__(self) -> str:
        parts = [f"{len(self.labels)} nodes", str(self.status)]
        if self.score is not None:
            parts.append(f"score {self.score:.6g}")
        if self.gap is not None:
            parts.append(f"gap {self.gap:.2g}")
        if self.beliefs is not None:
            parts.append("with beliefs")
        return f"Labeling({', '.join(parts)})"

    def _repr_html_(self) -> str:
        """The labelling's properties as an HTML table."""
        rows = {
            "nodes": f"{len(self.labels):,}",
            "status": f"{self.status}: {self.status.meaning}",
            "score": "" if self.score is None else f"{self.score:.6g}",
            "bound": "" if self.bound is None else f"{self.bound:.6g}",
            "gap": "" if self.gap is None else f"{self.gap:.2g}",
            "decoder": str(self.info.get("decoder", "")),
        }
        cells = "".join(
            f"<tr><th style='text-align:left'>{name}</th>"
            f"<td style='text-align:left'>{html.escape(value, quote=False)}</td></tr>"
            for name, value in rows.items()
            if value
        )
        return f"<table>{cells}</table>"

    def plot_beliefs(
        self,
        label_names: Sequence[str],
        ax: Axes | None = None,
        *,
        along: ArrayLike | None = None,
        xlabel: str = "step",
    ) -> Axes:
        """Draw the beliefs of a chain's nodes, stacked, in the colours of the labels.

        Parameters
        ----------
        label_names : sequence of str
            K names.
        ax : matplotlib.axes.Axes, optional
            New axes if not given.
        along : (N,) float, optional
            Positions of the nodes on the horizontal axis, such as times in s; by default their
            numbers.
        xlabel : str

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        InputError
            The labelling has no beliefs, or names or positions do not fit them.
        """
        if self.beliefs is None:
            raise InputError("the method has no beliefs to draw")
        n_nodes, n_labels = self.beliefs.shape
        if len(label_names) != n_labels:
            raise InputError(f"label_names must be {n_labels}, got {len(label_names)}")
        where = np.arange(n_nodes) if along is None else along
        ax = axes_or_new(ax)
        plotting.draw_beliefs(
            ax, finite_array("along", where, (n_nodes,)), self.beliefs, label_names, xlabel
        )
        return ax

    def plot_convergence(self, ax: Axes | None = None) -> Axes:
        """Draw the method's progress by iteration: score, bound, support or largest change.

        Without axes, new ones are made. InputError if the method reports no history.
        """
        history = self.info.get("history", ())
        if isinstance(history, Mapping):  # of relaxation
            history, name = history["support"], "support"
        else:
            name = _PROGRESS.get(self.info.get("decoder", ""), "progress")
        history = np.asarray(history, np.float64)
        if not len(history):
            raise InputError("the method reports no figure by iteration")
        curves = {name: history}
        if "score_history" in self.info:  # the history holds bounds
            scores = np.asarray(self.info["score_history"], np.float64)
            curves = {"bound": history, "score": scores}
        ax = axes_or_new(ax)
        plotting.draw_curves(ax, curves, "iteration", " and ".join(curves))
        return ax

    def part(self, nodes: NDArray[np.int64] | slice) -> Labeling:
        """The labels and beliefs of some nodes, by number or slice; score and bound stay."""
        try:
            self.labels[nodes]
        except IndexError as error:
            raise InputError(f"nodes must be some of {len(self.labels)}: {error}") from None
        beliefs = None if self.beliefs is None else self.beliefs[nodes]
        return replace(self, labels=self.labels[nodes], beliefs=beliefs)

    @property
    def gap(self) -> float | None:
        """Largest possible distance of the score from the optimum; None without a bound."""
        if self.bound is None or self.score is None:
            return None
        return max(self.bound - self.score, 0.0)

    def is_optimal(self, tolerance: float = 0.0) -> bool:
        """Whether the score is proved to be within ``tolerance`` of the optimum.

        Proved by the method (``EXACT``, up to rounding) or by the gap; False without a bound.
        """
        require_at_least("tolerance", tolerance, 0)
        return self.status is Status.EXACT or (self.gap is not None and self.gap <= tolerance)

    def check(self, problem: LabelingProblem, potentials: Potentials | None = None) -> list[str]:
        """Inconsistencies of the labelling, a sentence each; [] if it is consistent.

        Checks the number of nodes, that labels are valid and allowed at their nodes (``known``,
        -inf in ``unary``), that beliefs are probabilities of the allowed labels, and that the bound
        is not below the score; with potentials, also that the labels have the score, within 1e-9 of
        the sum of its terms.

        Parameters
        ----------
        problem : LabelingProblem
            The problem.
        potentials : Potentials, optional
            The method's potentials: ``method.potentials(problem)``. They lack the scores of
            cliques, so the score of a problem with cliques is not checked.

        Examples
        --------
        >>> from pgm_places.graph.label_graph import LabelGraph
        >>> graph, known = LabelGraph.from_edges(2, [(0, 1)]), np.array([0, -1])
        >>> problem = LabelingProblem(graph, ["a", "b"], known=known)
        >>> Labeling(np.array([1, 1]), Status.CONVERGED).check(problem)
        ["1 labels are not allowed, the first is 'b' at node 0"]
        """
        n, k = problem.graph.n_nodes, problem.n_labels
        if len(self.labels) != n:
            return [f"it labels {len(self.labels)} nodes, the problem has {n}"]
        if self.labels.max(initial=0) >= k:
            return [f"label {self.labels.max()} is none of the problem's {k}"]
        problems = []
        allowed = _preferred(problem, np.arange(n)) > -np.inf
        broken = np.flatnonzero(~allowed[np.arange(n), self.labels])
        if len(broken):
            name = problem.label_names[self.labels[broken[0]]]
            problems.append(
                f"{len(broken)} labels are not allowed, the first is {name!r} at node {broken[0]}"
            )
        if self.beliefs is not None and self.beliefs.shape != (n, k):
            problems.append(f"beliefs have shape {self.beliefs.shape} instead of {(n, k)}")
        elif self.beliefs is not None and (
            self.beliefs.min(initial=0.0) < 0 or self.beliefs[~allowed].any()
        ):
            problems.append("beliefs are negative, or above 0 for labels that are not allowed")
        if self.score is None:
            return problems
        size = abs(self.score)
        if potentials is not None and problem.cliques is None:
            again = score(problem.graph, potentials, self.labels)
            size += float(np.abs(potentials.unary[np.arange(n), self.labels]).sum())
            if abs(again - self.score) > ROUNDING * size:
                problems.append(f"the labels score {again:.12g}, not {self.score:.12g}")
        if self.bound is not None and self.bound < self.score - ROUNDING * size:
            problems.append(f"the bound {self.bound:.12g} is below the score {self.score:.12g}")
        return problems


_NODES_AT_ONCE = 262_144

ROUNDING = 1e-9
"""Relative tolerance of scores, for sums in another order."""


def normalized_entropy(beliefs: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
    """(N,) entropy of each row of beliefs (N, K) as a share of the largest, ``log K``."""
    n_labels = beliefs.shape[1]
    if n_labels < 2:
        return np.zeros(len(beliefs))
    share = np.empty(len(beliefs))
    for rows in row_blocks(len(beliefs), _NODES_AT_ONCE):
        positive = np.clip(beliefs[rows].astype(np.float64), np.finfo(np.float64).tiny, 1.0)
        share[rows] = -(positive * np.log(positive)).sum(axis=1) / np.log(n_labels)
    return np.clip(share, 0.0, 1.0, out=share)


def keep_evidence(problem: LabelingProblem, labeling: Labeling) -> Labeling:
    """Enforce known and forbidden labels on the labelling of any method.

    All methods of the package respect evidence, so that it influences neighbours, too; their
    labellings are returned unchanged. For a method that ignores evidence, the beliefs at nodes with
    evidence are restricted to the allowed labels, and the most probable one is chosen; of labels
    with equal beliefs, or without beliefs, the best in ``unary``. Score and bound are dropped if
    labels change.

    Examples
    --------
    >>> from pgm_places.graph.label_graph import LabelGraph
    >>> graph = LabelGraph.from_edges(2, [(0, 1)])
    >>> problem = LabelingProblem(graph, ["a", "b"], known=np.array([1, -1]))
    >>> keep_evidence(problem, Labeling(np.zeros(2, np.int64), Status.CONVERGED)).labels.tolist()
    [1, 0]
    """
    nodes = np.flatnonzero(problem.evidence)
    if not len(nodes):
        return labeling
    preferred = _preferred(problem, nodes)
    allowed = preferred > -np.inf
    all_beliefs = labeling.beliefs
    beliefs = None if all_beliefs is None else all_beliefs[nodes]
    labels = labeling.labels[nodes]
    breaks = ~allowed[np.arange(len(nodes)), labels]
    if not breaks.any() and (beliefs is None or not beliefs[~allowed].any()):
        return labeling
    if all_beliefs is not None and beliefs is not None:
        beliefs = np.where(allowed, beliefs, 0)
        beliefs = np.where(beliefs.any(axis=1, keepdims=True), beliefs, allowed)
        beliefs = beliefs / beliefs.sum(axis=1, keepdims=True)
        tied = beliefs == beliefs.max(axis=1, keepdims=True)
        preferred = np.where(tied, preferred, -np.inf)
        labeling = replace(labeling, beliefs=_with_rows(all_beliefs, nodes, beliefs))
    if not breaks.any():
        return labeling
    best = np.where(breaks, preferred.argmax(axis=1), labels)
    labels = _with_rows(labeling.labels, nodes, best)
    return replace(labeling, labels=labels, status=Status.REPAIRED, score=None, bound=None)


def _preferred(problem: LabelingProblem, nodes: NDArray[np.int64]) -> NDArray[np.float64]:
    """(n, K) the unary at some nodes, zeros without one, with -inf for forbidden labels."""
    known = None if problem.known is None else problem.known[nodes]
    unary = None if problem.unary is None else problem.unary[nodes]
    scores = np.zeros((len(nodes), problem.n_labels)) if unary is None else unary
    return keep_known(scores, known)


def _with_rows(array: NDArray[Any], nodes: NDArray[np.int64], rows: NDArray[Any]) -> NDArray[Any]:
    changed = np.array(array)
    changed[nodes] = rows
    return changed
