"""Expectation maximisation of Gaussians, from few known labels or none.

Each label has a Gaussian of the features; neighbours are linked by transitions, which are learned,
where the graphs are chains, and else by one weight of agreement, which is given. Beliefs under both
and the parameters that fit them best are found in turn.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.errors import InputError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.potentials import Potentials
from pgm_places.models.chain_statistics import normalised
from pgm_places.models.decoders import model_of
from pgm_places.solvers.adjacency import is_forest
from pgm_places.solvers.bucket_tree import BucketTree
from pgm_places.solvers.forest import forest_marginals
from pgm_places.solvers.mean_field import mean_field

Array = NDArray[np.float64]

COVARIANCES = ("full", "diagonal", "diag", "spherical", "tied")

# Learning ends when a round raises the objective by less than this a node.
AT_REST = 1e-6

# How often features are averaged over neighbours for the second start.
AROUND = 8

# Of the variance of all nodes: what covariances are drawn towards, as if one more node said so.
PRIOR_SHARE = 0.1


@dataclass(frozen=True, eq=False)
class GaussianEM:
    """What was learned.

    Parameters
    ----------
    means : (K, D) float
        Of each label; where none is known, labels are numbered by the first feature of the clusters
        that learning began at.
    covariances : (K, D, D) float
    transition : (K, K) float or None
        Probability of each label (column) after each (row), where all graphs are chains.
    initial : (K,) float or None
        Probability of each label at the first node of a chain.
    weight : float
        What neighbours earn by agreeing, where there are no transitions.
    beliefs : tuple of (N, K) float
        For each graph the probability of each label at each node.
    objectives : (R + 1,) float
        Before each round and at the end: the log-likelihood of the features and known labels plus
        the logarithm of the prior. No round lowers it where ``exact``.
    converged : bool
        Whether learning came to rest before its limit.
    exact : bool
        Whether beliefs were those of the model: without cycles, and where few nodes separate the
        graphs. Elsewhere they are mean field's, and the objective is a lower bound, but for a
        constant.
    """

    means: Array
    covariances: Array
    transition: Array | None
    initial: Array | None
    weight: float
    beliefs: tuple[Array, ...]
    objectives: Array
    converged: bool
    exact: bool

    def log_density(self, features: ArrayLike) -> Array:
        """(N, K) the logarithm of each label's Gaussian at each row of features (N, D)."""
        x = _finite("features", features, (None, self.means.shape[1]))
        return _log_density(x, self.means, self.covariances)

    def potentials(self, graph: LabelGraph, features: ArrayLike) -> Potentials:
        """The log-potentials of a graph with features (N, D), for any decoder."""
        unary = self.log_density(features)
        if self.transition is None or self.initial is None:
            return Potentials.potts(unary, self.weight)
        if not graph.is_chain:
            raise InputError("the transitions of chains were learned, and this graph is none")
        return _chained(unary, self.transition, self.initial)


def gaussian_em(
    graphs: Sequence[LabelGraph],
    features: Sequence[ArrayLike],
    n_labels: int,
    *,
    labelings: Sequence[ArrayLike] | None = None,
    weight: float = 1.0,
    covariance: Literal["full", "diagonal", "diag", "spherical", "tied"] = "full",
    max_rounds: int = 200,
    seed: int = 0,
) -> GaussianEM:
    """Gaussians, and on chains transitions, of labels that are hidden wholly or in part.

    The objective has many optima. Learning begins at clusters (k-means) of all nodes by their
    features, and once more by the mean and spread of the features around them; the better optimum
    of the two is taken. Clusters nearest to known labels take these.

    Parameters
    ----------
    graphs : sequence of LabelGraph
    features : sequence of (N, D) float
        Of each graph's nodes.
    n_labels : int
        K.
    labelings : sequence of (N,) int, optional
        The labels that are known, -1 elsewhere: certain evidence, also for their neighbours.
    weight : float
        What neighbours earn by agreeing, on graphs that are not chains.
    covariance : {"full", "diagonal", "spherical", "tied"}
        As in hmmlearn and scikit-learn: any; without correlations (also ``"diag"``); one variance
        for all features, which then need one unit; or one covariance for all labels.
    max_rounds : int
    seed : int
        Of the clusters.

    Raises
    ------
    InputError
        Arguments that do not fit each other, fewer nodes than labels, or a feature that is the
        same everywhere.

    Notes
    -----
    L. Baum et al., Annals of Mathematical Statistics 41 (1970); Y. Zhang, M. Brady, S. Smith,
    "Segmentation of brain MR images through a hidden Markov random field model" (IEEE Trans.
    Medical Imaging 2001). Every transition is counted once more than it is expected, and the
    covariance of each label has one more node's worth of a tenth of the variance of all nodes.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> truth = np.repeat([0, 1, 0, 1], 50)
    >>> series = truth[:, None] * 3.0 + rng.normal(size=(200, 1))
    >>> found = gaussian_em([LabelGraph.from_lattice((200,))], [series], 2)
    >>> found.means.round(1).tolist(), float((found.beliefs[0].argmax(axis=1) == truth).mean())
    ([[0.0], [2.9]], 0.985)
    """
    task = _checked(graphs, features, labelings, n_labels)
    if covariance not in COVARIANCES:
        raise InputError(f"covariance must be one of {COVARIANCES}, got {covariance!r}")
    looks = np.concatenate(task.features), _around(task)
    starts = [_first_beliefs(task, values, n_labels, seed) for values in looks]
    candidates = [_learned(task, start, weight, covariance, max_rounds) for start in starts]
    return max(candidates, key=lambda one: one.objectives[-1])


def _learned(
    task: "_Task", beliefs: Array, weight: float, covariance: str, max_rounds: int
) -> GaussianEM:
    """Where the rounds lead from given beliefs (M, K) of all nodes."""
    chains = all(graph.is_chain for graph in task.graphs)
    flat, n_labels = np.concatenate(task.features), beliefs.shape[1]
    spread = PRIOR_SHARE * flat.var(axis=0)
    parts = np.cumsum([len(rows) for rows in task.features])[:-1]
    objectives: list[float] = []
    pairs, exact, converged = np.zeros((n_labels, n_labels)), True, False
    means = np.tile(flat.mean(axis=0), (n_labels, 1))  # of labels that no node begins with
    gaussians = means, np.empty((n_labels, *flat.shape[1:] * 2))
    links = np.full((n_labels, n_labels), 1 / n_labels), np.full(n_labels, 1 / n_labels)
    for number in range(max_rounds + 1):
        gaussians = _fitted(flat, beliefs, spread, covariance, gaussians[0])
        if chains and number:
            starts = sum(part[0] for part in np.split(beliefs, parts) if len(part))
            links = normalised(pairs + 1.0), normalised(np.asarray(starts) + 1.0)
        expected = _expected(task, gaussians, links if chains else None, weight)
        beliefs, pairs, exact = np.concatenate(expected.beliefs), expected.pairs, expected.exact
        prior = _log_prior(gaussians[1], spread, links if chains else None)
        objectives.append(expected.log_evidence + prior)
        if number and objectives[-1] - objectives[-2] <= AT_REST * len(flat):
            converged = True
            break
    return GaussianEM(
        gaussians[0],
        gaussians[1],
        links[0] if chains else None,
        links[1] if chains else None,
        weight,
        tuple(part.copy() for part in np.split(beliefs, parts)),
        np.array(objectives),
        converged,
        exact,
    )


class _Task(NamedTuple):
    graphs: Sequence[LabelGraph]
    features: list[Array]
    known: list[NDArray[np.int64]]


class _Expected(NamedTuple):
    beliefs: list[Array]
    pairs: Array
    """(K, K) how often labels are expected to follow each other, over all edges."""
    log_evidence: float
    exact: bool


def _checked(
    graphs: Sequence[LabelGraph],
    features: Sequence[ArrayLike],
    labelings: Sequence[ArrayLike] | None,
    n_labels: int,
) -> _Task:
    given = [np.full(graph.n_nodes, -1) for graph in graphs] if labelings is None else labelings
    if not len(graphs) == len(features) == len(given):
        raise InputError(
            f"got {len(graphs)} graphs, {len(features)} features and {len(given)} labelings; give "
            "one of each"
        )
    rows: list[Array] = []
    for m, (graph, part) in enumerate(zip(graphs, features, strict=True)):
        width = rows[0].shape[1] if rows else None
        rows.append(_finite(f"features[{m}]", part, (graph.n_nodes, width)))
    known = [np.asarray(part, np.int64) for part in given]
    for m, (graph, part) in enumerate(zip(graphs, known, strict=True)):
        if part.shape != (graph.n_nodes,) or not ((part >= -1) & (part < n_labels)).all():
            raise InputError(
                f"labelings[{m}] must hold {graph.n_nodes} labels from -1 to {n_labels - 1}"
            )
    if n_labels < 1 or sum(map(len, rows)) < n_labels:
        raise InputError(f"n_labels must be from 1 to the number of nodes, got {n_labels}")
    same = np.flatnonzero(np.ptp(np.concatenate(rows), axis=0) == 0)
    if len(same):
        raise InputError(f"feature {same[0]} is the same at all nodes; leave it out")
    return _Task(graphs, rows, known)


def _finite(name: str, values: ArrayLike, shape: tuple[int | None, int | None]) -> Array:
    """The rows as numbers; None stands for any length."""
    x = np.asarray(values, np.float64)
    fits = x.ndim == 2 and all(n in (None, m) for n, m in zip(shape, x.shape, strict=True))
    if not fits or not np.isfinite(x).all():
        raise InputError(f"{name} must be finite numbers of shape {shape}, got {x.shape}")
    return x


def _around(task: _Task) -> Array:
    """(M, 2 D) features and squared deviations, averaged again and again over neighbours."""
    from scipy.sparse import coo_array, eye_array

    middle = np.concatenate(task.features).mean(axis=0)
    averages = []
    for graph, x in zip(task.graphs, task.features, strict=True):
        ones = np.ones(graph.n_edges)
        there = coo_array((ones, tuple(graph.edges.T)), shape=(graph.n_nodes, graph.n_nodes))
        links = (there + there.T + eye_array(graph.n_nodes)).tocsr()
        values = np.concatenate([x, (x - middle) ** 2], axis=1)
        for _ in range(AROUND):
            values = (links @ values) / (graph.degree + 1)[:, np.newaxis]
        averages.append(values)
    return np.concatenate(averages)


def _first_beliefs(task: _Task, values: Array, n_labels: int, seed: int) -> Array:
    """(M, K) each node surely in its cluster by values (M, C), or in the label that is known.

    Clusters are numbered by the mean of their nodes' first feature.
    """
    from scipy.optimize import linear_sum_assignment
    from sklearn.cluster import KMeans

    flat, known = np.concatenate(task.features), np.concatenate(task.known)
    size = values.std(axis=0)
    scaled = (values - values.mean(axis=0)) / np.where(size > 0, size, 1.0)
    n_clusters = min(n_labels, len(np.unique(scaled, axis=0)))
    clusters = KMeans(n_clusters, n_init=10, random_state=seed).fit(scaled)
    firsts = [flat[clusters.labels_ == cluster, 0].mean() for cluster in range(n_clusters)]
    order = np.argsort(firsts, kind="stable")
    centres = clusters.cluster_centers_[order]
    cost = np.zeros((n_clusters, n_labels))
    for label in np.unique(known[known >= 0]):
        cost[:, label] = ((centres - scaled[known == label].mean(axis=0)) ** 2).sum(axis=1)
    cost += 1e-9 * np.abs(np.subtract.outer(np.arange(n_clusters), np.arange(n_labels)))
    label_of = np.empty(n_clusters, np.int64)
    taken, given = linear_sum_assignment(cost)
    label_of[order[taken]] = given
    labels = np.where(known >= 0, known, label_of[clusters.labels_])
    return np.eye(n_labels)[labels]


def _fitted(
    x: Array, beliefs: Array, spread: Array, covariance: str, before: Array
) -> tuple[Array, Array]:
    """The means (K, D) and covariances (K, D, D) that fit beliefs (M, K) best, with their prior."""
    counts = beliefs.sum(axis=0)
    means = before.copy()
    seen = counts > 0
    means[seen] = (beliefs.T @ x)[seen] / counts[seen, np.newaxis]
    moments = np.empty((len(counts), x.shape[1], x.shape[1]))
    for k, mean in enumerate(means):
        apart = x - mean
        moments[k] = (beliefs[:, k, np.newaxis] * apart).T @ apart + np.diag(spread)
    totals = counts + 1.0
    if covariance == "tied":
        moments[:], totals[:] = moments.sum(axis=0), totals.sum()
    covariances = moments / totals[:, np.newaxis, np.newaxis]
    if covariance in ("diagonal", "diag", "spherical"):
        variances = np.einsum("kdd->kd", covariances)
        if covariance == "spherical":
            variances = variances.mean(axis=1, keepdims=True)
        covariances = variances[:, np.newaxis] * np.eye(x.shape[1])
    return means, covariances


def _log_density(x: Array, means: Array, covariances: Array) -> Array:
    densities = np.empty((len(x), len(means)))
    for k, (mean, covariance) in enumerate(zip(means, covariances, strict=True)):
        factor = np.linalg.cholesky(covariance)
        apart = np.linalg.solve(factor, (x - mean).T)
        log_size = 2 * np.log(np.diag(factor)).sum() + len(mean) * np.log(2 * np.pi)
        densities[:, k] = -0.5 * ((apart**2).sum(axis=0) + log_size)
    return densities


def _log_prior(covariances: Array, spread: Array, links: tuple[Array, Array] | None) -> float:
    """The logarithm of the prior's density, but for constants."""
    inverse = np.linalg.inv(covariances)
    log_prior = -0.5 * float(np.linalg.slogdet(covariances)[1].sum())
    log_prior -= 0.5 * float(np.einsum("kdd,d->", inverse, spread))
    return log_prior + sum(float(np.log(table).sum()) for table in links or ())


def _chained(unary: Array, transition: Array, initial: Array) -> Potentials:
    scores = unary.copy()
    scores[:1] += np.log(initial)
    return Potentials(scores, pairwise=np.log(transition))


def _expected(
    task: _Task, gaussians: tuple[Array, Array], links: tuple[Array, Array] | None, weight: float
) -> _Expected:
    """Beliefs of all nodes, and the log-likelihood; weights of agreement add a constant to it."""
    all_beliefs, evidence, exact = [], 0.0, True
    pairs = np.zeros((len(gaussians[0]),) * 2)
    for graph, x, known in zip(*task, strict=True):
        unary = _log_density(x, *gaussians)
        plain = Potentials.potts(unary, weight) if links is None else _chained(unary, *links)
        potentials = plain.with_known(known)
        beliefs, joint, log_partition, is_exact = _beliefs(graph, potentials)
        all_beliefs.append(beliefs)
        pairs += 0.0 if joint is None else joint.sum(axis=0)
        evidence += log_partition
        exact = exact and is_exact
    return _Expected(all_beliefs, pairs, evidence, exact)


def _beliefs(graph: LabelGraph, potentials: Potentials) -> tuple[Array, Array | None, float, bool]:
    """Beliefs, on forests pair beliefs, log Z or a lower bound, and whether these are exact."""
    model = model_of(graph, potentials)
    if is_forest(model.around):
        marginals = forest_marginals(model, pairs=True)
        return marginals.beliefs, marginals.pair_beliefs, marginals.log_partition, True
    tree = BucketTree.of(model)
    if tree is not None:
        whole = tree.marginals(potentials.unary)
        return np.array(whole.beliefs), None, whole.log_partition, True
    guess = mean_field(model)
    q = np.asarray(guess.beliefs, np.float64)
    first, second = graph.edges.T
    expected = np.where(q > 0, q * np.where(q > 0, potentials.unary, 0.0), 0.0).sum()
    table = np.asarray(potentials.pairwise)
    expected += float(np.einsum("ek,kl,el->", q[first], table, q[second]))
    entropy = -float((q * np.log(np.where(q > 0, q, 1.0))).sum())
    return q, None, float(expected) + entropy, False
