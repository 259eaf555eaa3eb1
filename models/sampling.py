"""Random labellings from a model: exact on forests, perturb-and-MAP elsewhere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import frozen_copy, require_at_least
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.potentials import Potentials, checked_potentials
from pgm_places.models.decoders import Decoder, model_of
from pgm_places.models.decoding import decode
from pgm_places.solvers.adjacency import is_forest
from pgm_places.solvers.bucket_tree import BucketTree
from pgm_places.solvers.forest import forest_samples


@dataclass(frozen=True, eq=False)
class Samples:
    """Sampled labellings."""

    labels: NDArray[np.int64]
    """(S, N) one labelling a row."""
    exact: bool
    """Whether they follow the distribution exactly."""

    def frequencies(self, n_labels: int) -> NDArray[np.float64]:
        """(N, K) the share of the samples in which each node has each label."""
        shares = [(self.labels == k).mean(axis=0) for k in range(n_labels)]
        return np.stack(shares, axis=1)


def sample(
    graph: LabelGraph,
    potentials: Potentials,
    n_samples: int,
    *,
    seed: int = 0,
    known: ArrayLike | None = None,
    decoder: Decoder = "trw-s",
) -> Samples:
    """Labellings drawn from ``p(y) ~ exp(score(y))``.

    They are exact on graphs of small treewidth, as for the decoder ``exact``: forward filtering,
    backward sampling. Elsewhere Gumbel noise is added to every unary and the noisy problem is
    decoded (perturb and MAP: G. Papandreou, A. Yuille, "Perturb-and-MAP random fields", ICCV 2011).
    This approximation gives plausible alternatives, not calibrated probabilities.

    Parameters
    ----------
    graph, potentials
        The model.
    n_samples : int
        S, at least 1.
    seed : int
    known : (N,) int, optional
        Label of the nodes whose label is known, -1 elsewhere.
    decoder : str
        Decoder of the noisy problems.

    Raises
    ------
    InputError
        Potentials that do not fit the graph, or fewer than one sample.

    Examples
    --------
    >>> graph = LabelGraph.from_edges(2, [(0, 1)])
    >>> drawn = sample(graph, Potentials.potts(np.log([[0.9, 0.1], [0.5, 0.5]]), 1.0), 1000)
    >>> drawn.exact, drawn.frequencies(2).round(1).tolist()
    (True, [[0.9, 0.1], [0.7, 0.3]])
    """
    potentials = checked_potentials(graph, potentials, known)
    require_at_least("n_samples", n_samples, 1)
    model = model_of(graph, potentials)
    if is_forest(model.around):
        labels = forest_samples(model, n_samples=n_samples, seed=seed)
        return Samples(frozen_copy(labels), exact=True)
    rng = np.random.default_rng(seed)
    tree = BucketTree.of(model)
    if tree is not None:
        return Samples(frozen_copy(tree.samples(potentials.unary, n_samples, rng)), exact=True)
    rows = []
    for _ in range(n_samples):
        noisy = potentials.unary + rng.gumbel(size=potentials.unary.shape)
        perturbed = Potentials(noisy, potentials.pairwise, potentials.agreement)
        rows.append(decode(graph, perturbed, decoder).labels)
    return Samples(frozen_copy(np.stack(rows)), exact=False)
