"""Decoding by name: from a graph with potentials to a labelling with score, bound and status."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import nearest_name, require_type
from pgm_places.errors import ConfigError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.raster_edges import RasterEdges
from pgm_places.inference.labeling import Labeling, Status
from pgm_places.inference.potentials import Potentials, score
from pgm_places.inference.problem import LabelingProblem

if TYPE_CHECKING:
    from pgm_places.solvers.grid_mean_field import GridMeanField
    from pgm_places.solvers.mean_field import MeanField
    from pgm_places.solvers.pairwise import PairwiseModel

__all__ = [
    "DECODERS",
    "FOREST_DECODERS",
    "GIVING_BELIEFS",
    "Decoder",
    "DecodingAnswer",
    "DecodingTask",
    "converged",
    "decode",
    "decode_as",
    "decode_by",
    "require_decoder",
]

Decoder = Literal[
    "graph-cut", "lp", "trw-s", "icm", "mean-field", "max-product", "sum-product", "exact"
]
"""The names of the decoders, as options declare them; ``docs/inference.md`` compares them."""

FOREST_DECODERS: tuple[Decoder, ...] = ("exact",)
"""Decoders of graphs without cycles only."""

GIVING_BELIEFS: tuple[Decoder, ...] = ("mean-field", "sum-product", "exact")
"""Decoders that also say how probable each label is at each node."""

ROUNDING = 1e-12
"""A gap below this share of the score and of the problem's size is rounding: it is closed."""

CERTIFY_TOLERANCE = 1e-9
"""A certificate ends when its gap is this share of the problem's size, or its bound at rest."""

CERTIFY_ITERATIONS = 100
"""Passes of TRW-S for a certificate; on maps the bound has all but come to rest by then."""


def decode(
    graph: LabelGraph,
    potentials: Potentials,
    method: str = "graph-cut",
    *,
    known: ArrayLike | None = None,
    certify: bool = False,
    max_iterations: int | None = None,
    on_iteration: Callable[[int, float], None] | None = None,
) -> Labeling:
    """A labelling of the graph by the named method, with its score, bound and status.

    Parameters
    ----------
    graph : LabelGraph
        N nodes, E edges.
    potentials : Potentials
        Log-potentials; larger is better.
    method : str
        A name of :data:`DECODERS`.
    known : (N,) int, optional
        Label index of the nodes whose label is known, -1 elsewhere; the others are forbidden there.
    certify : bool
        Add an upper bound of the best score by tree-reweighted message passing where the method
        has none of its own. The labels stay the method's. What the certificate cost is in
        ``info["certificate"]``.
    max_iterations : int, optional
        Limit on sweeps, passes or iterations instead of the method's own; ``lp`` and ``exact``
        have none, nor have ``max-product`` and ``sum-product`` without cycles: they take two.
    on_iteration : callable, optional
        Called after each of them with its number and the method's figure: score (``graph-cut``),
        bound (``trw-s``), changed nodes (``icm``), largest change (the others).

    Returns
    -------
    Labeling
        ``EXACT`` where the labelling is proved best: by the method, or because nothing but rounding
        (1e-12 of the score and of the problem's size) is left of its gap. ``CONVERGED`` at a local
        optimum or fixed point, ``RELAXED`` where a fractional solution was rounded, ``STOPPED`` at
        the limit. Where the method ends at a forbidden labelling (-inf), ``REPAIRED`` is one that
        is allowed, found by a search from there, and ``INFEASIBLE`` says that the search gave up.
        Beliefs come from ``sum-product``, ``mean-field`` and ``exact``. ``info`` holds
        ``decoder``, ``iterations``, ``seconds`` and ``history``, the method's figure per iteration.

    Raises
    ------
    ConfigError
        No such method; the message offers the nearest name.
    InputError
        The method cannot take these potentials or this graph, or they do not fit each other; or
        it is proved that they forbid every labelling.

    Examples
    --------
    >>> graph = LabelGraph.from_edges(2, [(0, 1)])
    >>> potentials = Potentials.potts([[1.0, 0.0], [0.0, 0.4]], 0.5)
    >>> labeling = decode(graph, potentials)
    >>> labeling.labels.tolist(), labeling.score, labeling.status
    ([0, 0], 1.5, <Status.EXACT: 'exact'>)
    """
    require_decoder(method)
    require_type("graph", graph, LabelGraph)
    require_type("potentials", potentials, Potentials)
    potentials.check_fits(graph)
    if known is not None:
        potentials = potentials.with_known(known)
    return decode_by(
        DECODERS[method],
        method,
        graph,
        potentials,
        certify=certify,
        max_iterations=max_iterations,
        on_iteration=on_iteration,
    )


def decode_by(
    decoder: "Callable[[DecodingTask], DecodingAnswer]",
    name: str,
    graph: LabelGraph,
    potentials: Potentials,
    *,
    certify: bool,
    max_iterations: int | None,
    on_iteration: Callable[[int, float], None] | None,
) -> Labeling:
    """What a function finds that is called ``name``; all else as of :func:`decode`."""
    started = time.perf_counter()
    history: list[float] = []

    def record(iteration: int, value: float) -> None:
        history.append(value)
        if on_iteration is not None:
            on_iteration(iteration, value)

    limit = {} if max_iterations is None else {"limit": max_iterations}
    answer = decoder(DecodingTask(graph, potentials, record, **limit))
    total = score(graph, potentials, answer.labels)
    if total == -np.inf:
        answer = _repaired(graph, potentials, answer)
        total = score(graph, potentials, answer.labels)
    info: dict[str, Any] = {"decoder": name, "iterations": len(history)}
    info |= {"seconds": time.perf_counter() - started, "history": tuple(history)}
    info.update(answer.info)
    bound = answer.bound
    if certify and bound is None:
        bound, info["certificate"] = _certificate(graph, potentials, answer.labels)
    if bound is not None:
        bound = max(bound, total)
    return Labeling(
        labels=answer.labels,
        status=_final_status(graph, potentials, answer.status, total, bound),
        beliefs=answer.beliefs,
        score=total,
        bound=bound,
        info=info,
    )


class DecodingOptions(Protocol):
    """What methods with a decoder let their users choose."""

    @property
    def certify(self) -> bool: ...
    @property
    def max_iterations(self) -> int | None: ...


def decode_as(
    method: DecodingOptions, problem: LabelingProblem, potentials: Potentials, inference: Decoder
) -> Labeling:
    """What a decoder finds for a problem's graph, as the options of a method want it."""
    return decode(
        problem.graph,
        potentials,
        inference,
        certify=method.certify,
        max_iterations=method.max_iterations,
    )


def require_decoder(method: str) -> None:
    """Raise ConfigError, offering the nearest name, unless there is such a decoder."""
    if method not in DECODERS:
        raise ConfigError(f"unknown decoder {method!r}. {nearest_name(method, list(DECODERS))}")


@dataclass(frozen=True)
class DecodingTask:
    """What a decoder gets; it reports each iteration to ``record``."""

    graph: LabelGraph
    potentials: Potentials
    record: Callable[[int, float], None]
    limit: int | None = None

    @property
    def arrays(self) -> tuple[Any, ...]:
        """Unary, edges, agreement and pairwise, as every solver takes them."""
        known = self.potentials
        return known.unary, self.graph.edges, known.agreement, known.pairwise

    def limited(self, name: str = "max_iterations") -> dict[str, Any]:
        """The limit under the solver's name for it, where there is one, and the reporter."""
        chosen: dict[str, Any] = {"on_iteration": self.record}
        if self.limit is not None:
            chosen[name] = self.limit
        return chosen


@dataclass(frozen=True)
class DecodingAnswer:
    """What a decoder finds; its score is worked out from the labels."""

    labels: NDArray[np.int64]
    status: Status
    bound: float | None = None
    beliefs: NDArray[np.floating[Any]] | None = None
    info: Mapping[str, Any] = field(default_factory=dict)


def _graph_cut(problem: DecodingTask) -> DecodingAnswer:
    from pgm_places.solvers.expansion import alpha_expansion

    found = alpha_expansion(*problem.arrays, **problem.limited("max_sweeps"))
    bound = found.score if found.exact else None
    status = Status.EXACT if found.exact else converged(found.converged)
    return DecodingAnswer(found.labels, status, bound, info={"moves": found.n_moves})


def _lp(problem: DecodingTask) -> DecodingAnswer:
    from pgm_places.solvers.marginal_lp import solve_marginal_lp

    found = solve_marginal_lp(*problem.arrays)
    # an integral solution is the best only as far as the solver is exact: its bound proves it
    status = Status.CONVERGED if found.integral else Status.RELAXED
    info = {"integral": found.integral, "node_marginals": found.node_marginals}
    return DecodingAnswer(found.labels, status, found.bound, info=info)


def _trws(problem: DecodingTask) -> DecodingAnswer:
    from pgm_places.solvers.trws import trws

    found = trws(*problem.arrays, **problem.limited())
    info = {"score_history": tuple(found.history[:, 0].tolist())}
    return DecodingAnswer(found.labels, converged(found.converged), found.bound, info=info)


def _icm(problem: DecodingTask) -> DecodingAnswer:
    from pgm_places.solvers.local_search import iterated_conditional_modes

    found = iterated_conditional_modes(*problem.arrays, **problem.limited())
    return DecodingAnswer(found.labels, converged(found.converged))


def _mean_field(problem: DecodingTask) -> DecodingAnswer:
    from pgm_places.solvers.mean_field import mean_field

    found: GridMeanField | MeanField | None = _mean_field_on_raster(problem)
    if found is None:
        found = mean_field(*problem.arrays, **problem.limited())
    return DecodingAnswer(found.labels, converged(found.converged), beliefs=found.beliefs)


def _mean_field_on_raster(problem: DecodingTask) -> "GridMeanField | None":
    """Mean field without a list of the edges, where one table holds for all edges of a raster."""
    links, known = problem.graph.links, problem.potentials
    one_table = known.agreement is None and (known.pairwise is None or known.pairwise.ndim == 2)
    if not (isinstance(links, RasterEdges) and one_table):
        return None
    from pgm_places.solvers.grid_mean_field import grid_mean_field

    return grid_mean_field(
        known.unary,
        links.layout.cells_rc,
        known.pairwise,
        connectivity=links.connectivity,
        **problem.limited(),
    )


def _max_product(problem: DecodingTask) -> DecodingAnswer:
    from pgm_places.solvers.belief_propagation import belief_propagation

    found = belief_propagation(*problem.arrays, kind="max-product", **problem.limited())
    if found.exact:
        return DecodingAnswer(found.labels, Status.EXACT, found.score)
    return DecodingAnswer(found.labels, converged(found.converged))


def _sum_product(problem: DecodingTask) -> DecodingAnswer:
    from pgm_places.solvers.belief_propagation import belief_propagation

    found = belief_propagation(*problem.arrays, kind="sum-product", **problem.limited())
    return DecodingAnswer(found.labels, converged(found.converged), beliefs=found.beliefs)


def _exact(problem: DecodingTask) -> DecodingAnswer:
    from pgm_places.solvers.forest import forest_marginals, forest_maximum

    best = forest_maximum(*problem.arrays)
    whole = forest_marginals(*problem.arrays)
    return DecodingAnswer(
        best.labels,
        Status.EXACT,
        best.score,
        whole.beliefs,
        {"log_partition": whole.log_partition},
    )


DECODERS: Mapping[str, Callable[[DecodingTask], DecodingAnswer]] = {
    "graph-cut": _graph_cut,
    "lp": _lp,
    "trw-s": _trws,
    "icm": _icm,
    "mean-field": _mean_field,
    "max-product": _max_product,
    "sum-product": _sum_product,
    "exact": _exact,
}
"""Decoders by name; ``docs/inference.md`` says which to take when."""


def converged(is_converged: bool) -> Status:
    """The status of a local method that came to rest, or was stopped."""
    return Status.CONVERGED if is_converged else Status.STOPPED


def _model(graph: LabelGraph, potentials: Potentials) -> "PairwiseModel":
    from pgm_places.solvers.pairwise import pairwise_model

    arrays = (potentials.unary, graph.edges, potentials.agreement, potentials.pairwise)
    return pairwise_model(*arrays)


def _repaired(graph: LabelGraph, potentials: Potentials, answer: DecodingAnswer) -> DecodingAnswer:
    """The answer with labels that break no rule, where the search finds such."""
    from pgm_places.solvers.feasibility import allowed_labels

    labels = allowed_labels(_model(graph, potentials), answer.labels)
    if labels is None:
        return replace(answer, status=Status.INFEASIBLE)
    return replace(answer, labels=labels, status=Status.REPAIRED)


def _certificate(
    graph: LabelGraph, potentials: Potentials, labels: NDArray[np.int64]
) -> tuple[float, dict[str, Any]]:
    """An upper bound of every score, and what finding it took."""
    from pgm_places.solvers.trws import trws

    started = time.perf_counter()
    arrays = (potentials.unary, graph.edges, potentials.agreement, potentials.pairwise)
    start = None if score(graph, potentials, labels) == -np.inf else labels
    found = trws(
        *arrays, initial=start, max_iterations=CERTIFY_ITERATIONS, tolerance=CERTIFY_TOLERANCE
    )
    return found.bound, {
        "best_score": found.score,
        "iterations": found.n_iterations,
        "seconds": time.perf_counter() - started,
    }


def _final_status(
    graph: LabelGraph, potentials: Potentials, status: Status, total: float, bound: float | None
) -> Status:
    """EXACT where nothing but rounding lies between score and bound, else the method's word."""
    if bound is None or total == -np.inf or status is Status.EXACT:
        return status
    gap = bound - total
    if gap > 0 and gap > ROUNDING * (abs(total) + _model(graph, potentials).size):
        return status
    return Status.EXACT
