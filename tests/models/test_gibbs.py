"""Gibbs sampling against the probabilities that enumeration gives, and its diagnostics."""

import numpy as np
import pytest

from pgm_places import LabelGraph, Potentials
from pgm_places.errors import InputError, LearningWarning
from pgm_places.models.gibbs import gibbs_samples, r_hat
from tests.reference.energy import Model, distribution

RING = LabelGraph.from_edges(4, [(0, 1), (1, 2), (2, 3), (0, 3), (0, 2)])


@pytest.mark.parametrize("kind", ["tables", "agreement", "shared"])
def test_frequencies_tend_to_the_marginals_on_cycles(kind: str) -> None:
    rng = np.random.default_rng(3)
    unary = rng.normal(size=(4, 3))
    unary[1, 2] = -np.inf
    tables, reward = rng.normal(size=(5, 3, 3)), rng.normal(size=(5, 3))
    potentials = {
        "tables": Potentials(unary, pairwise=tables),
        "agreement": Potentials(unary, agreement=reward),
        "shared": Potentials(unary, pairwise=tables[0]),
    }[kind]
    model = Model(unary, RING.edges.astype(np.int64), potentials.agreement, potentials.pairwise)
    drawn = gibbs_samples(RING, potentials, 4000, thin=2)
    assert drawn.labels.shape == (4, 4000, 4)
    assert max(drawn.r_hat, drawn.node_r_hat.max()) < 1.02
    expected = distribution(model)[0]
    assert np.abs(drawn.frequencies(3) - expected).max() < 0.025
    assert not drawn.frequencies(3)[1, 2]
    assert 500 < drawn.effective_size <= 1.5 * 16_000


def test_rules_and_known_labels_are_never_broken() -> None:
    rises = np.where(np.tri(3, k=-1, dtype=bool), -np.inf, 0.0)
    chain = LabelGraph.from_lattice((5,))
    drawn = gibbs_samples(
        chain, Potentials(np.zeros((5, 3)), rises), 400, known=[-1, 1, -1, -1, -1], thin=3
    )
    assert (drawn.labels[:, :, 1] == 1).all()
    assert (np.diff(drawn.labels, axis=2) >= 0).all()
    assert len(np.unique(drawn.labels[:, :, 4])) == 2


def test_chains_that_stay_where_they_began_are_told() -> None:
    """Two labellings, all 0 and all 1, and nothing between them."""
    grid = LabelGraph.from_lattice((5, 5))
    with pytest.warns(LearningWarning, match="the chains have not mixed"):
        drawn = gibbs_samples(grid, Potentials.potts(np.zeros((25, 2)), 20.0), 50, seed=1)
    assert drawn.node_r_hat.max() > 1.05


def test_the_same_seed_draws_the_same() -> None:
    potentials = Potentials.potts(np.random.default_rng(0).normal(size=(4, 2)), 0.3)
    first, again = (gibbs_samples(RING, potentials, 200, seed=5).labels for _ in range(2))
    np.testing.assert_array_equal(first, again)
    assert (first != gibbs_samples(RING, potentials, 200, seed=6).labels).any()
    assert (first[0] != first[1]).any()


def test_scores_are_those_of_the_labels() -> None:
    from pgm_places import score

    potentials = Potentials(np.random.default_rng(0).normal(size=(4, 2)), pairwise=np.eye(2) - 1)
    drawn = gibbs_samples(RING, potentials, 500)
    for chain, at in ((0, 0), (3, 99), (1, 50)):
        expected = score(RING, potentials, drawn.labels[chain, at])
        assert drawn.scores[chain, at] == pytest.approx(expected, rel=1e-12)


def test_r_hat_knows_what_does_not_move() -> None:
    assert r_hat(np.ones((3, 10))) == 1.0
    assert r_hat(np.repeat([[0.0], [1.0]], 10, axis=1)) == np.inf


def test_wrong_input_is_refused() -> None:
    potentials = Potentials(np.zeros((4, 2)))
    with pytest.raises(InputError, match="n_samples must be at least 4, got 3"):
        gibbs_samples(RING, potentials, 3)
    with pytest.raises(InputError, match="n_chains must be at least 2, got 1"):
        gibbs_samples(RING, potentials, 10, n_chains=1)
    with pytest.raises(InputError, match="unary has 4 rows but the graph has 3 nodes"):
        gibbs_samples(LabelGraph.from_lattice((3,)), potentials, 10)
