"""Max-margin learning map by map: block-coordinate Frank-Wolfe with a cache of planes.

Every training map is a block with its own mixture of planes; one oracle call on one map moves the
weights at once, which pays when there are many maps. Planes found earlier are remembered and used
again between the calls, because a minimum cut costs far more than a product with the planes.

S. Lacoste-Julien, M. Jaggi, M. Schmidt, P. Pletscher, "Block-coordinate Frank-Wolfe optimization
for structural SVMs", ICML 2013; N. Shah, V. Kolmogorov, C. Lampert, "A multi-plane block-coordinate
Frank-Wolfe algorithm for training structural SVMs with a costly max-oracle", CVPR 2015. Steps are
pairwise (mass moves from a block's worst plane to its best), which converge linearly.
"""

import time
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.solvers.max_margin import (
    LearningStep,
    MaxMarginProblem,
    MaxMarginSolution,
    OnStep,
    Oracle,
    reached,
)

__all__ = ["frank_wolfe"]

CACHED_STEPS = 100
"""At most so many steps on a block's remembered planes per visit; each costs microseconds."""

SMALL_GAIN = 0.1
"""A visit to remembered planes ends when the block's gap is this share of the gap at its start."""

MAX_PLANES = 100
"""Planes remembered per block; the one unused for longest makes room."""


class _Block:
    """One map's planes, and the mixture of them that stands in the dual."""

    def __init__(self, problem: MaxMarginProblem, oracle: Oracle, share: float) -> None:
        self.problem = problem
        self.oracle = oracle
        self.share = share  # this map's nodes among all
        self.gradients = np.zeros((1, problem.n_weights))  # the truth's own plane: H >= 0
        self.offsets = np.zeros(1)
        self.mixture = np.ones(1)
        self.last_use = np.zeros(1, np.int64)
        self.visits = 0

    def ask(self, weights: NDArray[np.float64]) -> float:
        """Remember the plane that the oracle finds at ``weights``; its height there."""
        labels = self.oracle(*self.problem.augmented_potentials(weights))
        cut = self.problem.cut_of(labels)
        self._make_room()
        self.gradients = np.vstack([self.gradients, self.share * cut.gradient])
        self.offsets = np.append(self.offsets, self.share * cut.offset)
        self.mixture = np.append(self.mixture, 0.0)
        self.last_use = np.append(self.last_use, self.visits)
        return self.height(weights)

    def height(self, weights: NDArray[np.float64]) -> float:
        """The highest remembered plane at ``weights``."""
        return float((self.offsets - self.gradients @ weights).max())

    def _make_room(self) -> None:
        if len(self.offsets) < MAX_PLANES:
            return
        age = np.where(self.mixture > 0, np.iinfo(np.int64).max, self.last_use)
        oldest = int(age.argmin())
        for name in ("gradients", "offsets", "mixture", "last_use"):
            setattr(self, name, np.delete(getattr(self, name), oldest, axis=0))


class _Dual:
    """The point in the dual: v = C sum of mixed gradients, w = v with w_e cut at 0."""

    def __init__(self, blocks: Sequence[_Block]) -> None:
        first = blocks[0].problem
        self.penalty = first.penalty
        self.n_free = first.n_node_weights
        self.v = np.zeros(first.n_weights)
        self.offset = 0.0

    @property
    def weights(self) -> NDArray[np.float64]:
        """w(v)."""
        return self.projected(self.v)

    def projected(self, v: NDArray[np.float64]) -> NDArray[np.float64]:
        """``v`` with negative edge weights set to 0."""
        w = v.copy()
        np.maximum(w[self.n_free :], 0.0, out=w[self.n_free :])
        return w

    @property
    def value(self) -> float:
        """The dual objective, a lower bound of every f(w)."""
        weights = self.weights
        return self.offset - 0.5 * float(weights @ weights)

    def visit(self, block: _Block) -> float:
        """Pairwise steps over a block's planes; its duality gap at the start (times C)."""
        first_gap = 0.0
        block.visits += 1
        for step in range(CACHED_STEPS):
            heights = block.offsets - block.gradients @ self.weights
            best = int(heights.argmax())
            gap = float(heights[best] - block.mixture @ heights)
            if step == 0:
                first_gap = gap
            active = block.mixture > 0
            block.last_use[active] = block.visits
            worst = int(np.where(active, heights, np.inf).argmin())
            if best == worst or gap <= SMALL_GAIN * first_gap * (step > 0):
                break
            self._move(block, worst, best)
        return self.penalty * max(first_gap, 0.0)

    def _move(self, block: _Block, worst: int, best: int) -> None:
        limit = float(block.mixture[worst])
        direction = self.penalty * (block.gradients[best] - block.gradients[worst])
        rise = self.penalty * float(block.offsets[best] - block.offsets[worst])
        step = self._line_search(direction, rise, limit)
        block.mixture[best] += step
        block.mixture[worst] = 0.0 if step >= limit else limit - step
        self.v += step * direction
        self.offset += step * rise

    def _line_search(self, direction: NDArray[np.float64], rise: float, limit: float) -> float:
        """The step in [0, limit] that maximises the dual: its slope falls piecewise linearly."""

        def slope(step: float) -> float:
            return rise - float(self.projected(self.v + step * direction) @ direction)

        if slope(limit) >= 0:
            return limit
        free, bounded = direction[: self.n_free], direction[self.n_free :]
        with np.errstate(divide="ignore", invalid="ignore"):
            kinks = -self.v[self.n_free :] / bounded
        kinks = np.unique(kinks[(kinks > 0) & (kinks < limit)])
        low = 0.0
        for high in [*kinks.tolist(), limit]:
            if slope(high) < 0:
                inside = self.v[self.n_free :] + 0.5 * (low + high) * bounded > 0
                curvature = float(free @ free + bounded[inside] @ bounded[inside])
                return min(low + slope(low) / curvature, high) if curvature > 0 else low
            low = high
        return limit


def frank_wolfe(
    problems: Sequence[MaxMarginProblem],
    oracles: Sequence[Oracle],
    *,
    tolerance: float = 1e-3,
    max_passes: int = 1_000,
    time_limit_s: float | None = None,
    seed: int = 0,
    exact: bool = False,
    on_iteration: OnStep | None = None,
) -> MaxMarginSolution:
    """The weights that minimise the max-margin objective over maps, to a relative gap.

    Parameters
    ----------
    problems : sequence of MaxMarginProblem
        One per map, with the same features, labels and penalty; the objective is that of
        :func:`pgm_places.solvers.max_margin.joined`.
    oracles : sequence of callable
        One per map.
    tolerance : float
        Stop when (objective - lower bound) / objective is at most this.
    max_passes : int
        Maximum number of passes over all maps.
    time_limit_s : float, optional
        Wall-clock seconds, looked at after every pass.
    seed : int
        Of the order in which maps are visited.
    exact : bool
        Whether the oracles miss nothing, as a graph cut with two labels.
    on_iteration : callable, optional
        Called after every pass; True stops.

    Returns
    -------
    MaxMarginSolution
        ``cuts`` is empty: the planes belong to single maps. ``status`` as of
        :func:`pgm_places.solvers.cutting_plane.cutting_plane`.
    """
    if not problems or len(problems) != len(oracles):
        raise InputError(
            f"expected one oracle per training map, got {len(oracles)} for {len(problems)} maps"
        )
    start = time.perf_counter()
    rng = np.random.default_rng(seed)
    n_nodes = sum(problem.n_nodes for problem in problems)
    blocks = [
        _Block(problem, oracle, problem.n_nodes / n_nodes)
        for problem, oracle in zip(problems, oracles, strict=True)
    ]
    dual = _Dual(blocks)
    best, objective = dual.weights, np.inf
    history: list[LearningStep] = []
    status = "iteration_limit"
    estimated_gap = 0.0
    for iteration in range(1, max_passes + 1):
        order = rng.permutation(len(blocks))
        if len(blocks) == 1 or estimated_gap <= tolerance * abs(objective):
            weights = dual.weights
            hinge = sum(block.ask(weights) for block in blocks)
            value = 0.5 * float(weights @ weights) + dual.penalty * hinge
            if value < objective:
                best, objective = weights, value
            estimated_gap = sum(dual.visit(blocks[b]) for b in order)
        else:
            estimated_gap = 0.0
            for b in order:
                blocks[b].ask(dual.weights)
                estimated_gap += dual.visit(blocks[b])
        for b in order:  # a second look at the planes that are there, now that w has moved
            dual.visit(blocks[b])
        seconds = time.perf_counter() - start
        n_planes = sum(int((block.mixture[1:] > 0).sum()) for block in blocks)
        record = LearningStep(iteration, seconds, objective, max(dual.value, 0.0), n_planes)
        history.append(record)
        stop = on_iteration(record) if on_iteration is not None else False
        if record.gap <= tolerance:
            rigorous = max(objective, record.lower_bound) if exact else None
            status = reached(rigorous, record.lower_bound, tolerance)
        elif stop:
            status = "stopped"
        elif time_limit_s is not None and seconds >= time_limit_s:
            status = "time_limit"
        else:
            continue
        break
    last = history[-1]
    found = max(objective, last.lower_bound)
    return MaxMarginSolution(
        best,
        found,
        last.lower_bound,
        status,
        last.iteration,
        tuple(history),
        certified=found if exact else None,
    )
