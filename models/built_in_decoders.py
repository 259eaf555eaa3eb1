"""The built-in decoders: adapters of the solvers."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.graph.raster_edges import RasterEdges
from pgm_places.inference.labeling import Status
from pgm_places.models.decoding_task import DecodingAnswer, DecodingTask, NamedDecoder, converged

if TYPE_CHECKING:
    from pgm_places.solvers.mean_field import GridMeanField, MeanField


MAX_PRODUCT_DAMPING = 0.5
"""Damping of max-product: 96 % correct on a Potts grid of 128 x 128 nodes and 16 labels, 61 %
without damping."""

MAX_PRODUCT_SWEEPS = 500
"""Sweeps of damped messages, which change half as much per sweep."""

ROUNDING = 1e-12


def _graph_cut(problem: DecodingTask) -> DecodingAnswer:
    from pgm_places.solvers.expansion import alpha_expansion

    cut = alpha_expansion(problem.model, **problem.limited("max_sweeps"))
    bound = cut.score if cut.exact else None
    status = Status.EXACT if cut.exact else converged(cut.converged)
    info: dict[str, Any] = {"moves": cut.n_moves}
    if problem.inside and cut.exact:
        from pgm_places.solvers.duals import cut_duals

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
    info: dict[str, Any] = {"score_history": tuple(dual.history[:, 0].tolist())}
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
    info: dict[str, Any] = {}
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
    info: dict[str, Any] = {"messages": spread.messages} if problem.inside else {}
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
    info: dict[str, Any] = {}
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
    best, whole = forest_maximum(model), forest_marginals(model, pairs=problem.inside)
    info: dict[str, Any] = {"log_partition": whole.log_partition}
    if problem.inside:
        info["pair_beliefs"] = whole.pair_beliefs
    return DecodingAnswer(best.labels, Status.EXACT, best.score, whole.beliefs, info)


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
    whole = tree.marginals(unary, edges)
    info: dict[str, Any] = {"log_partition": whole.log_partition, "width": tree.order.width}
    if problem.inside:
        info["pair_beliefs"] = np.array(whole.joints)
    best = float(marginals[0].max())
    return DecodingAnswer(labels, Status.EXACT, best, np.array(whole.beliefs), info)


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
