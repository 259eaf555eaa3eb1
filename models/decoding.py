"""Decoding by name: from a graph with potentials to a labelling with score, bound and status."""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._arguments import public
from pgm_places._checks import integer_array
from pgm_places.errors import InputError, SolverError, quoted
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.labeling import Labeling, Status
from pgm_places.inference.potentials import Potentials, checked_potentials, score
from pgm_places.models.contradictions import naming_the_node
from pgm_places.models.decoders import named_decoder
from pgm_places.models.decoding_task import Damping, DecodingAnswer, DecodingTask

# A gap below this share of the score, and of the problem's size or of what the labelling loses
# against the best value of every term, is rounding: it is closed. Some roundings of a number; the
# loss does not grow with rules that are written as large negative numbers, the size may.
ROUNDING = 64 * float(np.finfo(np.float64).eps)

# A bound below its own score by more than this share of all magnitudes is no rounding: a lie.
FALSE = 1e-9

# A certificate ends when its gap is this share of the problem's size, or its bound at rest.
CERTIFY_TOLERANCE = 1e-9

# Passes of TRW-S for a certificate; on maps the bound has all but come to rest by then.
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
        Add an upper bound of the best score by tree-reweighted message passing where the method
        has none of its own. The labels stay the method's. What the certificate cost is in
        ``info["certificate"]``.
    max_iterations : int, optional
        Limit on sweeps, passes or iterations instead of the method's own; ``lp`` and ``exact``
        have none, nor have ``max-product`` and ``sum-product`` without cycles: they take two.
    damping : float, optional
        Share of its old value that each message or belief keeps in an iteration, from 0 to below 1,
        instead of the method's own: half for ``max-product`` on graphs with cycles, where messages
        without it settle at poor labellings, and none for ``sum-product`` and ``mean-field``. The
        other methods have none.
    on_iteration : callable, optional
        Called after each of them with its number and the method's figure: score (``graph-cut``),
        bound (``trw-s``), changed nodes (``icm``), largest change (the others).
    inside : bool
        Show in ``info`` what led to the labelling: ``pair_beliefs`` (E, K, K), the probability of
        the labels at both ends of each edge, and ``disagreement`` (E,), that they differ, from
        ``exact``, ``sum-product`` and ``mean-field``; ``messages`` (2 E, K) from ``sum-product``
        and ``max-product``; ``duals`` (2 E, K), the dual variables whose
        :func:`~pgm_places.solvers.duals.dual_bound` is the bound, from ``trw-s``, ``lp`` and, of
        two labels, ``graph-cut``. Refused where a decoder has none of them.
    decoder : callable, optional
        What finds the labelling instead of the decoder of that name.

    Returns
    -------
    Labeling
        ``EXACT`` where the labelling is proved best: by the method, or because nothing but rounding
        (some units in the last place of the score) is left of its gap. ``CONVERGED`` at a local
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
        The method cannot take these potentials or this graph, or they do not fit each other.
    InfeasibleError
        It is proved that they forbid every labelling; a node without any label is named.
    SolverError
        A decoder that was added claims what is false: labels that do not exist, a bound below the
        score of its own labelling, or ``EXACT`` beside a bound that leaves a gap.

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
    info: dict[str, Any] = {"decoder": method, "iterations": len(history)}
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


def _inside(name: str, answer: DecodingAnswer) -> dict[str, Any]:
    """What follows from what the answer shows; refused where it shows nothing."""
    of_pairs = answer.info.get("pair_beliefs")
    if of_pairs is not None:
        return {"disagreement": 1 - np.einsum("ekk->e", of_pairs)}
    if not {"messages", "duals"} & set(answer.info):
        raise InputError(
            f"{name!r} has nothing to look at here: messages come from 'sum-product' and "
            "'max-product', pairs of beliefs from 'exact', 'sum-product' and 'mean-field', dual "
            "variables from 'trw-s', 'lp' and, of two labels, 'graph-cut'"
        )
    return {}


def _check_form(name: str, answer: DecodingAnswer, potentials: Potentials) -> None:
    """Raise SolverError unless there is a label for each node and, if any, a belief for each."""
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
    """Raise SolverError where a bound is below the score, or leaves a gap that EXACT denies."""
    if bound >= total and status is not Status.EXACT:
        return
    known = task.potentials
    terms = (known.unary, known.pairwise, known.agreement)
    sizes = [np.abs(term[np.isfinite(term)]).max(initial=0.0) for term in terms if term is not None]
    slack = FALSE * (abs(total) + max(sizes) + task.model.size)
    if bound < total - slack:
        raise SolverError(
            f"decoder {name!r} says that no labelling scores more than {bound:.12g}, but its own "
            f"scores {total:.12g}: its bound is wrong"
        )
    if status is Status.EXACT and bound > total + FALSE * _magnitude(task, total):
        raise SolverError(
            f"decoder {name!r} calls its labelling exact, which scores {total:.12g}, but says that "
            f"another may score up to {bound:.12g}"
        )


def _repaired(task: DecodingTask, answer: DecodingAnswer) -> DecodingAnswer:
    """The answer with labels that break no rule, where the search finds such."""
    from pgm_places.solvers.local_search import allowed_labels

    labels = allowed_labels(task.model, answer.labels)
    if labels is None:
        return replace(answer, status=Status.INFEASIBLE)
    return replace(answer, labels=labels, status=Status.REPAIRED)


def _certificate(
    task: DecodingTask, labels: NDArray[np.int64], total: float
) -> tuple[float, dict[str, Any]]:
    """An upper bound of every score, and what finding it took."""
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
    """EXACT where nothing but rounding lies between score and bound, else the method's word."""
    if bound is None or total == -np.inf or status is Status.EXACT:
        return status
    gap = bound - total
    if gap > 0 and gap > ROUNDING * _magnitude(task, total):
        return status
    return Status.EXACT


def _magnitude(task: DecodingTask, total: float) -> float:
    """What roundings of a gap are multiples of."""
    return abs(total) + min(task.model.size, max(task.model.top - total, 0.0))
