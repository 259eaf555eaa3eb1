import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places.errors import InputError
from pgm_places.solvers.local_search import allowed_labels
from pgm_places.solvers.pairwise import pairwise_model
from tests.reference.energy import Model, best_score, score
from tests.refusals import refused
from tests.strategies import ruled_models

UNLIKE = np.where(np.eye(3, dtype=np.bool_), -np.inf, 0.0)
"""Neighbours must differ: a colouring with three colours."""


@given(ruled_models(), st.integers(0, 999))
def test_an_allowed_labelling_is_found_where_there_is_one(model: Model, seed: int) -> None:
    start = np.random.default_rng(seed).integers(0, model.unary.shape[1], len(model.unary))
    checked = pairwise_model(*model.arrays)
    if best_score(model) == -np.inf:
        refused(InputError, "pairwise forbids every labelling", allowed_labels, checked, start)
        return
    found = allowed_labels(checked, start)
    assert found is not None
    reached = score(model, tuple(found))
    assert reached > -np.inf
    for i in range(len(found)):
        for k in range(model.unary.shape[1]):
            changed = found.copy()
            changed[i] = k
            assert score(model, tuple(changed)) <= reached + 1e-9


@given(ruled_models(forest=True))
def test_on_a_forest_nothing_is_taken_back(model: Model) -> None:
    if best_score(model) > -np.inf:
        start = np.zeros(len(model.unary), np.int64)
        assert allowed_labels(pairwise_model(*model.arrays), start, max_failures=0) is not None


def test_a_labelling_that_breaks_no_rule_stays() -> None:
    unary = np.eye(3)[[0, 1, 0, 2]]
    model = pairwise_model(unary, [(0, 1), (1, 2), (2, 3)], pairwise=UNLIKE)
    found = allowed_labels(model, np.array([0, 1, 0, 2]))
    assert found is not None
    assert found.tolist() == [0, 1, 0, 2]


def test_four_neighbours_of_each_other_cannot_have_three_colours() -> None:
    edges = [(i, j) for i in range(4) for j in range(i + 1, 4)]
    model = pairwise_model(np.zeros((4, 3)), edges, pairwise=UNLIKE)
    with pytest.raises(InputError, match="pairwise forbids every labelling"):
        allowed_labels(model, np.zeros(4, np.int64))


def test_the_search_gives_up_at_its_limit() -> None:
    """No three colours suffice, but arc consistency alone does not see it."""
    edges = [(i, j) for i in range(4) for j in range(i + 1, 4)]
    model = pairwise_model(np.zeros((4, 3)), edges, pairwise=UNLIKE)
    assert allowed_labels(model, np.zeros(4, np.int64), max_failures=0) is None
