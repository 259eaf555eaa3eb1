"""Gibbs sampling on any graph, with what tells whether the chains have mixed."""

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import frozen
from pgm_places._core import gibbs_sweep
from pgm_places.errors import InputError, LearningWarning
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.potentials import Potentials, checked_potentials
from pgm_places.models.decoding_task import model_of
from pgm_places.solvers.local_search import allowed_labels
from pgm_places.solvers.pairwise import PairwiseModel, total_score

# Chains whose R-hat is above this have not seen the same distribution yet.
MIXED = 1.05


@dataclass(frozen=True, eq=False)
class GibbsSamples:
    """Labellings that follow each other in chains; those of one chain are alike.

    Parameters
    ----------
    labels : (C, S, N) int
        Of C chains, S labellings each.
    scores : (C, S) float
        Their log-potentials.
    r_hat : float
        How far the chains' scores, and their halves, lie apart: 1 where they agree.
    node_r_hat : (N,) float
        The same for each node: the largest over its labels.
    effective_size : float
        As many independent labellings tell the mean score as well.
    """

    labels: NDArray[np.int64]
    scores: NDArray[np.float64]
    r_hat: float
    node_r_hat: NDArray[np.float64]
    effective_size: float

    def frequencies(self, n_labels: int) -> NDArray[np.float64]:
        """(N, K) the share of the samples in which each node has each label."""
        shares = [(self.labels == k).mean(axis=(0, 1)) for k in range(n_labels)]
        return np.stack(shares, axis=1)


def gibbs_samples(
    graph: LabelGraph,
    potentials: Potentials,
    n_samples: int,
    *,
    n_chains: int = 4,
    n_burn_in: int = 100,
    thin: int = 1,
    known: ArrayLike | None = None,
    seed: int = 0,
) -> GibbsSamples:
    """Labellings that tend to ``p(y) ~ exp(score(y))``: nodes are drawn in turn, again and again.

    Where labels hold each other fast, as strong rewards of agreement or rules
    (-inf) do, chains may stay where they began: look at ``r_hat``, of which a warning tells, and
    prefer :func:`~pgm_places.models.sampling.sample` wherever that is exact. Rules may even part
    the labellings so that single changes never lead from one to another, which chains that begin
    at the same place cannot show.

    Parameters
    ----------
    graph, potentials
        The model.
    n_samples : int
        S, of each chain; at least 4.
    n_chains : int
        C, at least 2. Each begins at random labels, drawn node by node from the unaries.
    n_burn_in : int
        Sweeps over all nodes before the first sample.
    thin : int
        Sweeps from one sample to the next.
    known : (N,) int, optional
        Label of the nodes whose label is known, -1 elsewhere.
    seed : int

    Raises
    ------
    InputError
        Potentials that do not fit the graph, or numbers that are too small; or no allowed labelling
        was found to begin with.

    Notes
    -----
    S. Geman, D. Geman (PAMI 1984); A. Gelman, D. B. Rubin, "Inference from iterative simulation
    using multiple sequences" (Statistical Science 1992), with chains split in halves.

    Examples
    --------
    >>> ring = LabelGraph.from_edges(3, [(0, 1), (1, 2), (0, 2)])
    >>> drawn = gibbs_samples(ring, Potentials.potts(np.log([[0.9, 0.1]] * 3), 0.5), 500)
    >>> drawn.labels.shape, drawn.r_hat < 1.02, drawn.frequencies(2)[0].round(1).tolist()
    ((4, 500, 3), True, [0.9, 0.1])
    """
    potentials = checked_potentials(graph, potentials, known)
    least = {"n_samples": 4, "n_chains": 2, "n_burn_in": 0, "thin": 1}
    given = {"n_samples": n_samples, "n_chains": n_chains, "n_burn_in": n_burn_in, "thin": thin}
    for name, value in given.items():
        if value < least[name]:
            raise InputError(f"{name} must be at least {least[name]}, got {value}")
    model = model_of(graph, potentials)
    labels = np.empty((n_chains, n_samples, graph.n_nodes), np.int64)
    scores = np.empty((n_chains, n_samples))
    for chain, stream in enumerate(np.random.SeedSequence(seed).spawn(n_chains)):
        rng = np.random.default_rng(stream)
        now = _beginning(model, rng)
        for sweep in range(n_burn_in + n_samples * thin):
            gibbs_sweep(model.terms, model.around.arcs, rng.random(graph.n_nodes), now)
            at, rest = divmod(sweep - n_burn_in + 1, thin)
            if at > 0 and rest == 0:
                labels[chain, at - 1], scores[chain, at - 1] = now, total_score(model, now)
    return _diagnosed(labels, scores, potentials.n_labels)


def r_hat(values: NDArray[np.float64]) -> float:
    """How far chains (C, S) and their halves lie apart: 1 where they agree, inf where none moves.

    The root of the variance that all draws together have over that within a chain (Gelman and
    Rubin 1992).

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> bool(r_hat(rng.normal(size=(4, 1000))) < 1.01)
    True
    >>> bool(r_hat(rng.normal(size=(4, 1000)) + [[0], [0], [0], [3]]) > 1.5)
    True
    """
    half = values.shape[1] // 2
    parts = np.concatenate([values[:, :half], values[:, half : 2 * half]])
    within = parts.var(axis=1, ddof=1).mean()
    between = parts.mean(axis=1).var(ddof=1)
    if within == 0:
        return 1.0 if between == 0 else np.inf
    return float(np.sqrt((half - 1) / half + between / within))


def _beginning(model: PairwiseModel, rng: np.random.Generator) -> NDArray[np.int32]:
    """Labels drawn from the unaries alone; put right where they break a rule."""
    labels = (model.unary + rng.gumbel(size=model.unary.shape)).argmax(axis=1).astype(np.int32)
    if total_score(model, labels) > -np.inf:
        return labels
    allowed = allowed_labels(model, labels)
    if allowed is None:
        raise InputError("no allowed labelling was found to begin with; relax the rules (-inf)")
    return allowed.astype(np.int32)


def _diagnosed(
    labels: NDArray[np.int64], scores: NDArray[np.float64], n_labels: int
) -> GibbsSamples:
    apart = r_hat(scores)
    at_nodes = np.ones(labels.shape[2])
    for k in range(n_labels):
        has = (labels == k).astype(np.float64)
        at_nodes = np.maximum(at_nodes, [r_hat(has[:, :, i]) for i in range(labels.shape[2])])
    if max(apart, at_nodes.max(initial=1.0)) > MIXED:
        warnings.warn(
            f"the chains have not mixed (R-hat {max(apart, at_nodes.max(initial=1.0)):.2f}, which "
            f"should be at most {MIXED}): their frequencies are not the model's probabilities. "
            "Draw more samples, or thin more",
            LearningWarning,
            stacklevel=3,
        )
    return GibbsSamples(frozen(labels), frozen(scores), apart, frozen(at_nodes), _size(scores))


def _size(scores: NDArray[np.float64]) -> float:
    """The number of draws over how long they remember: Geyer's initial positive sequence."""
    n = scores.shape[1]
    centred = scores - scores.mean(axis=1, keepdims=True)
    variance = float((centred**2).mean())
    if variance == 0:
        return float(scores.size)
    total = 1.0
    for lag in range(1, n - 1, 2):
        pair = sum(
            float((centred[:, : n - step] * centred[:, step:]).sum()) / scores.size / variance
            for step in (lag, lag + 1)
        )
        if pair <= 0:
            break
        total += 2 * pair
    return scores.size / total
