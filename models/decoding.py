"""Decoding by name: from a graph with potentials to a labelling with score, bound and status."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._arguments import public
from pgm_places._checks import integer_array
from pgm_places.errors import InfeasibleError, InputError, SolverError, quoted
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.labeling import Labeling, Status
from pgm_places.inference.potentials import Potentials, checked_potentials, score
from pgm_places.models.decoders import Damping, DecodingAnswer, DecodingTask, named_decoder


def node_without_labels(graph: LabelGraph, potentials: Potentials) -> int | None:
    """A node without a possible label by arc consistency (Mackworth 1977).

    None if there is no such node, although every labelling may still be forbidden.

    Examples
    --------
    >>> unlike = np.where(np.eye(2) > 0, -np.inf, 0.0)
    >>> potentials = Potentials(np.zeros((2, 2)), unlike).with_known([1, 1])
    >>> node_without_labels(LabelGraph.from_edges(2, [(0, 1)]), potentials)
    0
    """
    allowed = potentials.unary > -np.inf
    fits = potentials.edge_tables(graph) > -np.inf
    first, second = graph.edges.T
    while allowed.any(axis=1).all():
        before = int(allowed.sum())
        for here, there, table in ((first, second, fits), (second, first, fits.transpose(0, 2, 1))):
            supported = (table & allowed[there][:, np.newaxis]).any(axis=2)
            np.logical_and.at(allowed, here, supported)
        if int(allowed.sum()) == before:
            return None
    return int(np.flatnonzero(~allowed.any(axis=1))[0])


@contextlib.contextmanager
def naming_the_node(graph: LabelGraph, potentials: Potentials) -> Iterator[None]:
    """Add the name of a contradictory node, if one is found, to an InfeasibleError of the block."""
    try:
        yield
    except InfeasibleError as error:
        node = None if "node" in str(error) else node_without_labels(graph, potentials)
        if node is None:
            raise
        names = graph.node_names
        raise InfeasibleError(
            f"no label is left for node {node if names is None else repr(names[node])}: known or "
            "forbidden labels (-inf) at this node and its neighbours contradict; allow more labels"
        ) from None


# A gap below this share of the score, and of the problem's size or of the labelling's loss against
# the best value of every term, is rounding: it counts as closed. The loss does not grow with rules
# written as large negative numbers; the size may.
ROUNDING = 64 * float(np.finfo(np.float64).eps)

# A bound below its own score by more than this share of all magnitudes is wrong, not rounded.
FALSE = 1e-9

# A certificate ends when its gap is this share of the problem's size, or its bound stops falling.
CERTIFY_TOLERANCE = 1e-9

# Passes of TRW-S for a certificate; on maps the bound has almost converged by then.
CERTIFY_ITERATIONS = 100


@public
def decode(
    graph: LabelGraph,
    potentials: Potentials,
    method: str = "graph-cut",
    *,
    known: ArrayLike | None = None,
    certify: bool = False,
    max_iterations: int | None = None,
    damping: Damping | None = None,
    on_iteration: Callable[[int, float], None] | None = None,
    inside: bool = False,
    decoder: Callable[[DecodingTask], DecodingAnswer] | None = None,
) -> Labeling:
    """A labelling of the graph by the named method, with its score, bound and status.

    Parameters
    ----------
    graph : LabelGraph
        N nodes, E edges.
    potentials : Potentials
        Log-potentials; larger is better.
    method : str
        The name of a decoder: :func:`~pgm_places.models.decoders.decoder_names` lists them.
    known : (N,) int, optional
        Label index of the nodes whose label is known, -1 elsewhere; the others are forbidden there.
    certify : bool
        Add an upper bound of the best score by tree-reweighted message passing if the method has
        none. Labels do not change. ``info["certificate"]`` has the cost of the certificate.
    max_iterations : int, optional
        Limit of sweeps, passes or iterations instead of the method's default; ignored by ``lp`` and
        ``exact``, and by ``max-product`` and ``sum-product`` without cycles, which need two sweeps.
    damping : float, optional
        Weight of the old value in each update of a message or belief, from 0 to below 1, instead of
        the method's default: 0.5 for ``max-product`` on graphs with cycles, where undamped messages
        converge to poor labellings, and 0 for ``sum-product`` and ``mean-field``. Other methods
        have no damping.
    on_iteration : callable, optional
        Called after each iteration with its number and the method's progress: score
        (``graph-cut``), bound (``trw-s``), changed nodes (``icm``), largest change (the others).
    inside : bool
        Add internal quantities to ``info``: ``pair_beliefs`` (E, K, K), the probability of the
        labels at both ends of each edge, and ``disagreement`` (E,), that they differ, from
        ``exact``, ``sum-product`` and ``mean-field``; ``messages`` (2 E, K) from ``sum-product``
        and ``max-product``; ``duals`` (2 E, K), the dual variables whose
        :func:`~pgm_places.solvers.marginal_lp.dual_bound` is the bound, from ``trw-s``, ``lp`` and,
        of two labels, ``graph-cut``. An error for decoders that have none of them.
    decoder : callable, optional
        Replaces the decoder named ``method``.

    Returns
    -------
    Labeling
        ``EXACT`` if the labelling is proved optimal: by the method, or because its gap is only
        rounding (some units in the last place of the score). ``CONVERGED`` at a local optimum or
        fixed point, ``RELAXED`` if a fractional solution was rounded, ``STOPPED`` at the limit. If
        the method ends at a forbidden labelling (-inf), a search continues from there:
        ``REPAIRED`` if it finds an allowed labelling, ``INFEASIBLE`` if it gives up. Beliefs come
        from ``sum-product``, ``mean-field`` and ``exact``. ``info`` holds ``decoder``,
        ``iterations``, ``seconds`` and ``history``, the method's progress per iteration.

    Raises
    ------
    ConfigError
        The method is unknown; the message suggests the nearest name.
    InputError
        The method does not support these potentials or this graph, or they do not match.
    InfeasibleError
        Every labelling is provably forbidden; the message names a node without a possible label.
    SolverError
        A registered or installed decoder returns labels that do not exist, a bound below the score
        of its own labelling, or ``EXACT`` with an open gap.

    Examples
    --------
    >>> graph = LabelGraph.from_edges(2, [(0, 1)])
    >>> potentials = Potentials.potts([[1.0, 0.0], [0.0, 0.4]], 0.5)
    >>> labeling = decode(graph, potentials)
    >>> labeling.labels.tolist(), labeling.score, labeling.status
    ([0, 0], 1.5, <Status.EXACT: 'exact'>)
    """
    run = decoder or named_decoder(method).run
    potentials = checked_potentials(graph, potentials, known)
    started = time.perf_counter()
    history: list[float] = []

    def record(iteration: int, value: float) -> None:
        history.append(value)
        if on_iteration is not None:
            on_iteration(iteration, value)

    task = DecodingTask(graph, potentials, record, max_iterations, inside, damping)
    with naming_the_node(graph, potentials):
        answer = run(task)
        _check_form(method, answer, potentials)
        total = score(graph, potentials, answer.labels)
        if total == -np.inf:
            answer = _repaired(task, answer)
        total = score(graph, potentials, answer.labels)
    info: dict[str, object] = {"decoder": method, "iterations": len(history)}
    info |= {"seconds": time.perf_counter() - started, "history": tuple(history)}
    info.update(answer.info)
    if inside:
        info.update(_inside(method, answer))
    bound = answer.bound
    if certify and bound is None:
        bound, info["certificate"] = _certificate(task, answer.labels, total)
    if bound is not None:
        _check_bound(method, task, answer.status, total, bound)
        bound = max(bound, total)
    return Labeling(
        labels=answer.labels,
        status=_final_status(task, answer.status, total, bound),
        beliefs=answer.beliefs,
        score=total,
        bound=bound,
        info=info,
    )


def _inside(name: str, answer: DecodingAnswer) -> dict[str, object]:
    """Internal quantities of the answer; InputError if there are none."""
    of_pairs = answer.info.get("pair_beliefs")
    if of_pairs is not None:
        return {"disagreement": 1 - np.einsum("ekk->e", of_pairs)}
    if not {"messages", "duals"} & set(answer.info):
        raise InputError(
            f"inside is not supported by {name!r} here: messages come from 'sum-product' and "
            "'max-product', pair beliefs from 'exact', 'sum-product' and 'mean-field', dual "
            "variables from 'trw-s', 'lp' and, with two labels, 'graph-cut'"
        )
    return {}


def _check_form(name: str, answer: DecodingAnswer, potentials: Potentials) -> None:
    """Raise SolverError unless labels, and beliefs if any, have the right shape."""
    if not isinstance(answer, DecodingAnswer):
        raise SolverError(f"decoder {name!r} must return a DecodingAnswer, got {quoted(answer)}")
    shape = potentials.n_nodes, potentials.n_labels
    try:
        integer_array("its labels", answer.labels, shape[:1], low=0, high=shape[1])
    except InputError as error:
        raise SolverError(f"decoder {name!r} gave no labelling of this graph: {error}") from None
    if answer.beliefs is not None and answer.beliefs.shape != shape:
        raise SolverError(
            f"decoder {name!r} must give beliefs of shape {shape}, got {answer.beliefs.shape}"
        )


def _check_bound(name: str, task: DecodingTask, status: Status, total: float, bound: float) -> None:
    """Raise SolverError if a bound is below the score, or leaves a gap in spite of EXACT."""
    if bound >= total and status is not Status.EXACT:
        return
    known = task.potentials
    terms = (known.unary, known.pairwise, known.agreement)
    sizes = [np.abs(term[np.isfinite(term)]).max(initial=0.0) for term in terms if term is not None]
    slack = FALSE * (abs(total) + max(sizes) + task.model.size)
    if bound < total - slack:
        raise SolverError(
            f"decoder {name!r} returned an upper bound of {bound:.12g}, but its own labelling "
            f"scores {total:.12g}: its bound is wrong"
        )
    if status is Status.EXACT and bound > total + FALSE * _magnitude(task, total):
        raise SolverError(
            f"decoder {name!r} returned status EXACT for a labelling that scores {total:.12g}, but "
            f"an upper bound of {bound:.12g}"
        )


def _repaired(task: DecodingTask, answer: DecodingAnswer) -> DecodingAnswer:
    """The answer with an allowed labelling, if the search finds one."""
    from pgm_places.solvers.local_search import allowed_labels

    labels = allowed_labels(task.model, answer.labels)
    if labels is None:
        return replace(answer, status=Status.INFEASIBLE)
    return replace(answer, labels=labels, status=Status.REPAIRED)


def _certificate(
    task: DecodingTask, labels: NDArray[np.int64], total: float
) -> tuple[float, dict[str, object]]:
    """An upper bound of every score, and its cost."""
    from pgm_places.solvers.trws import trws

    started = time.perf_counter()
    start = None if total == -np.inf else labels
    bounded = trws(
        task.model, initial=start, max_iterations=CERTIFY_ITERATIONS, tolerance=CERTIFY_TOLERANCE
    )
    return bounded.bound, {
        "best_score": bounded.score,
        "iterations": len(bounded.history),
        "seconds": time.perf_counter() - started,
    }


def _final_status(task: DecodingTask, status: Status, total: float, bound: float | None) -> Status:
    """EXACT if score and bound differ by rounding only, else the method's status."""
    if bound is None or total == -np.inf or status is Status.EXACT:
        return status
    gap = bound - total
    if gap > 0 and gap > ROUNDING * _magnitude(task, total):
        return status
    return Status.EXACT


def _magnitude(task: DecodingTask, total: float) -> float:
    """The unit of rounding of a gap."""
    return abs(total) + min(task.model.size, max(task.model.top - total, 0.0))
