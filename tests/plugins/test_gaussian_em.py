"""EM with Gaussians: its likelihood by enumeration, its rounds, and what it finds."""

from itertools import product
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pgm_places_plugins.gaussian_em import PRIOR_SHARE, GaussianEM, gaussian_em
from scipy.stats import multivariate_normal
from sklearn.mixture import GaussianMixture

from pgm_places import LabelGraph, decode
from pgm_places.errors import InputError
from tests.refusals import refused

Array = NDArray[Any]

CHAIN = LabelGraph.from_lattice((6,))
RING = LabelGraph.from_edges(6, [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (0, 5)])


def likelihood_by_hand(
    found: GaussianEM, graph: LabelGraph, x: Array, known: Array
) -> tuple[float, Array]:
    """The log of the sum over all labellings, and the share of each label at each node."""
    k = len(found.means)
    total, shares = 0.0, np.zeros((len(x), k))
    density = [
        multivariate_normal(mean, covariance).logpdf(x)
        for mean, covariance in zip(found.means, found.covariances, strict=True)
    ]
    for labels in product(range(k), repeat=len(x)):
        if any(label != given for label, given in zip(labels, known, strict=True) if given >= 0):
            continue
        value = sum(float(density[label][i]) for i, label in enumerate(labels))
        if found.transition is not None and found.initial is not None:
            value += float(np.log(found.initial[labels[0]]))
            value += sum(
                float(np.log(found.transition[labels[i], labels[j]])) for i, j in graph.edges
            )
        else:
            value += found.weight * sum(labels[i] == labels[j] for i, j in graph.edges)
        total += np.exp(value)
        for i, label in enumerate(labels):
            shares[i, label] += np.exp(value)
    return float(np.log(total)), shares / total


def prior_by_hand(found: GaussianEM, x: Array) -> float:
    spread = np.diag(PRIOR_SHARE * x.var(axis=0))
    value = 0.0
    for covariance in found.covariances:
        value -= 0.5 * np.log(np.linalg.det(covariance))
        value -= 0.5 * np.trace(np.linalg.inv(covariance) @ spread)
    if found.transition is not None and found.initial is not None:
        value += np.log(found.transition).sum() + np.log(found.initial).sum()
    return float(value)


@pytest.mark.parametrize("graph", [CHAIN, RING])
@pytest.mark.parametrize("known", [[-1] * 6, [-1, 1, -1, -1, 0, -1]])
def test_the_objective_and_the_beliefs_are_those_of_all_labellings(
    graph: LabelGraph, known: list[int]
) -> None:
    x = np.random.default_rng(2).normal(size=(6, 2))
    found = gaussian_em([graph], [x], 2, labelings=[known], weight=0.7)
    evidence, shares = likelihood_by_hand(found, graph, x, np.array(known))
    assert found.exact
    expected = evidence + prior_by_hand(found, x)
    assert found.objectives[-1] == pytest.approx(expected, rel=0, abs=1e-9)
    np.testing.assert_allclose(found.beliefs[0], shares, rtol=0, atol=1e-9)


@pytest.mark.parametrize("covariance", ["full", "diagonal", "diag", "spherical", "tied"])
@pytest.mark.parametrize("graph", [CHAIN, RING])
@pytest.mark.parametrize("seed", range(4))
def test_no_round_lowers_the_objective(graph: LabelGraph, covariance: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    x = [rng.normal(size=(6, 2)) * 10.0**seed for _ in range(3)]
    found = gaussian_em([graph] * 3, x, 3, covariance=covariance)  # type: ignore[arg-type]
    assert (np.diff(found.objectives) >= -1e-9 * np.abs(found.objectives[0])).all()
    if covariance in ("diagonal", "diag", "spherical"):
        assert not found.covariances[:, ~np.eye(2, dtype=bool)].any()


@pytest.mark.parametrize("covariance", ["full", "diag", "spherical", "tied"])
def test_covariances_are_those_of_scikit_learn_and_their_prior(covariance: str) -> None:
    rng = np.random.default_rng(0)
    truth = np.repeat([0, 1, 2], 20)
    x = 50.0 * truth[:, None] + rng.normal(size=(60, 2)) @ [[2.0, 1.0], [0.0, 0.5]]
    lone = LabelGraph.from_edges(60, [])
    found = gaussian_em([lone], [x], 3, covariance=covariance)  # type: ignore[arg-type]
    mixture = GaussianMixture(3, covariance_type=covariance, reg_covar=0.0, random_state=0).fit(x)
    theirs = mixture.covariances_[... if covariance == "tied" else np.argsort(mixture.means_[:, 0])]
    if covariance in ("diag", "spherical"):
        theirs = np.array([np.diag(np.broadcast_to(variances, 2)) for variances in theirs])
    prior = PRIOR_SHARE * x.var(axis=0)
    prior = np.diag([prior.mean()] * 2 if covariance == "spherical" else prior)
    expected = np.broadcast_to((20 * theirs + prior) / 21, (3, 2, 2))
    np.testing.assert_allclose(found.covariances, expected, rtol=1e-9)


def series(seed: int, n: int = 400) -> tuple[Array, Array]:
    """Two labels of one mean: only their spread, and how long they last, tell them apart."""
    rng = np.random.default_rng(seed)
    truth = np.cumsum(rng.random(n) < 0.03) % 2
    return truth, rng.normal(size=(n, 1)) * np.where(truth, 3.0, 0.5)[:, None]


def test_a_series_is_parted_by_its_spread_from_whichever_start_is_better() -> None:
    truth, x = series(9, 200)
    chain = LabelGraph.from_lattice((200,))
    found = gaussian_em([chain], [x], 2)
    assert found.converged
    assert found.objectives[-1] > -370  # -438.7 from the clusters of the values alone
    calm = int(np.argmin(found.covariances[:, 0, 0]))
    assert ((found.beliefs[0].argmax(axis=1) != calm) == truth).mean() > 0.9
    labels = decode(chain, found.potentials(chain, x), "exact").labels
    assert ((labels != calm) == truth).mean() > 0.9
    assert found.transition is not None
    assert np.diag(found.transition).min() > 0.85


def test_few_known_labels_name_the_clusters() -> None:
    rng = np.random.default_rng(1)
    truth = np.repeat([0, 1, 2, 1, 0], 40)
    x = np.array([2.0, -3.0, 0.0])[truth, None] + 0.6 * rng.normal(size=(200, 1))
    known = np.full(200, -1)
    known[[5, 50, 90]] = truth[[5, 50, 90]]
    found = gaussian_em([LabelGraph.from_lattice((200,))], [x], 3, labelings=[known])
    np.testing.assert_allclose(found.means[:, 0], [2.0, -3.0, 0.0], rtol=0, atol=0.2)
    assert (found.beliefs[0].argmax(axis=1) == truth).mean() > 0.98
    unnamed = gaussian_em([LabelGraph.from_lattice((200,))], [x], 3)
    assert (np.diff(unnamed.means[:, 0]) > 0).all()


def test_a_picture_is_parted_by_mean_field() -> None:
    rng = np.random.default_rng(4)
    truth = np.zeros((30, 30), int)
    truth[8:22, 10:25] = 1
    x = truth.reshape(-1, 1) + rng.normal(scale=0.7, size=(900, 1))
    grid = LabelGraph.from_lattice((30, 30))
    found = gaussian_em([grid], [x], 2, weight=1.0)
    assert not found.exact
    assert found.transition is None
    right = (found.beliefs[0].argmax(axis=1) == truth.ravel()).mean()
    alone = ((x[:, 0] > 0.5) == truth.ravel()).mean()
    assert right > 0.95 > alone + 0.1
    labels = decode(grid, found.potentials(grid, x), "graph-cut").labels
    assert (labels == truth.ravel()).mean() > 0.95


def test_scales_of_features_do_not_matter() -> None:
    _, x = series(3, 120)
    chain = LabelGraph.from_lattice((120,))
    plain = gaussian_em([chain], [x], 2)
    for scale in (1e-12, 1e12):
        other = gaussian_em([chain], [x * scale], 2)
        np.testing.assert_allclose(other.means, plain.means * scale, rtol=1e-6)
        np.testing.assert_allclose(other.beliefs[0], plain.beliefs[0], rtol=0, atol=1e-6)


def test_labels_that_no_node_begins_with_end_well() -> None:
    x = np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])[:, None]
    found = gaussian_em([CHAIN], [x], 3)
    assert np.isfinite(found.means).all()
    assert np.isfinite(found.objectives).all()


def test_wrong_input_is_refused() -> None:
    x, rising, call = np.zeros((6, 1)), np.arange(6.0)[:, None], gaussian_em
    unlike: dict[str, Any] = {"covariance": "sphere"}
    for message, features, k, options in (
        ("got 1 graphs, 2 features and 1 labelings", [x, x], 2, {}),
        (r"features\[0\] must be finite numbers of shape", [x[:5]], 2, {}),
        ("n_labels must be from 1 to the number of nodes, got 7", [x], 7, {}),
        ("feature 0 is the same at all nodes; leave it out", [x], 2, {}),
        (r"labelings\[0\] must hold 6 labels from -1 to 1", [x], 2, {"labelings": [[2] * 6]}),
        (r"covariance must be one of .* got 'sphere'", [rising], 2, unlike),
    ):
        refused(InputError, message, call, [CHAIN], features, k, **options)
    learned = gaussian_em([CHAIN], [rising], 2)
    refused(InputError, "the transitions of chains were learned", learned.potentials, RING, x)
