"""One contract for every decoder: what a labelling says about itself holds."""

from itertools import combinations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pgm_places import LabelGraph, Potentials, Status, decode, score
from pgm_places.errors import ConfigError, InputError
from pgm_places.models.decoders import DECODERS
from pgm_places.solvers.local_search import allowed_labels
from tests.reference.energy import Model, best_score
from tests.refusals import refused
from tests.strategies import Kind, models, ruled_models

ALL = list(DECODERS)
ANY: tuple[Kind, ...] = ("associative", "agreement", "shared table", "tables", "metric")

EXACT_ON_FORESTS = ("lp", "exact")
ITERATIVE = [name for name in DECODERS if name not in ("lp", "exact")]


@st.composite
def problems(
    draw: st.DrawFn, method: str, *, forest: bool = False
) -> tuple[LabelGraph, Potentials, Model]:
    cuttable: tuple[Kind, ...] = ("associative", "metric")
    model = draw(models(cuttable if method == "graph-cut" else ANY, forest=forest))
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
    note = {"on_iteration": lambda iteration, _: seen.append(iteration)}
    found = decode(graph, potentials, method, max_iterations=1, **note)  # type: ignore[arg-type]
    assert (seen, found.status) == ([1], Status.STOPPED)


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


@pytest.mark.parametrize("method", ALL)
def test_what_does_not_fit_is_refused(method: str) -> None:
    none_left = Potentials(np.array([[0.0, 0.0], [-np.inf, -np.inf]]))
    wanted = "unary forbids every label at node 1"
    refused(InputError, wanted, decode, chain(2), none_left, method)
    wanted = "unary has 2 rows but the graph has 3 nodes"
    refused(InputError, wanted, decode, chain(3), Potentials(np.zeros((2, 2))), method)


def test_what_a_decoder_cannot_do_is_told() -> None:
    pair, grid = chain(2), LabelGraph.from_lattice((15, 15))
    flat = np.zeros((2, 2))
    apart, wide = Potentials(flat, pairwise=-np.eye(2)), Potentials(np.zeros((225, 4)))
    wanted = r"unknown decoder 'graphcut'. Did you mean 'graph-cut'"
    refused(ConfigError, wanted, decode, pair, Potentials(flat), "graphcut")
    refused(InputError, "no expansion on label", decode, pair, apart, "graph-cut")
    wanted = r"more than 33,554,432 numbers: .* 420 edges"
    refused(InputError, wanted, decode, grid, wide, "exact")


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
