import numpy as np
from hypothesis import given

from pgm_places.solvers.elimination import reduce_model
from pgm_places.solvers.pairwise import pairwise_model, total_score
from tests.reference.energy import Model, best_labelings, best_score, labelings, score
from tests.solvers.test_expansion import grid_model
from tests.strategies import models


@given(models(("associative", "agreement")))
def test_every_best_labelling_survives(model: Model) -> None:
    # In sixteenths all sums are exact; else rounding makes labellings equal that are not.
    agreement = None if model.agreement is None else np.round(16 * model.agreement) / 16
    model = Model(np.round(16 * model.unary) / 16, model.edges, agreement)
    reduced = reduce_model(pairwise_model(*model.arrays))
    for labels in best_labelings(model, atol=0.0):
        chosen = np.array(labels, np.int64)
        np.testing.assert_array_equal(reduced.lift(chosen[reduced.nodes]), chosen)
        assert np.isfinite(
            reduced.model.unary[np.arange(len(reduced.nodes)), chosen[reduced.nodes]]
        ).all()


@given(models(("associative", "agreement", "tables")))
def test_scores_of_the_rest_are_scores_of_the_whole(model: Model) -> None:
    reduced = reduce_model(pairwise_model(*model.arrays))
    rest = Model(reduced.model.unary, reduced.model.around.edges.astype(np.int64))
    found = []
    for labels in labelings(rest):
        chosen = np.array(labels, np.int64)
        value = total_score(reduced.model, chosen)
        if value > -np.inf:
            whole = tuple(reduced.lift(chosen).tolist())
            np.testing.assert_allclose(value, score(model, whole), rtol=0, atol=1e-9)
        found.append(value)
    np.testing.assert_allclose(max(found), best_score(model), rtol=0, atol=1e-9)


def test_strong_unaries_decide_most_nodes() -> None:
    model = grid_model(0, 3)
    assert model.agreement is not None
    reduced = reduce_model(pairwise_model(model.unary * 4, model.edges, model.agreement))
    assert len(reduced.nodes) < len(model.unary) / 2
