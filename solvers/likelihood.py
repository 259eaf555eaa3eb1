"""Maximum likelihood of a field's weights: exact on forests, by two surrogates on other graphs.

Learning minimises, with N labelled nodes and the true labels t, ::

    f(w) = 1/2 |w|^2 + C/N L(w)

where L is minus the logarithm of one of

``likelihood``
    p(t), its partition function by dynamic programming (J. Lafferty, A. McCallum, F. Pereira,
    "Conditional random fields", ICML 2001);
``pseudo-likelihood``
    the product of p(t_i | labels of its neighbours) (J. Besag, "Statistical analysis of non-lattice
    data", The Statistician 1975);
``piecewise``
    the product of p(t_i, t_j) over edges, each normalised by itself with an equal share of its
    ends' unaries; no larger than p(t) (C. Sutton, A. McCallum, "Piecewise training for undirected
    models", UAI 2005).

Node weights v make a weighted mean: the term of a node has the weight v_i (``pseudo-likelihood``),
the term of a pair the smaller weight of its ends (``piecewise``), and the term of a connected part
of the graph the common weight of its nodes (``likelihood``).

Nodes of unknown label are summed over (``likelihood`` and ``piecewise``) or expected
(``pseudo-likelihood``); f is then no longer convex.
"""

import time
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pgm_places._arguments import public
from pgm_places._checks import integer_array
from pgm_places.errors import InputError
from pgm_places.graph.known_labels import keep_known
from pgm_places.solvers.margin_solution import (
    LearnedWeights,
    LearningStep,
    OnStep,
    reached,
    relative_gap,
)
from pgm_places.solvers.table_field import (
    TableField,
    exact_sums,
    expected_labels,
    piecewise_sums,
    pseudo_sums,
    require_equal_ends,
    soft_labels,
)

Likelihood = Literal["likelihood", "pseudo-likelihood", "piecewise"]

# Rounds of expecting the unknown labels; their probabilities change little after the first few.
HIDDEN_ROUNDS = 20

# Unknown labels have converged when no probability changes by more than this.
HIDDEN_MOVED = 1e-3

# Pairs of steps and gradients that L-BFGS stores.
MEMORY = 20


@public
def negative_log_likelihood(
    field: TableField,
    labels: NDArray[np.int64],
    weights: NDArray[np.float64],
    kind: Likelihood = "likelihood",
    expected: NDArray[np.float64] | None = None,
    node_weight: NDArray[np.float64] | None = None,
) -> tuple[float, NDArray[np.float64]]:
    """The negative log-likelihood ``L(w)`` of the labels, or a surrogate of it, with its gradient.

    Formulas and sources are in the module's text. ``labels`` (N,) are -1 where unknown;
    ``expected`` (N, K) are probabilities of unknown labels for ``pseudo-likelihood``, uniform by
    default. InputError for ``likelihood`` on a graph with a cycle, or with different
    ``node_weight`` (N,) in one connected part.

    Examples
    --------
    >>> from pgm_places.solvers.adjacency import adjacency
    >>> chain = TableField(np.ones((2, 1)), adjacency(2, [(0, 1)]), np.ones((1, 1)), 2)
    >>> value, gradient = negative_log_likelihood(chain, np.array([0, 1]), np.zeros(6))
    >>> round(value, 4), gradient.tolist()
    (1.3863, [0.0, 0.0, 0.25, -0.75, 0.25, 0.25])
    """
    return _Loss(field, labels, kind, node_weight).at(weights, expected)


@public
def maximize_likelihood(
    field: TableField,
    labels: NDArray[np.int64],
    penalty: float,
    *,
    kind: Likelihood = "likelihood",
    start: NDArray[np.float64] | None = None,
    node_weight: NDArray[np.float64] | None = None,
    observed: NDArray[np.int64] | None = None,
    tolerance: float = 1e-3,
    max_iterations: int = 500,
    time_limit_s: float | None = None,
    on_iteration: OnStep | None = None,
) -> LearnedWeights:
    """The weights of least f, by L-BFGS; arguments as of :func:`negative_log_likelihood`.

    The lower bound is that of a strongly convex function: f(w) exceeds its minimum by at most half
    the squared length of its gradient. With unknown labels f is not convex, and the bound is 0.

    ``penalty`` is C; learning begins at ``start`` (n_weights,), 0 by default, and ends at a
    relative gap of ``tolerance``. The likelihood is conditioned on ``observed`` labels (N,), -1
    elsewhere. With ``pseudo-likelihood`` and unknown labels, ``max_iterations`` is the limit of
    each round. ``on_iteration`` gets a :class:`~pgm_places.solvers.margin_solution.LearningStep`;
    True stops. InputError if no node of positive weight has a label.

    Examples
    --------
    >>> from pgm_places.solvers.adjacency import adjacency
    >>> edges = [(0, 1), (1, 2), (2, 3)]
    >>> chain = TableField(np.ones((4, 1)), adjacency(4, edges), np.ones((3, 1)), 2)
    >>> learned = maximize_likelihood(chain, np.array([0, 1, 0, 1]), 10.0, tolerance=1e-6)
    >>> learned.status, learned.weights[2:].round(2).tolist()
    ('optimal', [-0.7, 1.43, -0.04, -0.7])
    """
    targets = labels >= 0 if observed is None else (labels >= 0) & (observed < 0)
    n_known = int(targets.sum())
    if not n_known:
        raise InputError("maximum likelihood needs at least one labelled node, got none")
    total = float(n_known if node_weight is None else node_weight[targets].sum())
    if not total:
        raise InputError("sample_weight is 0 at every labelled node; nothing is left to learn from")
    loss = _Loss(field, labels, kind, node_weight, observed)
    descent = _Descent(loss, penalty / total, tolerance, time_limit_s)
    descent.on_iteration = on_iteration
    weights = np.zeros(field.n_weights) if start is None else np.array(start, np.float64)
    descent.run(weights, max_iterations)
    if kind == "pseudo-likelihood" and not descent.is_convex:
        for _ in range(HIDDEN_ROUNDS):
            if descent.ended or not descent.expect():
                break
            descent.run(descent.weights, max_iterations)
    return descent.solution()


@dataclass(frozen=True, eq=False)
class _Loss:
    """L as a function of the weights."""

    field: TableField
    labels: NDArray[np.int64]
    kind: Likelihood
    node_weight: NDArray[np.float64] | None
    observed: NDArray[np.int64] | None = None

    def __post_init__(self) -> None:
        shape, high = (self.field.n_nodes,), self.field.n_labels
        for name in ("labels", "observed"):
            if (labels_given := getattr(self, name)) is not None:
                integer_array(name, labels_given, shape, low=-1, high=high)
        if self.field.sets is not None:
            raise InputError(
                "likelihood learners cannot learn weights of cliques, since the sum over all "
                "labellings of a set is intractable; use learner='max-margin', or omit the cliques"
            )
        if self.kind == "likelihood" and self.node_weight is not None:
            require_equal_ends(self.field, self.node_weight)

    @cached_property
    def truth_features(self) -> NDArray[np.float64] | None:
        """(n_weights,) phi of the labels, for kinds whose L depends on them through phi only."""
        plain = self.kind == "likelihood" and self.node_weight is None and (self.labels >= 0).all()
        return self.field.features_of(self.labels) if plain else None

    def at(
        self, weights: NDArray[np.float64], expected: NDArray[np.float64] | None
    ) -> tuple[float, NDArray[np.float64]]:
        """See :func:`negative_log_likelihood`."""
        field, labels, node_weight = self.field, self.labels, self.node_weight
        potentials = field.potentials(weights)
        if self.kind == "pseudo-likelihood":
            soft = soft_labels(field, labels, expected)
            targets = labels if self.observed is None else np.where(self.observed >= 0, -1, labels)
            return pseudo_sums(field, targets, potentials, soft, node_weight)
        marginals = exact_sums if self.kind == "likelihood" else piecewise_sums
        conditioned = potentials._replace(unary=keep_known(potentials.unary, self.observed))
        free = marginals(field, conditioned, node_weight)
        value, gradient = free.log_partition, field.expected_features(*free[1:])
        if self.truth_features is not None:
            score = float(weights @ self.truth_features)
            return value - score, gradient - self.truth_features
        only = potentials._replace(unary=keep_known(potentials.unary, labels))
        known = marginals(field, only, node_weight)
        return value - known.log_partition, gradient - field.expected_features(*known[1:])


class _Descent:
    """L-BFGS on f, with its bounds and the reason it ended."""

    def __init__(
        self, loss: _Loss, price: float, tolerance: float, time_limit_s: float | None
    ) -> None:
        self.loss, self.price = loss, price
        self.tolerance, self.time_limit_s = tolerance, time_limit_s
        self.on_iteration: OnStep | None = None
        self.is_convex = bool((loss.labels >= 0).all())
        self.expected: NDArray[np.float64] | None = None
        self.started = time.perf_counter()
        self.history: list[LearningStep] = []
        self.ended: str | None = None
        self.closed = False
        self.weights = np.zeros(loss.field.n_weights)
        self.value, self.excess = np.inf, np.inf

    def f(self, weights: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        value, gradient = self.loss.at(weights, self.expected)
        total = 0.5 * float(weights @ weights) + self.price * value
        return total, weights + self.price * gradient

    def run(self, start: NDArray[np.float64], max_iterations: int) -> None:
        from scipy.optimize import minimize

        values: dict[bytes, tuple[float, float]] = {}

        def measured(weights: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
            value, gradient = self.f(weights)
            values[weights.tobytes()] = value, 0.5 * float(gradient @ gradient)
            return value, gradient

        def step(weights: NDArray[np.float64]) -> None:
            self._take(weights, *values[weights.tobytes()])
            values.clear()
            if self.closed or self.ended:
                raise StopIteration

        self.closed = False
        options: dict[str, float] = {"maxiter": max_iterations, "maxfun": 100 * max_iterations}
        options |= {"maxcor": MEMORY, "gtol": 0.0, "ftol": 0.0}
        lbfgs: Any = partial(minimize, jac=True, method="L-BFGS-B", callback=step, options=options)
        minimum = lbfgs(measured, start)
        if not self.history or self.value > minimum.fun:  # the start is the minimum
            value, gradient = self.f(minimum.x)
            self._take(minimum.x, value, 0.5 * float(gradient @ gradient))
        if not self.closed and self.ended is None:
            self.ended = "iteration_limit" if minimum.nit >= max_iterations else "stalled"

    def _take(self, weights: NDArray[np.float64], value: float, excess: float) -> None:
        """Record a step, and check whether it is the last."""
        self.weights, self.value, self.excess = weights.copy(), value, excess
        seconds = time.perf_counter() - self.started
        record = LearningStep(len(self.history) + 1, seconds, value, self.lower_bound, 0)
        self.history.append(record)
        self.closed = relative_gap(value, max(value - excess, 0.0)) <= self.tolerance
        if self.on_iteration is not None and self.on_iteration(record):
            self.ended = "stopped"
        elif self.time_limit_s is not None and seconds >= self.time_limit_s and not self.closed:
            self.ended = "time_limit"

    @property
    def lower_bound(self) -> float:
        return max(self.value - self.excess, 0.0) if self.is_convex else 0.0

    def expect(self) -> bool:
        """Expect the unknown labels at the current weights; False when they have converged."""
        known = self.expected
        expected = expected_labels(self.loss.field, self.loss.labels, self.weights, known)
        self.expected = expected
        return known is None or bool(np.abs(expected - known).max() > HIDDEN_MOVED)

    def solution(self) -> LearnedWeights:
        status = self.ended or "local_optimum"
        if self.ended is None and self.is_convex:
            status = reached(self.value, self.lower_bound, self.tolerance)
        return LearnedWeights(
            self.weights,
            self.value,
            self.lower_bound,
            status,
            len(self.history),
            tuple(self.history),
            certified=self.value,
        )
