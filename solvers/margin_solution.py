"""Results of max-margin and likelihood learners: cuts, progress, weights with bounds."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Cut:
    """A plane below the hinge: H(w) >= offset - gradient . w for every w."""

    gradient: NDArray[np.float64]
    offset: float

    def value(self, weights: NDArray[np.float64]) -> float:
        """The plane's height at ``weights``."""
        return self.offset - float(self.gradient @ weights)


@dataclass(frozen=True)
class LearningStep:
    """Progress of a learner, passed to ``on_iteration``, which returns True to stop it.

    ``objective`` is an estimate for the best weights so far; ``gap`` is
    ``(objective - lower_bound) / objective``.
    """

    iteration: int
    seconds: float
    objective: float
    lower_bound: float
    n_cuts: int

    @property
    def gap(self) -> float:
        """(objective - lower bound) / objective, 0 where both are 0."""
        return relative_gap(self.objective, self.lower_bound)


PROVED = 1e-6
"""A relative gap up to this is the tolerance of QP solvers, and counts as closed."""

REACHED = ("optimal", "within_tolerance", "oracle_limit")
"""Status words after the gap has closed: the rigorous gap to the lower bound is at most 1e-6; it
is at most the requested tolerance; or only the oracle, which may miss labellings, closes it."""


def reached(rigorous: float | None, lower_bound: float, tolerance: float) -> str:
    """The word of :data:`REACHED` for a rigorous objective; None if its gap is still open."""
    gap = np.inf if rigorous is None else relative_gap(rigorous, lower_bound)
    if gap <= PROVED:
        return "optimal"
    return "within_tolerance" if gap <= tolerance else "oracle_limit"


OnStep = Callable[[LearningStep], bool | None]
"""Called once per iteration; a learner stops with the best weights so far if it returns True."""


@dataclass(frozen=True, eq=False)
class LearnedWeights:
    """Learned weights with their objective and lower bound."""

    weights: NDArray[np.float64]
    """(n_weights,) flat: node weights (D, K), then edge weights (F, K), both row by row."""
    objective: float
    """f(weights). The QP's is the repaired, rigorously feasible value of the relaxation, an upper
    bound of f; the other learners evaluate H with their oracle, which may miss a better labelling:
    certify them. Never below ``lower_bound``, which f is not either."""
    lower_bound: float
    """No weights reach less than this (rigorous)."""
    status: str
    """What is proved: a word of :data:`REACHED`, or why learning ended earlier:
    ``iteration_limit``, ``time_limit``, ``stopped`` (by ``on_iteration``), ``stalled`` (the oracle
    finds nothing better, and the gap is open), ``inaccurate`` (the QP's solver ended with an open
    gap) or ``local_optimum`` (some labels are unknown)."""
    iterations: int
    history: tuple[LearningStep, ...] = ()
    cuts: tuple[Cut, ...] = ()
    """Cuts that are valid for the same nodes and losses at any penalty; a warm start."""
    certified: float | None = None
    """A rigorous upper bound of the objective at ``weights``, where the learner has one."""

    @property
    def gap(self) -> float:
        """(objective - lower bound) / objective, 0 where both are 0."""
        return relative_gap(self.objective, self.lower_bound)


def relative_gap(upper: float, lower: float) -> float:
    """(upper - lower) / upper, and 0 where the bounds meet."""
    return 0.0 if upper <= lower else (upper - lower) / max(abs(upper), np.finfo(float).tiny)
