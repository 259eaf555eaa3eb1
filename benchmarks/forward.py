"""Hidden Markov filter, smoother and Viterbi, 6 labels.

A random chain and random log-likelihoods, the same for all methods. ``hmmlearn`` runs its compiled
forward pass (scaled, from likelihoods that are already exponentials, or with their exponentials, as
ours; and in logarithms), forward-backward and Viterbi on the same chain; ``NumPy loop`` is the
filter in two lines per step. Processor seconds on one thread; ``difference`` is the largest
difference of any belief from ours.
"""

import statistics
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.solvers.forward import filtered_beliefs, markov_chain, smoothed_beliefs, viterbi

N_LABELS = 6
Array = NDArray[np.float64]
Method = tuple[str, str, int, Callable[[], Array | None]]


def numpy_filter(initial: Array, transition: Array, observed: Array) -> Array:
    """The filter step by step."""
    beliefs = np.empty_like(observed)
    likelihood = np.exp(observed)
    predicted = initial
    for t in range(len(observed)):
        belief = predicted * likelihood[t]
        beliefs[t] = belief / belief.sum()
        predicted = beliefs[t] @ transition
    return beliefs


def peers(initial: Array, transition: Array, observed: Array) -> Iterator[Method]:
    """The compiled passes of hmmlearn, where it is installed."""
    try:
        from hmmlearn import _hmmc
    except ImportError:
        return
    n_steps = len(observed)
    likelihood = np.exp(observed)

    def scaled_filter() -> Array:
        return np.asarray(_hmmc.forward_scaling(initial, transition, likelihood)[1])

    def filter_from_logs() -> Array:
        return np.asarray(_hmmc.forward_scaling(initial, transition, np.exp(observed))[1])

    def log_filter() -> Array:
        table = np.asarray(_hmmc.forward_log(initial, transition, observed)[1])
        weights = np.exp(table - table.max(axis=1, keepdims=True))
        return weights / weights.sum(axis=1, keepdims=True)

    def both(likelihood: Array = likelihood) -> Array:
        _, forward, scale = _hmmc.forward_scaling(initial, transition, likelihood)
        backward = _hmmc.backward_scaling(initial, transition, likelihood, scale)
        product = np.asarray(forward) * np.asarray(backward)
        return product / product.sum(axis=1, keepdims=True)

    def viterbi() -> None:
        _hmmc.viterbi(initial, transition, observed)

    yield "filter", "hmmlearn, scaled", n_steps, scaled_filter
    yield "filter", "hmmlearn, scaled, from logarithms", n_steps, filter_from_logs
    yield "filter", "hmmlearn, logarithms", n_steps, log_filter
    yield "smoother", "hmmlearn, scaled", n_steps, both
    yield "smoother", "hmmlearn, scaled, from logarithms", n_steps, lambda: both(np.exp(observed))
    yield "Viterbi", "hmmlearn", n_steps, viterbi


def run(quick: bool) -> list[dict[str, Any]]:
    """The rows of the table."""
    n_steps = 100_000 if quick else 1_000_000
    rng = np.random.default_rng(0)
    initial = np.full(N_LABELS, 1 / N_LABELS)
    transition = rng.dirichlet(np.ones(N_LABELS), N_LABELS)
    observed = np.log(rng.dirichlet(np.ones(N_LABELS), n_steps))
    arguments = (initial, transition, observed)
    few = n_steps // 20

    def path() -> None:
        viterbi(markov_chain(*arguments))

    methods: list[Method] = [
        ("filter", "ours", n_steps, lambda: filtered_beliefs(markov_chain(*arguments)).beliefs),
        ("filter", "NumPy loop", few, lambda: numpy_filter(initial, transition, observed[:few])),
        ("smoother", "ours", n_steps, lambda: smoothed_beliefs(markov_chain(*arguments)).beliefs),
        ("Viterbi", "ours", n_steps, path),
        *peers(*arguments),
    ]
    rows = []
    ours: dict[str, Array | None] = {}
    for task, method, steps, work in sorted(methods, key=lambda item: item[0]):
        got = work()
        expected = ours.setdefault(task, got)
        taken = []
        for _ in range(3 if quick else 5):
            start = time.process_time()
            work()
            taken.append(time.process_time() - start)
        difference = None
        if got is not None and expected is not None:
            difference = float(np.abs(got - expected[: len(got)]).max())
        rows.append(
            {
                "task": task,
                "method": method,
                "steps": steps,
                "seconds": statistics.median(taken),
                "million steps a second": steps / statistics.median(taken) / 1e6,
                "difference": difference,
            }
        )
    return rows
