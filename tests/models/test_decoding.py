"""One contract for every decoder: what a labelling says about itself holds."""

from itertools import product

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from pgm_places.errors import ConfigError, InputError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.labeling import Status
from pgm_places.inference.potentials import Potentials, score
from pgm_places.models.decoding import DECODERS, decode
from tests.reference.energy import Model, best_score
from tests.strategies import Kind, models

ALL = list(DECODERS)
ANY: tuple[Kind, ...] = ("associative", "agreement", "shared table", "tables", "metric")
SUITABLE: dict[str, tuple[tuple[Kind, ...], bool]] = dict.fromkeys(DECODERS, (ANY, False)) | {
    "graph-cut": (("associative", "metric"), False),
    "exact": (ANY, True),
}
"""Potentials that a decoder takes, and whether it wants a forest."""

EXACT_ON_FORESTS = ("lp", "exact")
ITERATIVE = [name for name in DECODERS if name not in ("lp", "exact")]


@st.composite
def problems(
    draw: st.DrawFn, method: str, *, forest: bool = False, exact: bool = False
) -> tuple[LabelGraph, Potentials, Model]:
    kinds, wants_forest = SUITABLE[method]
    model = draw(models(kinds, forest=forest or wants_forest, exact=exact))
    graph = LabelGraph.from_edges(len(model.unary), model.edges)
    potentials = Potentials(model.unary, pairwise=model.pairwise, agreement=model.agreement)
    return graph, potentials, model


def chain(n_nodes: int) -> LabelGraph:
    return LabelGraph.from_edges(n_nodes, [(i, i + 1) for i in range(n_nodes - 1)])


@pytest.mark.parametrize("method", ALL)
@settings(max_examples=40)
@given(data=st.data(), certify=st.booleans())
def test_what_a_labelling_says_about_itself_holds(
    method: str, data: st.DataObject, certify: bool
) -> None:
    graph, potentials, model = data.draw(problems(method))
    found = decode(graph, potentials, method, certify=certify)
    best = best_score(model)
    assert found.score == score(graph, potentials, found.labels)
    assert np.isfinite(found.score)
    if found.status is Status.EXACT:
        assert found.score == pytest.approx(best, rel=0, abs=1e-6)
    if certify:
        assert found.bound is not None
    if found.bound is not None:
        assert found.bound >= best - 1e-9
        assert found.bound >= found.score
    if found.beliefs is not None:
        assert found.beliefs.shape == model.unary.shape
    assert found.info["decoder"] == method
    assert found.info["iterations"] == len(found.info["history"])


@pytest.mark.parametrize("method", EXACT_ON_FORESTS)
@given(data=st.data())
def test_forests_are_solved_exactly(method: str, data: st.DataObject) -> None:
    graph, potentials, model = data.draw(problems(method, forest=True))
    found = decode(graph, potentials, method)
    assert found.status is Status.EXACT
    assert found.score == pytest.approx(best_score(model), rel=0, abs=1e-6)


@given(models(("associative",), n_labels=st.just(2)))
def test_two_labels_are_solved_exactly_by_cut_and_relaxation(model: Model) -> None:
    graph = LabelGraph.from_edges(len(model.unary), model.edges)
    potentials = Potentials(model.unary, agreement=model.agreement)
    cut = decode(graph, potentials, "graph-cut")
    assert cut.status is Status.EXACT
    assert cut.bound == cut.score
    assert cut.score == pytest.approx(best_score(model), rel=0, abs=1e-9)
    assert decode(graph, potentials, "lp").bound == pytest.approx(cut.score, rel=0, abs=1e-6)


@pytest.mark.parametrize("method", ALL)
@settings(max_examples=20)
@given(data=st.data())
def test_without_edges_every_node_takes_its_best_label(method: str, data: st.DataObject) -> None:
    _, _, model = data.draw(problems(method))
    lonely = LabelGraph.from_edges(len(model.unary), [])
    found = decode(lonely, Potentials(model.unary), method, certify=True)
    assert found.status is Status.EXACT
    best = model.unary.max(axis=1, initial=-np.inf)
    taken = model.unary[np.arange(len(best)), found.labels]
    np.testing.assert_allclose(taken, best, rtol=0, atol=1e-9)


@pytest.mark.parametrize("method", ["graph-cut", "lp", "trw-s", "exact"])
@given(data=st.data(), seed=st.integers(0, 999))
def test_constants_at_nodes_shift_the_score_alone(
    method: str, data: st.DataObject, seed: int
) -> None:
    graph, potentials, model = data.draw(problems(method, exact=True))
    shift = np.random.default_rng(seed).integers(-8, 8, len(model.unary)) / 4
    moved = Potentials(
        model.unary + shift[:, None], pairwise=model.pairwise, agreement=model.agreement
    )
    before, after = decode(graph, potentials, method), decode(graph, moved, method)
    assert before.score is not None
    assert after.score is not None
    assume(before.status is not Status.RELAXED)  # ties of a fractional solution are broken freely
    np.testing.assert_allclose(after.score, before.score + shift.sum(), rtol=0, atol=1e-4)


@pytest.mark.parametrize("method", ["lp", "exact"])
@given(data=st.data(), seed=st.integers(0, 999))
def test_numbering_of_nodes_and_labels_does_not_matter(
    method: str, data: st.DataObject, seed: int
) -> None:
    graph, potentials, model = data.draw(problems(method, forest=True))
    rng = np.random.default_rng(seed)
    n_nodes, n_labels = model.unary.shape
    order, names = rng.permutation(n_nodes), rng.permutation(n_labels)
    place = np.argsort(order)
    # from_edges turns and sorts edges; tables must follow them.
    pairs = place[model.edges].reshape(-1, 2)
    turned = pairs[:, 0] > pairs[:, 1]
    sorted_pairs = np.sort(pairs, axis=1)
    rank = np.lexsort((sorted_pairs[:, 1], sorted_pairs[:, 0]))
    tables = potentials.edge_tables(graph)[:, names][:, :, names]
    tables = np.where(turned[:, None, None], tables.transpose(0, 2, 1), tables)[rank]
    moved = decode(
        LabelGraph.from_edges(n_nodes, pairs),
        Potentials(model.unary[order][:, names], pairwise=tables),
        method,
    )
    found = decode(graph, potentials, method)
    assert moved.score == pytest.approx(found.score, rel=0, abs=1e-6)


@pytest.mark.parametrize("method", ALL)
def test_graphs_without_nodes_are_labelled(method: str) -> None:
    found = decode(LabelGraph.from_edges(0, []), Potentials(np.zeros((0, 3))), method, certify=True)
    assert found.labels.shape == (0,)
    assert (found.score, found.bound, found.status) == (0.0, 0.0, Status.EXACT)


@pytest.mark.parametrize("method", ALL)
def test_a_single_label_is_given(method: str) -> None:
    found = decode(chain(4), Potentials.potts(np.zeros((4, 1)), 2.0), method, certify=True)
    assert found.labels.tolist() == [0, 0, 0, 0]
    assert (found.score, found.status) == (6.0, Status.EXACT)


@pytest.mark.parametrize("method", ITERATIVE)
def test_the_limit_is_kept_and_each_iteration_reported(method: str) -> None:
    rng = np.random.default_rng(0)
    graph = LabelGraph.from_grid(np.ones((12, 12), np.bool_))
    potentials = Potentials.potts(rng.normal(size=(144, 3)) * 2, 0.7)
    seen: list[int] = []
    found = decode(
        graph,
        potentials,
        method,
        max_iterations=1,
        on_iteration=lambda iteration, _: seen.append(iteration),
    )
    assert seen == [1]
    assert found.status is Status.STOPPED


@pytest.mark.parametrize("method", ["sum-product", "mean-field", "exact"])
def test_methods_with_marginals_give_beliefs(method: str) -> None:
    found = decode(chain(3), Potentials.potts(np.log([[0.9, 0.1]] * 3), 1.0), method)
    assert found.beliefs is not None
    np.testing.assert_array_equal(found.beliefs.argmax(axis=1), found.labels)


def test_a_certificate_proves_what_it_can() -> None:
    rng = np.random.default_rng(1)
    graph = LabelGraph.from_grid(np.ones((15, 15), np.bool_))
    potentials = Potentials.potts(rng.normal(size=(225, 3)) * 3, 0.4)
    plain = decode(graph, potentials)
    assert (plain.bound, plain.gap, plain.status) == (None, None, Status.CONVERGED)
    proved = decode(graph, potentials, certify=True)
    np.testing.assert_array_equal(proved.labels, plain.labels)
    assert proved.gap is not None
    assert proved.gap <= 1e-3 * abs(proved.score or 0.0)
    assert proved.info["certificate"]["iterations"] >= 1


def test_a_worked_triangle() -> None:
    """Two nodes pull the third over: 2 + 1.5 + 0 + three agreeing edges of 0.5."""
    graph = LabelGraph.from_edges(3, [(0, 1), (0, 2), (1, 2)])
    potentials = Potentials.potts([[2.0, 0.0], [1.5, 0.0], [0.0, 0.9]], 0.5)
    scores = {labels: score(graph, potentials, labels) for labels in product((0, 1), repeat=3)}
    assert max(scores.values()) == 5.0
    for method in ("graph-cut", "lp", "trw-s"):
        assert decode(graph, potentials, method).labels.tolist() == [0, 0, 0]


def test_unknown_decoders_are_refused_with_the_nearest() -> None:
    with pytest.raises(ConfigError, match=r"unknown decoder 'graphcut'. did you mean 'graph-cut'"):
        decode(chain(2), Potentials(np.zeros((2, 2))), "graphcut")


@pytest.mark.parametrize(
    ("method", "edges", "pairwise", "text"),
    [
        ("exact", [(0, 1), (0, 2), (1, 2)], None, "needs a graph without cycles"),
        ("graph-cut", [(0, 1)], [[-1.0, 0.0], [0.0, -1.0]], "no expansion on label"),
    ],
)
def test_unsuitable_potentials_are_refused(
    method: str, edges: list[tuple[int, int]], pairwise: list[list[float]] | None, text: str
) -> None:
    potentials = Potentials(
        np.zeros((3, 2)), pairwise=None if pairwise is None else np.array(pairwise)
    )
    with pytest.raises(InputError, match=text):
        decode(LabelGraph.from_edges(3, edges), potentials, method)


@pytest.mark.parametrize("method", ALL)
def test_nodes_without_an_allowed_label_are_refused(method: str) -> None:
    unary = np.array([[0.0, 0.0], [-np.inf, -np.inf]])
    with pytest.raises(InputError, match="unary forbids every label at node 1"):
        decode(chain(2), Potentials(unary), method)


@pytest.mark.parametrize("method", ALL)
def test_potentials_of_another_graph_are_refused(method: str) -> None:
    with pytest.raises(InputError, match="unary has 2 rows but the graph has 3 nodes"):
        decode(chain(3), Potentials(np.zeros((2, 2))), method)
