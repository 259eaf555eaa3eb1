"""Sequential tree-reweighted message passing: a labelling and an upper bound on every score."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import frozen_copy
from pgm_places._core import decode_nodes, pass_over_nodes, share_of_nodes
from pgm_places.errors import InfeasibleError
from pgm_places.solvers.convergence import check_iteration_limits
from pgm_places.solvers.elimination import lifted_duals, reduce_model
from pgm_places.solvers.pairwise import PairwiseModel, checked_labels, total_score

_DECODE_EVERY = 5
"""Iterations between two decodings; a decoding costs a quarter of an iteration."""
_STALL_WINDOW = 10
"""Iterations over which the bound is compared to detect convergence."""

# Iterations of repeated decoding of one graph: at the first call, and at later ones.
FIRST_PASSES, FURTHER_PASSES = 10, 2


@dataclass(frozen=True, eq=False)
class DualDecoding:
    """A labelling with an upper bound of the best score."""

    labels: NDArray[np.int64]
    """(N,) the best labelling found."""
    score: float
    """Its log-potential."""
    bound: float
    """No labelling scores more."""
    converged: bool
    """Whether the gap closed to the tolerance, or the bound stopped falling."""
    history: NDArray[np.float64]
    """(T, 2) after each pass up and down the best score so far and the bound."""
    duals: NDArray[np.float64] | None = None
    """(2 E, K) the dual variables of the bound, if requested; see
    :func:`pgm_places.solvers.marginal_lp.dual_bound`."""


def trws(
    model: PairwiseModel,
    *,
    initial: ArrayLike | None = None,
    max_iterations: int = 200,
    tolerance: float = 1e-6,
    eliminate: bool = True,
    duals: bool = False,
    on_iteration: Callable[[int, float], None] | None = None,
) -> DualDecoding:
    """A labelling and an upper bound of the largest score, by message passing on chains.

    The bound never rises. It is the value of the linear relaxation or close to it, and equals the
    best score on forests and, with two labels, for associative potentials. It holds up to rounding
    of 1e-12 times the sum of the potentials' magnitudes, and is never below ``score``.

    Nodes are visited in index order. A message costs O(K) for rewards of agreement of any sign and
    for truncated linear or quadratic distances of labels, O(K^2) for other tables. The labelling
    ``initial`` (N,) is returned if no better one is found. Iterations end when the gap is at most
    the share ``tolerance`` of the problem's size
    (:attr:`PairwiseModel.size <pgm_places.solvers.pairwise.PairwiseModel.size>`), or when the bound
    fell by less than a tenth of that in the last ten. ``eliminate`` applies
    :func:`~pgm_places.solvers.elimination.reduce_model` first; ``duals`` returns the dual variables
    of the bound; ``on_iteration`` gets each iteration's number and bound.

    V. Kolmogorov, "Convergent tree-reweighted message passing for energy minimization" (PAMI 2006).

    Examples
    --------
    >>> from pgm_places.solvers.pairwise import pairwise_model
    >>> dual = trws(pairwise_model([[1.0, 0.0], [0.0, 0.4]], [(0, 1)], [[0.5, 0.5]]))
    >>> dual.labels.tolist(), dual.score, dual.bound
    ([0, 0], 1.5, 1.5)
    """
    check_iteration_limits(max_iterations, tolerance)
    best = None if initial is None else checked_labels(model, initial)
    floor = -np.inf if best is None else total_score(model, best)
    reduced = reduce_model(model) if eliminate else None
    passing = _Passing(model if reduced is None else reduced.model, floor, keeps=duals)
    passing.run(max_iterations, tolerance * model.size, on_iteration)
    labels = passing.labels if reduced is None else reduced.lift(passing.labels)
    score = total_score(model, labels)
    if best is not None and not passing.improved:
        labels, score = best, floor
    history = np.array(passing.history).reshape(-1, 2)
    dual_values = passing.duals() if duals else None
    if dual_values is not None and reduced is not None:
        dual_values = lifted_duals(model, reduced, dual_values)
    return DualDecoding(
        labels=frozen_copy(labels.astype(np.int64)),
        score=score,
        bound=max(passing.bound, score),
        converged=passing.converged,
        history=frozen_copy(history),
        duals=None if dual_values is None else frozen_copy(dual_values),
    )


class RepeatedDecoding:
    """Labellings of large score for potentials on one graph that change little from call to call.

    Messages are reused: a few passes are about as good as many from zero. Not thread-safe.
    """

    def __init__(self) -> None:
        self.message: NDArray[np.float64] | None = None

    def labels(self, model: PairwiseModel) -> NDArray[np.int32]:
        """(N,) the best labelling that the passes of this call find."""
        n_passes = FIRST_PASSES if self.message is None else FURTHER_PASSES
        passing = _Passing(model, -np.inf, message=self.message)
        self.message = passing.message
        for _ in range(n_passes):
            passing.up_and_down()
        passing.decode()
        return passing.labels


class _Passing:
    """The messages of one problem and the best labelling they have led to."""

    def __init__(
        self,
        model: PairwiseModel,
        floor: float,
        *,
        message: NDArray[np.float64] | None = None,
        keeps: bool = False,
    ) -> None:
        self.model, self.keeps = model, keeps
        if message is None:
            message = np.zeros((model.around.n_edges, model.n_labels))
        self.message = self.upwards = message
        self.share = np.empty(model.n_nodes)
        share_of_nodes(model.around.arcs, self.share)
        self.trial = np.zeros(model.n_nodes, np.int32)
        self.labels = self.trial.copy()
        self.score, self.bound = floor, np.inf
        self.improved = False
        self.history: list[tuple[float, float]] = []
        self.converged = False

    def run(
        self, max_iterations: int, closed: float, on_iteration: Callable[[int, float], None] | None
    ) -> None:
        """Pass up and down until the gap is ``closed``, the bound stops falling, or the limit."""
        for iteration in range(1, max_iterations + 1):
            self.up_and_down()
            rests = self._rests(closed)
            if rests or iteration == max_iterations or iteration % _DECODE_EVERY == 1:
                self.decode()
            self.history.append((self.score, self.bound))
            if on_iteration is not None:
                on_iteration(iteration, self.bound)
            if rests or self.bound - self.score <= closed:
                self.converged = True
                return

    def up_and_down(self) -> None:
        """One iteration: a pass in each direction, which lowers the bound."""
        self._pass(upwards=True)
        if self.keeps:
            self.upwards = self.message.copy()
        self.bound = min(self.bound, self._pass(upwards=False) + self.model.offset)
        if self.bound == -np.inf:
            raise InfeasibleError

    def _rests(self, closed: float) -> bool:
        if len(self.history) < _STALL_WINDOW:
            return False
        before = self.history[-_STALL_WINDOW][1]
        return before - self.bound <= 0.1 * closed

    def _pass(self, *, upwards: bool) -> float:
        model = self.model
        return pass_over_nodes(
            upwards, model.max_terms, model.around.arcs, self.share, self.message
        )

    def duals(self) -> NDArray[np.float64]:
        """(2 E, K) dual variables of the edges after the last iteration."""
        edges = self.model.around.edges
        lower, upper = edges.min(axis=1), edges.max(axis=1)
        belief = self.model.unary.copy()
        np.add.at(belief, upper, self.upwards)
        np.add.at(belief, lower, self.message)
        with np.errstate(invalid="ignore"):
            to_upper = self.upwards - self.share[upper, np.newaxis] * belief[upper]
        to_upper[belief[upper] == -np.inf] = -np.inf
        to_lower = np.where(belief[lower] == -np.inf, -np.inf, self.message)
        to_second = np.where((edges[:, 1] == upper)[:, np.newaxis], to_upper, to_lower)
        to_first = np.where((edges[:, 0] == upper)[:, np.newaxis], to_upper, to_lower)
        return np.stack([to_second, to_first], axis=1).reshape(-1, self.model.n_labels)

    def decode(self) -> None:
        """Decode a labelling from the current messages, and store it if it is the best so far."""
        model = self.model
        score = decode_nodes(model.terms, model.around.arcs, self.message, self.trial)
        if score + model.offset > self.score:
            self.score = score + model.offset
            self.labels[:] = self.trial
            self.improved = True
