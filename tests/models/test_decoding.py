"""One contract for every decoder: what a labelling says about itself holds."""

from itertools import combinations, product

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from pgm_places.errors import ConfigError, InputError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.labeling import Status
from pgm_places.inference.potentials import Potentials, score
from pgm_places.models.built_in_decoders import DECODERS
from pgm_places.models.decoding import decode
from pgm_places.solvers.local_search import allowed_labels
from tests.reference.energy import Model, best_score
from tests.strategies import Kind, models, ruled_models

ALL = list(DECODERS)
ANY: tuple[Kind, ...] = ("associative", "agreement", "shared table", "tables", "metric")
SUITABLE: dict[str, tuple[tuple[Kind, ...], bool]] = dict.fromkeys(DECODERS, (ANY, False)) | {
    "graph-cut": (("associative", "metric"), False),
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
    if found.status is not Status.EXACT:  # an LP does not tell labellings apart below its tolerance
        assert method == "lp"
        assert found.gap is not None and 0 < found.gap < 1e-6
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


FORBIDDING = [one for one in ALL if one != "graph-cut"]
"""Decoders that take -inf in tables."""


@pytest.mark.parametrize("method", FORBIDDING)
@settings(max_examples=60)
@given(model=ruled_models(), certify=st.booleans())
def test_no_forbidden_labelling_is_given_where_another_exists(
    method: str, model: Model, certify: bool
) -> None:
    graph = LabelGraph.from_edges(len(model.unary), model.edges)
    potentials = Potentials(model.unary, pairwise=model.pairwise)
    best = best_score(model)
    if best == -np.inf:
        with pytest.raises(InputError, match="forbid"):
            decode(graph, potentials, method, certify=certify)
        return
    found = decode(graph, potentials, method, certify=certify)
    assert found.score is not None
    assert found.score > -np.inf
    assert found.status is not Status.INFEASIBLE
    if found.status is Status.EXACT:
        assert found.score == pytest.approx(best, rel=0, abs=1e-9)
    if found.bound is not None:
        assert found.bound >= best - 1e-9


RULE = -1e5
"""What stands for -inf where tables may not hold it."""


@given(model=ruled_models(forest=True))
def test_max_product_is_exact_on_forests_with_large_numbers_for_rules(model: Model) -> None:
    assert model.pairwise is not None
    tables = np.where(model.pairwise == -np.inf, RULE, model.pairwise)
    graph = LabelGraph.from_edges(len(model.unary), model.edges)
    found = decode(graph, Potentials(model.unary, pairwise=tables), "max-product")
    best = best_score(Model(model.unary, model.edges, pairwise=tables))
    assert found.status is Status.EXACT
    assert found.score == found.bound == pytest.approx(best, rel=0, abs=1e-6)


@pytest.mark.parametrize("seed", [0, 8, 10, 11])
def test_on_a_ring_large_numbers_do_not_end_the_messages_early(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ring = LabelGraph.from_edges(7, [(i, (i + 1) % 7) for i in range(7)])
    unary, rule = rng.normal(size=(7, 3)), np.eye(3, k=1) + np.eye(3, k=-2)
    barred = Potentials(unary, pairwise=np.where(rule > 0, -np.inf, 0.0))
    found = decode(ring, Potentials(unary, pairwise=RULE * rule), "max-product")
    assert found.labels.tolist() == decode(ring, barred, "max-product").labels.tolist()


def test_a_search_that_gives_up_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    unlike = np.where(np.eye(3, dtype=np.bool_), -np.inf, 0.0)
    graph = LabelGraph.from_edges(5, [(i, j) for i in range(4) for j in range(i + 1, 4)])

    def give_up(*arguments: object) -> None:
        return allowed_labels(*arguments, max_failures=0)  # type: ignore[arg-type, return-value]

    monkeypatch.setattr("pgm_places.solvers.local_search.allowed_labels", give_up)
    found = decode(graph, Potentials(np.zeros((5, 3)), pairwise=unlike), "icm")
    assert (found.status, found.score) == (Status.INFEASIBLE, -np.inf)


@pytest.mark.parametrize("method", ALL)
def test_known_labels_are_kept_and_tell_their_neighbours(method: str) -> None:
    chain = LabelGraph.from_edges(3, [(0, 1), (1, 2)])
    potentials = Potentials.potts([[1.0, 0.0], [0.1, 0.0], [0.0, 0.3]], 2.0)
    assert decode(chain, potentials, method).labels.tolist() == [0, 0, 0]
    found = decode(chain, potentials, method, known=[1, -1, -1])
    assert found.labels.tolist() == [1, 1, 1]


@pytest.mark.parametrize("method", ["exact", "trw-s"])
def test_rounding_puts_no_bound_below_its_score(method: str) -> None:
    chain = LabelGraph.from_edges(6, [(i, i + 1) for i in range(5)])
    for seed in range(60):
        unary = np.random.default_rng(seed).normal(size=(6, 3))
        found = decode(chain, Potentials.potts(unary, 0.3), method)
        assert found.bound is not None and found.score is not None
        assert found.bound >= found.score


def test_a_labelling_that_had_to_be_repaired_is_called_so() -> None:
    triangle = LabelGraph.from_edges(3, [(0, 1), (0, 2), (1, 2)])
    unlike = np.where(np.eye(3, dtype=np.bool_), -np.inf, 0.0)
    found = decode(triangle, Potentials(np.zeros((3, 3)), pairwise=unlike), "mean-field")
    assert (found.status, found.score) == (Status.REPAIRED, 0.0)
    assert sorted(found.labels.tolist()) == [0, 1, 2]


def random_grid(scale: float) -> tuple[LabelGraph, dict[str, Potentials]]:
    """Potentials of every kind on a grid with frustrated cycles, times ``scale``."""
    rng = np.random.default_rng(3)
    graph = LabelGraph.from_lattice((7, 7))
    unary = scale * rng.normal(size=(49, 3))
    tables = scale * rng.normal(size=(graph.n_edges, 3, 3))
    reward = scale * rng.random((graph.n_edges, 3))
    return graph, {
        "tables": Potentials(unary, pairwise=tables),
        "agreement": Potentials(unary, agreement=reward),
    }


SCALES = [2.0**-40, 2.0**40]
"""About 1e-12 and 1e12; powers of two, so that not even rounding differs."""


BEST_LABELS = ["lp", "trw-s", "icm", "max-product"]


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize(
    ("method", "kind"),
    [("graph-cut", "agreement"), *product(BEST_LABELS, ("tables", "agreement"))],
)
def test_the_scale_of_the_potentials_does_not_matter(method: str, kind: str, scale: float) -> None:
    graph, plain = random_grid(1.0)
    _, scaled = random_grid(scale)
    found = decode(graph, plain[kind], method, certify=True)
    other = decode(graph, scaled[kind], method, certify=True)
    np.testing.assert_array_equal(other.labels, found.labels)
    assert other.status is found.status
    assert None not in (found.score, found.bound, other.score, other.bound)
    assert other.score / scale == found.score  # type: ignore[operator]
    assert other.bound / scale == pytest.approx(found.bound, rel=1e-9)  # type: ignore[operator]
    assert other.info["iterations"] == found.info["iterations"]


@pytest.mark.parametrize("method", ["sum-product", "mean-field"])
def test_beliefs_at_tiny_scales_tend_to_a_limit(method: str) -> None:
    """``exp(score)`` depends on the scale, but no tolerance cuts what is left of it."""
    graph, small = random_grid(2.0**-25)
    _, smaller = random_grid(2.0**-35)
    first = decode(graph, small["tables"], method)
    second = decode(graph, smaller["tables"], method)
    assert (first.status, second.status) == (Status.CONVERGED, Status.CONVERGED)
    assert first.beliefs is not None
    assert second.beliefs is not None
    np.testing.assert_allclose(
        (second.beliefs - 1 / 3) * 2.0**35, (first.beliefs - 1 / 3) * 2.0**25, rtol=0, atol=1e-3
    )


SQUARE = [(0, 1), (1, 2), (2, 3), (0, 3), (0, 2)]


@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e12])
@pytest.mark.parametrize("method", ALL)
def test_no_scale_makes_a_labelling_exact_that_is_not(method: str, scale: float) -> None:
    graph = LabelGraph.from_edges(4, [(0, 1), (1, 2), (2, 3)] if method == "exact" else SQUARE)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        unary, reward = rng.normal(size=(4, 3)), rng.random((graph.n_edges, 3))
        potentials = Potentials(scale * unary, agreement=scale * reward)
        found = decode(graph, potentials, method, certify=True)
        best = best_score(Model(scale * unary, graph.edges.astype(np.int64), scale * reward))
        if found.status is Status.EXACT:
            assert found.score == pytest.approx(best, rel=1e-9)


def test_unknown_decoders_are_refused_with_the_nearest() -> None:
    with pytest.raises(ConfigError, match=r"unknown decoder 'graphcut'. Did you mean 'graph-cut'"):
        decode(chain(2), Potentials(np.zeros((2, 2))), "graphcut")


@pytest.mark.parametrize(
    ("method", "edges", "pairwise", "text"),
    [
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


def test_exact_says_in_advance_that_a_graph_is_too_wide() -> None:
    grid = LabelGraph.from_lattice((15, 15))
    with pytest.raises(InputError, match=r"more than 33,554,432 numbers: .* 420 edges"):
        decode(grid, Potentials(np.zeros((225, 4))), "exact")


@pytest.mark.parametrize("method", ALL)
def test_nodes_without_an_allowed_label_are_refused(method: str) -> None:
    unary = np.array([[0.0, 0.0], [-np.inf, -np.inf]])
    with pytest.raises(InputError, match="unary forbids every label at node 1"):
        decode(chain(2), Potentials(unary), method)


@pytest.mark.parametrize("method", ALL)
def test_potentials_of_another_graph_are_refused(method: str) -> None:
    with pytest.raises(InputError, match="unary has 2 rows but the graph has 3 nodes"):
        decode(chain(3), Potentials(np.zeros((2, 2))), method)


@pytest.mark.parametrize("rule", [1e6, 1e9, 1e12, 1e15])
@pytest.mark.parametrize("method", ["icm", "mean-field", "trw-s"])
def test_rules_as_large_numbers_make_nothing_exact_that_is_not(method: str, rule: float) -> None:
    """Most edges hold such a number: a gap of 5.9 was taken for rounding."""
    x = -rule
    rows = [[x, 0, 2], [1, x, -1], [0, -2, 2], [x, 2, x], [-1, -1, x], [1, 2, -2], [x, x, 2]]
    rows += [[x, -2, 0], [1, 2, -1], [0, -2, -2], [0, 1, x], [x, -1, -2], [-2, -1, x], [-2, -2, 0]]
    rows += [[x, 2, -1], [0, x, x], [0, 0, 2], [1, 2, -2], [-1, -1, 0], [x, 1, 1], [1, 0, 0]]
    graph = LabelGraph.from_edges(7, list(combinations(range(7), 2)))
    potentials = Potentials(np.zeros((7, 3)), agreement=np.array(rows, np.float64))
    found = decode(graph, potentials, method, certify=True)
    assert decode(graph, potentials, "exact").score == 10.0
    assert (found.status is Status.EXACT) <= (found.score == 10.0)
    assert found.gap is not None
    assert (found.status is Status.EXACT) <= (found.gap <= 1e-9)


def test_a_table_that_all_edges_share_may_hold_a_rule() -> None:
    graph = LabelGraph.from_edges(3, [(0, 1), (1, 2), (0, 2)])
    tables = np.array([[[1.0, -1e13], [-1e13, 2.0]]] * 3)
    found = decode(graph, Potentials(np.zeros((3, 2)), pairwise=tables), "icm", certify=True)
    assert (found.status is Status.EXACT) == (found.score == 6.0)
