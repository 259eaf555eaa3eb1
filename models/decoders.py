"""Decoders by name: their input and output, the built-in ones, and the registry of others."""

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import ConfigError, InputError, nearest_name
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.raster_edges import RasterEdges
from pgm_places.inference.labeling import Status
from pgm_places.inference.potentials import Potentials
from pgm_places.options.marks import Ge, Lt, NameOf

if TYPE_CHECKING:
    from pgm_places.solvers.mean_field import GridMeanField, MeanField
    from pgm_places.solvers.pairwise import PairwiseModel


Damping = Annotated[float, Ge(0), Lt(1)]
"""Weight of the old message or belief in an update."""


def model_of(graph: LabelGraph, potentials: Potentials) -> "PairwiseModel":
    """The solvers' model of potentials on a graph."""
    from pgm_places.solvers.pairwise import pairwise_model

    return pairwise_model(potentials.unary, graph.edges, potentials.agreement, potentials.pairwise)


@dataclass(frozen=True)
class DecodingTask:
    """The input of a decoder.

    Parameters
    ----------
    graph, potentials
        The problem; shapes are checked.
    record : callable
        To be called after each iteration with its number, from 1, and a measure of progress.
    limit : int, optional
        Limit of the iterations, if the user has set one.
    inside : bool
        Whether ``info`` should include internal quantities such as messages, if there are any.
    damping : float, optional
        Weight of old messages or beliefs in an update, if the user has set one.
    """

    graph: LabelGraph
    potentials: Potentials
    record: Callable[[int, float], None]
    limit: int | None = None
    inside: bool = False
    damping: float | None = None

    @cached_property
    def model(self) -> "PairwiseModel":
        """The solvers' model of the problem."""
        return model_of(self.graph, self.potentials)

    def limited(self, name: str = "max_iterations") -> dict[str, Any]:
        """Keyword arguments of a solver: the limit, if any, under its name, and the reporter."""
        chosen: dict[str, Any] = {"on_iteration": self.record}
        if self.limit is not None:
            chosen[name] = self.limit
        return chosen

    def damped(self, default: float = 0.0) -> dict[str, Any]:
        """The keyword arguments of :meth:`limited` and the damping."""
        return {**self.limited(), "damping": default if self.damping is None else self.damping}


@dataclass(frozen=True)
class DecodingAnswer:
    """The output of a decoder; the score is computed from the labels.

    Parameters
    ----------
    labels : (N,) int
        A label index per node. If they are forbidden (-inf), an allowed labelling is searched.
    status : Status
        ``EXACT`` only if the labelling is proved optimal, else ``CONVERGED``, or ``STOPPED`` at the
        limit.
    bound : float, optional
        Upper bound of all scores. If it equals the score up to rounding, the status becomes
        ``EXACT``.
    beliefs : (N, K) float, optional
        Probability of each label at each node; rows sum to one.
    info : mapping
        Further results by name.
    """

    labels: NDArray[np.int64]
    status: Status
    bound: float | None = None
    beliefs: NDArray[np.floating[Any]] | None = None
    info: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class NamedDecoder:
    """A decoder, whether it gives beliefs, and whether it supports graphs of many cycles."""

    run: Callable[[DecodingTask], DecodingAnswer]
    gives_beliefs: bool = False
    labels_maps: bool = True


def converged(is_converged: bool) -> Status:
    """CONVERGED or STOPPED: the status of a local method."""
    return Status.CONVERGED if is_converged else Status.STOPPED


MAX_PRODUCT_DAMPING = 0.5
"""Damping of max-product: 96 % correct on a Potts grid of 128 x 128 nodes and 16 labels, 61 %
without damping."""

MAX_PRODUCT_SWEEPS = 500
"""Sweeps of damped messages, which change half as much per sweep."""

ROUNDING = 1e-12


def _graph_cut(problem: DecodingTask) -> DecodingAnswer:
    from pgm_places.solvers.graph_cut import alpha_expansion

    cut = alpha_expansion(problem.model, **problem.limited("max_sweeps"))
    bound = cut.score if cut.exact else None
    status = Status.EXACT if cut.exact else converged(cut.converged)
    info: dict[str, object] = {"moves": cut.n_moves}
    if problem.inside and cut.exact:
        from pgm_places.solvers.marginal_lp import cut_duals

        info["duals"] = cut_duals(problem.model)
    return DecodingAnswer(cut.labels, status, bound, info=info)


def _lp(problem: DecodingTask) -> DecodingAnswer:
    from pgm_places.solvers.marginal_lp import solve_marginal_lp

    ideal = solve_marginal_lp(problem.model)
    # an integral solution is optimal only up to the solver's tolerance: its bound proves it
    status = Status.CONVERGED if ideal.integral else Status.RELAXED
    info = {"integral": ideal.integral, "node_marginals": ideal.node_marginals}
    if problem.inside:
        info["duals"] = ideal.duals
    return DecodingAnswer(ideal.labels, status, ideal.bound, info=info)


def _trws(problem: DecodingTask) -> DecodingAnswer:
    from pgm_places.solvers.trws import trws

    dual = trws(problem.model, **problem.limited(), duals=problem.inside)
    info: dict[str, object] = {"score_history": tuple(dual.history[:, 0].tolist())}
    if problem.inside:
        info["duals"] = dual.duals
    return DecodingAnswer(dual.labels, converged(dual.converged), dual.bound, info=info)


def _icm(problem: DecodingTask) -> DecodingAnswer:
    from pgm_places.solvers.local_search import iterated_conditional_modes

    search = iterated_conditional_modes(problem.model, **problem.limited())
    return DecodingAnswer(search.labels, converged(search.converged))


def _mean_field(problem: DecodingTask) -> DecodingAnswer:
    from pgm_places.solvers.mean_field import mean_field

    field: GridMeanField | MeanField | None = _mean_field_on_raster(problem)
    if field is None:
        field = mean_field(problem.model, **problem.damped())
    info: dict[str, object] = {}
    if problem.inside:
        first, second = problem.graph.edges.T
        of_pairs = np.einsum("ek,el->ekl", field.beliefs[first], field.beliefs[second])
        info["pair_beliefs"] = of_pairs
    return DecodingAnswer(field.labels, converged(field.converged), None, field.beliefs, info)


def _mean_field_on_raster(problem: DecodingTask) -> "GridMeanField | None":
    """Mean field on a raster without an edge list, for one table on all edges."""
    links, known = problem.graph.links, problem.potentials
    one_table = known.agreement is None and (known.pairwise is None or known.pairwise.ndim == 2)
    if not (isinstance(links, RasterEdges) and one_table):
        return None
    from pgm_places.solvers.mean_field import grid_mean_field

    return grid_mean_field(
        known.unary,
        links.layout.cells_rc,
        known.pairwise,
        connectivity=links.connectivity,
        **problem.damped(),
    )


def _max_product(problem: DecodingTask) -> DecodingAnswer:
    from pgm_places.solvers.belief_propagation import belief_propagation

    limits = {"max_iterations": MAX_PRODUCT_SWEEPS, **problem.damped(MAX_PRODUCT_DAMPING)}
    spread = belief_propagation(problem.model, kind="max-product", **limits)
    info: dict[str, object] = {"messages": spread.messages} if problem.inside else {}
    if spread.exact:
        return DecodingAnswer(spread.labels, Status.EXACT, spread.score, info=info)
    info |= _better(problem, spread.labels, spread.score)
    return DecodingAnswer(spread.labels, converged(spread.converged), info=info)


def _better(problem: DecodingTask, labels: NDArray[np.int64], score: float) -> dict[str, object]:
    """The result of a local search from a labelling that is not optimal, if it scores more."""
    if score == -np.inf:
        return {}
    from pgm_places.solvers.local_search import iterated_conditional_modes

    search = iterated_conditional_modes(problem.model, initial=labels)
    is_better = search.score - score > ROUNDING * (abs(score) + problem.model.size)
    return {"better_score": search.score, "better_labels": search.labels} if is_better else {}


def _sum_product(problem: DecodingTask) -> DecodingAnswer:
    from pgm_places.solvers.belief_propagation import belief_propagation, pair_beliefs

    spread = belief_propagation(problem.model, kind="sum-product", **problem.damped())
    info: dict[str, object] = {}
    if problem.inside:
        of_pairs = pair_beliefs(problem.model, spread.messages)
        info = {"pair_beliefs": of_pairs, "messages": spread.messages}
    return DecodingAnswer(spread.labels, converged(spread.converged), None, spread.beliefs, info)


def _exact(problem: DecodingTask) -> DecodingAnswer:
    from pgm_places.solvers.adjacency import is_forest
    from pgm_places.solvers.forest import forest_marginals, forest_maximum

    model = problem.model
    if not is_forest(model.around):
        return _exact_on_cycles(problem)
    best, sums = forest_maximum(model), forest_marginals(model, pairs=problem.inside)
    info: dict[str, object] = {"log_partition": sums.log_partition}
    if problem.inside:
        info["pair_beliefs"] = sums.pair_beliefs
    return DecodingAnswer(best.labels, Status.EXACT, best.score, sums.beliefs, info)


def _exact_on_cycles(problem: DecodingTask) -> DecodingAnswer:
    from pgm_places.solvers.bucket_tree import MOST_ENTRIES, BucketTree

    unary, around = problem.potentials.unary, problem.model.around
    tree = BucketTree.of(problem.model)
    if tree is None:
        raise InputError(
            f"'exact' would need tables of more than {MOST_ENTRIES:,} numbers: the treewidth of "
            f"this graph of {around.n_nodes} nodes and {around.n_edges} edges with "
            f"{unary.shape[1]} labels is too large. Use 'trw-s' for a labelling with a bound, or "
            "'sum-product' for beliefs"
        )
    labels, marginals = tree.solved(unary)
    edges = [(int(i), int(j)) for i, j in around.edges] if problem.inside else []
    sums = tree.marginals(unary, edges)
    info: dict[str, object] = {"log_partition": sums.log_partition, "width": tree.order.width}
    if problem.inside:
        info["pair_beliefs"] = np.array(sums.joints)
    best = float(marginals[0].max())
    return DecodingAnswer(labels, Status.EXACT, best, np.array(sums.beliefs), info)


DECODERS: Mapping[str, NamedDecoder] = {
    "graph-cut": NamedDecoder(_graph_cut),
    "lp": NamedDecoder(_lp),
    "trw-s": NamedDecoder(_trws),
    "icm": NamedDecoder(_icm),
    "mean-field": NamedDecoder(_mean_field, gives_beliefs=True),
    "max-product": NamedDecoder(_max_product),
    "sum-product": NamedDecoder(_sum_product, gives_beliefs=True),
    "exact": NamedDecoder(_exact, gives_beliefs=True, labels_maps=False),
}
"""Built-in decoders by name; ``docs/inference.md`` compares them."""


GROUP = "pgm_places.decoders"
"""Entry-point group of decoders in other packages: ``name = "package.module:function"``."""

_OTHER_NAMES = {
    **dict.fromkeys(("alpha-expansion", "expansion", "maxflow", "min-cut"), "graph-cut"),
    **dict.fromkeys(("bp", "lbp", "loopy-bp", "belief-propagation"), "sum-product"),
    **dict.fromkeys(("junction-tree", "variable-elimination", "viterbi"), "exact"),
    "ilp": "lp",
    "max-sum": "max-product",
    "mf": "mean-field",
}
"""What decoders are called in papers and other libraries."""

_registered: dict[str, NamedDecoder] = {}


def decoder_names() -> list[str]:
    """The names of all decoders: built in, registered, or installed as entry points.

    Examples
    --------
    >>> decoder_names()[:3]
    ['graph-cut', 'lp', 'trw-s']
    """
    return list(dict.fromkeys([*DECODERS, *_registered, *sorted(_installed())]))


def named_decoder(name: str) -> NamedDecoder:
    """The decoder of that name; ConfigError if it is unknown, or its entry point is no function."""
    known = DECODERS.get(name) or _registered.get(name)
    if known is not None:
        return known
    target = _installed().get(name)
    if target is None:
        if name in _OTHER_NAMES:
            raise ConfigError(f"unknown decoder {name!r}; it is called {_OTHER_NAMES[name]!r} here")
        raise ConfigError(f"unknown decoder {name!r}. {nearest_name(name, decoder_names())}")
    module_name, _, attribute = target.partition(":")
    try:
        function = getattr(importlib.import_module(module_name), attribute, None)
    except ModuleNotFoundError as error:
        raise ConfigError(
            f"decoder {name!r} needs {error.name!r}, which is not installed"
        ) from None
    if isinstance(function, NamedDecoder):
        return function
    if not callable(function):
        raise ConfigError(f"decoder {name!r}: {target} is not a function of a DecodingTask")
    return NamedDecoder(function)


def register_decoder(
    name: str,
    run: Callable[[DecodingTask], DecodingAnswer],
    *,
    gives_beliefs: bool = False,
    labels_maps: bool = True,
) -> None:
    """Register a decoder for this process, or replace a registered one.

    Afterwards ``inference = name`` and ``decode(..., name)`` accept it. Packages should use the
    entry points of :data:`GROUP` instead, which are found in every process. Test a decoder with
    :func:`~pgm_places.models.decoder_checks.check_decoder`.

    Parameters
    ----------
    name : str
    run : callable
        From a :class:`~pgm_places.models.decoders.DecodingTask` to a
        :class:`~pgm_places.models.decoders.DecodingAnswer`.
    gives_beliefs, labels_maps : bool
        See :class:`~pgm_places.models.decoders.NamedDecoder`.

    Raises
    ------
    InputError
        The name belongs to a built-in decoder.

    Examples
    --------
    >>> from pgm_places.inference.labeling import Status
    >>> def by_unary(task):
    ...     return DecodingAnswer(task.potentials.unary.argmax(axis=1), Status.CONVERGED)
    >>> register_decoder("by-unary", by_unary)
    >>> "by-unary" in decoder_names()
    True
    """
    if name in DECODERS:
        raise InputError(f"{name!r} is a decoder of this package; choose another name")
    _registered[name] = NamedDecoder(run, gives_beliefs, labels_maps)


def gives_beliefs(name: str) -> bool:
    """Whether the decoder of that name returns beliefs."""
    return named_decoder(name).gives_beliefs


def _installed() -> dict[str, str]:
    from importlib.metadata import entry_points  # slow to import: a tenth of a short command

    return {point.name: point.value for point in entry_points(group=GROUP)}


Decoder = Annotated[str, NameOf(tuple(DECODERS), decoder_names)]
"""Type of options that name a decoder; ``docs/inference.md`` compares them."""
