"""Probabilistic relaxation labelling: beliefs updated by compatibility with neighbours."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._arguments import travels
from pgm_places._checks import freeze, integer_array, number_array, row_blocks, set_frozen
from pgm_places.errors import InputError, NotFittedError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.layout import GridLayout
from pgm_places.inference.backends import LearnedNames, Traits, in_learned_order, learned
from pgm_places.inference.labeling import Labeling, Status
from pgm_places.inference.problem import LabelingProblem, evident_unary, labelled_problems
from pgm_places.models import relaxation_choice as on_held_out
from pgm_places.models.evidence_weight import Evidence, divided_share, without_prior
from pgm_places.models.labelled_examples import labelled_parts
from pgm_places.options import AtLeastZero, Whole, check_options
from pgm_places.options.marks import Ge, Lt
from pgm_places.solvers.relaxation import (
    DIRECTIONS,
    Beliefs,
    OnIteration,
    Relaxed,
    check_tables,
    edge_pair_counts,
    grid_pair_counts,
    relax_graph,
    yamamoto_coefficients,
)


@travels
@dataclass(frozen=True, eq=False)
class Relaxation(LearnedNames):
    """Relaxation labelling: parallel iterative updates of beliefs by those of neighbours.

    A label gains if the neighbours' labels are compatible with it (paper eq. 4-6, Rosenfeld, Hummel
    and Zucker 1976); compatibilities are estimated from counts on labelled maps. On a grid,
    occupied cells have a further label, ``wall``, that never changes; unknown cells are ignored.

    Parameters
    ----------
    max_iterations : int or "auto"
        Limit of the iterations. ``auto`` is what labels held-out training problems best, or
        held-out blocks of a single one; 0 where none label these as accurately as the scores alone,
        and 50 where nothing can be held out. The paper takes 10.
    tolerance : float
        Converged when no belief changes by more.
    damping : float
        Weight of the old belief in each update, from 0 to below 1.
    directional : bool
        Whether compatibilities depend on the direction: 8 on a grid; forward and backward along
        edges on other graphs. The paper has one table for all.
    diagonal_weight : float
        Influence of a cell that shares a corner against one that shares a side; 1 gives each of
        the 8 neighbours 1/8 as in the paper. On other graphs every neighbour has 1/degree.
    compatibility : (K, K) or (kinds, K, K) float, optional
        User-defined coefficients from -1 to 1 in place of learned ones: ``[l, m]`` is the support
        of label ``m`` at a neighbour for label ``l`` here. With several tables each edge uses the
        table of its ``edge_kind``, or with ``directional`` of its direction. Walls then have no
        influence, and :meth:`fit` does not change the coefficients.
    smoothing : float
        Added to the count of each pair of labels, so that labels that never touched in training do
        not exclude each other.
    floor : float
        Smallest initial probability of an allowed label: the multiplicative update could not change
        probabilities of 0.
    evidence : {"auto", "posterior", "likelihood"} or float
        Whether initial scores are used as posteriors (the paper's), or, with ``likelihood``,
        divided by the labels' shares in training; a number from 0 to 1 is the exponent of the
        shares. With posteriors, every neighbour counts the prior again.
        ``auto`` is chosen together with ``max_iterations``
        (:func:`~pgm_places.models.relaxation_choice.best_row`), and 0 where these are given.

    Examples
    --------
    >>> graph = LabelGraph.from_grid(np.ones((1, 6), dtype=bool))
    >>> truth = np.array([0, 0, 0, 1, 1, 1])
    >>> z = np.array([[0.8, 0.2], [0.4, 0.6], [0.8, 0.2], [0.2, 0.8], [0.4, 0.6], [0.1, 0.9]])
    >>> problem = LabelingProblem(graph, ["room", "corridor"], unary=np.log(z))
    >>> Relaxation().fit([problem], [truth]).infer(problem).labels.tolist()
    [0, 0, 0, 1, 1, 1]
    """

    traits: ClassVar[Traits] = Traits(uses_node_features=False, takes_single_precision=True)

    max_iterations: Whole | Literal["auto"] = "auto"
    tolerance: AtLeastZero = 1e-4
    damping: Annotated[float, Ge(0), Lt(1)] = 0.0
    directional: bool = False
    diagonal_weight: AtLeastZero = 1.0
    smoothing: AtLeastZero = 1.0
    floor: Annotated[float, Ge(0), Lt(1)] = 1e-6
    evidence: Evidence | Literal["auto"] = "auto"
    pair_counts: NDArray[np.int64] | None = learned()
    """(D, L, L) pairs (label here, label at the neighbour); D is 1, or one per direction; the last
    of the L = K + 1 labels is the wall."""
    compatibility: NDArray[np.float64] | None = learned(given=True)
    """(D, L, L) coefficients r of equation 6; user-defined ones may be (D, K, K)."""
    label_prior: NDArray[np.float64] | None = learned()
    """(K,) share of each label in training."""
    choice: NDArray[np.float64] | None = learned()
    """The chosen iterations and share of the prior."""
    held_out: NDArray[np.float64] | None = learned()
    """(P, 4) all compared iterations and shares, with accuracy and balanced accuracy; the scores
    without iterations first."""

    def __post_init__(self) -> None:
        check_options(self)
        if self.max_iterations != "auto" or self._is_given:  # no choice on held-out scores
            set_frozen(self, traits=replace(self.traits, learns_from_labels=True))
        if self.compatibility is None:
            return
        tables = number_array("compatibility", self.compatibility)
        tables = tables[np.newaxis] if tables.ndim == 2 else tables
        if tables.ndim != 3 or tables.shape[1] != tables.shape[2] or not tables.size:
            raise InputError(
                "compatibility must have shape (K, K), or (kinds, K, K) with a table for each kind "
                f"of edge, got {np.shape(self.compatibility)}"
            )
        set_frozen(self, compatibility=check_tables(tables, tables.shape[1]))

    @property
    def summary(self) -> Mapping[str, Any]:
        """The choice and the held-out scores of all candidates; {} without a choice."""
        if self.held_out is None:
            return {}
        rows = on_held_out.rows_of(self.held_out)
        return {"max_iterations": self._iterations, "evidence": self._share, "held_out": rows}

    @property
    def choices(self) -> Mapping[str, str]:
        """The choices on training data, in words by option; {} without a choice."""
        return {} if self.held_out is None else on_held_out.choice_words(self.summary)

    @property
    def _iterations(self) -> int:
        if self.max_iterations != "auto":
            return self.max_iterations
        return on_held_out.iterations_of(self.choice)

    @property
    def _share(self) -> float:
        if self.evidence != "auto":
            return divided_share(self.evidence)
        if self.choice is None or self.max_iterations != "auto":
            return 0.0
        return float(self.choice[1])

    # ------------------------------------------------------------------ learning

    def fit(
        self, problems: Sequence[LabelingProblem], labelings: Sequence[NDArray[np.int64]]
    ) -> Self:
        """A new model with coefficients from the pair counts of all labelled problems.

        Ordered pairs (node, neighbour) are counted where both are labelled; on a grid a wall counts
        as labelled where it touches a labelled cell.

        Raises
        ------
        InputError
            No two labelled neighbours, other labels, or directional grids and other graphs mixed.
        """
        pairs = labelled_problems(problems, labelings)
        if self._is_given:
            return self
        counts = [self.counts(problem, truth) for problem, truth in pairs]
        if len({len(of_problem) for of_problem in counts}) > 1:
            raise InputError(
                "directional relaxation has 8 directions on grids and 2 on other graphs; learn "
                "from one kind of graph, or set directional=False"
            )
        total = np.sum(counts, axis=0)
        if not total.sum():
            raise InputError("no two neighbours are both labelled; there is nothing to count")
        fitted = replace(
            self,
            pair_counts=total,
            compatibility=yamamoto_coefficients(total, smoothing=self.smoothing),
            label_prior=on_held_out.label_shares(pairs),
            choice=None,
            held_out=None,
        ).with_names_of(pairs[0][0])
        if self.max_iterations != "auto":
            return fitted
        table = on_held_out.compared(self, labelled_parts(problems, labelings))
        if table is None:
            return fitted
        return replace(fitted, choice=on_held_out.best_row(table)[:2].copy(), held_out=table)

    def counts(self, problem: LabelingProblem, known: NDArray[np.int64]) -> NDArray[np.int64]:
        """(1, L, L) pair counts of one problem, or (8, L, L) or (2, L, L) if directional."""
        graph, n_labels = problem.graph, problem.n_labels
        connectivity = grid_connectivity(graph)
        if connectivity is None:
            counts = edge_pair_counts(known, graph.edges, n_labels + 1)
        else:
            counts = grid_pair_counts(_labels_and_walls(graph, known, n_labels), n_labels + 1)
            if connectivity == 4 or self.diagonal_weight == 0:
                counts[[d for d, step in enumerate(DIRECTIONS) if 0 not in step]] = 0
        return counts if self.directional else counts.sum(axis=0, keepdims=True)

    # ------------------------------------------------------------------ inference

    @in_learned_order
    def infer(self, problem: LabelingProblem, *, truth: ArrayLike | None = None) -> Labeling:
        """The label of the largest belief at every node, with the beliefs.

        ``info["history"]`` holds, per iteration, the largest ``change`` of a belief, the
        ``mean_change``, and ``support``, the mean of ``sum_l p(l) q(l)`` before it.

        Parameters
        ----------
        problem : LabelingProblem
            With unary log-probabilities.
        truth : (N,) int, optional
            True label per node, -1 where unknown: adds ``accuracy`` to the history, and
            ``recording_seconds``, which ``seconds`` leaves out.

        Raises
        ------
        NotFittedError
            Before :meth:`fit`.
        InputError
            No unary; a node with every label forbidden; labels or directions other than learned.
        """
        begin = time.perf_counter()
        if self.compatibility is None:
            raise NotFittedError("Relaxation is not fitted; call fit first, or give compatibility")
        unary = self.start(problem)
        size = self.compatibility.shape[1]
        if size != problem.n_labels + 1 and not (self._is_given and size == problem.n_labels):
            what = f"learned {size - 1} labels (and the wall)"
            what = f"was given {size} labels" if self._is_given else what
            raise InputError(f"relaxation {what}, but the problem has {problem.n_labels}")
        recorder = None if truth is None else _AccuracyRecorder(truth, problem.n_labels)
        relaxed = self.relaxed(problem.graph, unary, recorder)
        changes = {"change": relaxed.max_change, "mean_change": relaxed.mean_change}
        history = {**changes, "support": relaxed.support}
        info: dict[str, Any] = {"iterations": relaxed.iterations, "history": history}
        info["seconds"] = time.perf_counter() - begin
        if recorder is not None:
            history["accuracy"] = recorder.accuracy
            info["recording_seconds"] = recorder.seconds
            info["seconds"] -= recorder.seconds
        return Labeling(
            freeze(_best(relaxed.beliefs)),
            Status.CONVERGED if relaxed.converged else Status.STOPPED,
            beliefs=freeze(relaxed.beliefs),
            info=info,
        )

    def start(self, problem: LabelingProblem) -> NDArray[np.float64]:
        """(N, K) the initial scores, divided by the prior as ``evidence`` demands.

        Nodes without an observation start at the labels' shares in training. Coefficients are
        relative to these shares: from uniform beliefs, a rare label would spread.
        """
        unary = evident_unary(problem, "relaxation", single=True)
        start = unary
        if self._share:
            if self.label_prior is None:
                raise InputError(
                    f"evidence={self.evidence!r} divides by the labels' shares in training, which "
                    "user-defined coefficients lack; use evidence='posterior'"
                )
            if len(self.label_prior) == unary.shape[1]:  # infer reports other numbers
                start = without_prior(problem, unary, self.label_prior, self._share)
        if problem.unseen is None or self.pair_counts is None:
            return start
        shares = self.pair_counts.sum(axis=(0, 2))[:-1] + 1.0
        unseen = problem.unseen[:, None] & (unary > -np.inf)
        return np.where(unseen, np.log(shares / shares.sum()), start).astype(unary.dtype)

    def relaxed(
        self, graph: LabelGraph, unary: NDArray[np.float64], on_iteration: OnIteration | None
    ) -> Relaxed:
        """The beliefs after all iterations, from initial scores (N, K)."""
        assert self.compatibility is not None  # infer has checked
        n_labels = unary.shape[1]
        tables = self.compatibility
        by_kind = len(tables) > 1 and not self.directional
        if tables.shape[1] == n_labels:  # walls have no influence
            tables = np.pad(tables, ((0, 0), (0, 1), (0, 1)))
        options: dict[str, Any] = {
            "floor": self.floor,
            "damping": self.damping,
            "max_iterations": self._iterations,
            "tolerance": self.tolerance,
            "on_iteration": on_iteration,
        }
        connectivity = None if by_kind else grid_connectivity(graph)
        if not by_kind:
            self._check_directions(len(tables), 2 if connectivity is None else len(DIRECTIONS))
        if connectivity is None:
            near = graph.neighbours
            which: NDArray[np.int8] | None = None
            if by_kind:
                which = _kinds(graph, len(tables))[near.edge]
            elif len(tables) > 1:
                nodes = np.repeat(np.arange(graph.n_nodes), np.diff(near.start))
                which = (near.node < nodes).astype(np.int8)
            table = tables[:, :n_labels, :n_labels]
            return relax_graph(unary, near.start, near.node, table, table=which, **options)
        from pgm_places.solvers.grid_relaxation import relax_grid

        layout = graph.grid_layout
        return relax_grid(
            unary,
            layout.cells,
            layout.shape,
            tables,
            walls=lambda: layout.walls,
            diagonal_weight=self.diagonal_weight if connectivity == 8 else 0.0,
            **options,
        )

    @property
    def _is_given(self) -> bool:
        """Whether the coefficients are user-defined."""
        return self.compatibility is not None and self.pair_counts is None

    def _check_directions(self, learned_tables: int, wanted: int) -> None:
        if learned_tables not in (1, wanted):
            raise InputError(
                f"relaxation learned coefficients for {learned_tables} directions, but this graph "
                f"has {wanted}; train on graphs of the same kind, or set directional=False"
            )


def _kinds(graph: LabelGraph, n_tables: int) -> NDArray[np.int8]:
    """(E,) the kind of each edge; InputError if a kind has no table."""
    kinds = graph.edge_kind
    if kinds is None:
        raise InputError(
            f"compatibility has {n_tables} tables, one for each kind of edge, but the graph's "
            "edges have no kind; give edge_kind to LabelGraph.from_edges, or set directional=True"
        )
    if kinds.max(initial=0) >= n_tables:
        raise InputError(
            f"compatibility has tables for kinds 0 to {n_tables - 1}, but an edge has kind "
            f"{kinds.max()}"
        )
    return kinds


def grid_connectivity(graph: LabelGraph) -> int | None:
    """8 or 4 if the graph's edges are exactly those of its raster's cells, else None."""
    layout = graph.layout
    if not isinstance(layout, GridLayout):
        return None
    sides, corners = layout.n_pairs
    if graph.n_edges == sides + corners:
        return 8
    return 4 if graph.n_edges == sides else None


def _labels_and_walls(
    graph: LabelGraph, known: NDArray[np.int64], n_labels: int
) -> NDArray[np.int16]:
    """(H, W) labels, -1 where unknown; walls that touch a labelled cell are label K."""
    from scipy.ndimage import binary_dilation

    layout = graph.grid_layout
    raster: NDArray[np.int16] = layout.to_raster(known.astype(np.int16), fill=-1)
    if layout.walls is not None:
        near = binary_dilation(raster >= 0, np.ones((3, 3), np.bool_))
        raster[near & layout.walls] = n_labels
    return raster


def _best(beliefs: Beliefs) -> NDArray[np.int64]:
    """(N,) the label of the largest belief; int32 for float32 beliefs."""
    labels = np.empty(len(beliefs), np.int32 if beliefs.dtype == np.float32 else np.int64)
    for some in row_blocks(len(beliefs)):
        labels[some] = beliefs[some].argmax(axis=1)
    return labels  # type: ignore[return-value]


class _AccuracyRecorder:
    """Accuracy after each iteration, and the time of recording."""

    def __init__(self, truth: ArrayLike, n_labels: int) -> None:
        true = integer_array("truth", truth, ("N",), low=-1, high=n_labels)
        self.known = np.flatnonzero(true >= 0)
        self.true = true[self.known]
        self.accuracy: list[float] = []
        self.seconds = 0.0

    def __call__(self, _iteration: int, _change: float, beliefs: Callable[[], Beliefs]) -> None:
        begin = time.perf_counter()
        right = beliefs()[self.known].argmax(axis=1) == self.true
        self.accuracy.append(float(right.mean()) if len(right) else np.nan)
        self.seconds += time.perf_counter() - begin
