import numpy as np
import pytest
from hypothesis import given

from pgm_places.errors import InputError
from pgm_places.solvers.local_search import allowed_labels, iterated_conditional_modes
from pgm_places.solvers.pairwise import pairwise_model, total_score
from tests.reference.energy import Model, score
from tests.refusals import refused
from tests.strategies import models


@given(models())
def test_no_change_of_one_node_improves_the_labelling(model: Model) -> None:
    found = iterated_conditional_modes(pairwise_model(*model.arrays))
    labels = found.labels.tolist()
    assert found.converged
    np.testing.assert_allclose(found.score, score(model, tuple(labels)), rtol=0, atol=1e-9)
    for i in range(len(labels)):
        for label in range(model.unary.shape[1]):
            changed = (*labels[:i], label, *labels[i + 1 :])
            assert score(model, changed) <= found.score + 1e-9


@given(models())
def test_the_score_never_falls_below_the_start(model: Model) -> None:
    start = model.unary.argmax(axis=1)
    found = iterated_conditional_modes(pairwise_model(*model.arrays), initial=start)
    assert found.score >= score(model, tuple(start.tolist())) - 1e-9


def test_passes_and_changes_are_reported() -> None:
    seen: list[tuple[int, float]] = []
    unary = [[1.0, 0.0], [0.0, 0.4], [0.0, 0.4], [1.0, 0.0]]
    edges = [(0, 1), (1, 2), (2, 3)]
    found = iterated_conditional_modes(
        pairwise_model(unary, edges, [[1.0, 0.0]] * 3), on_iteration=lambda *step: seen.append(step)
    )
    assert found.labels.tolist() == [0, 0, 0, 0]
    assert seen == [(1, 2.0), (2, 0.0)]
    assert found.history.tolist() == [2, 0]


def test_bad_limits_are_refused() -> None:
    with pytest.raises(InputError, match="max_iterations must be at least 1, got 0"):
        iterated_conditional_modes(pairwise_model(np.zeros((2, 2)), [(0, 1)]), max_iterations=0)


@pytest.mark.parametrize(
    "labels", [[0, 0, 0, 99_999_999], [-5, 0, 0, 0], [0, 0], [0.5, 0, 0, 0], [2**40, 0, 0, 0]]
)
def test_labels_that_there_are_none_of_reach_no_kernel(labels: list[float]) -> None:
    """They were read as places in memory."""
    model = pairwise_model(np.zeros((4, 3)), [(0, 1), (1, 2), (2, 3)], np.ones((3, 3)))
    for take in (total_score, allowed_labels):
        refused(InputError, "labels must h", take, model, np.array(labels))
