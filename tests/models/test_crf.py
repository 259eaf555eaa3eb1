"""The conditional random field: what it learns, decodes, refuses and keeps."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places import LabelGraph, LabelingProblem, Status, build, load, save
from pgm_places.errors import InputError, LabelError, LearningWarning, NotFittedError
from pgm_places.graph.cliques import Cliques
from pgm_places.models.crf import ConditionalRandomField
from pgm_places.solvers.adjacency import adjacency
from pgm_places.solvers.cutting_plane import cutting_plane
from pgm_places.solvers.table_field import TableField
from pgm_places.solvers.table_margin import TableMarginProblem
from tests.reference.energy import Model, best_score
from tests.reference.max_margin import all_labelings, constrained_optimum

# Max margin on graphs with cycles says so where its certificate is loose; that is tested below.
pytestmark = pytest.mark.filterwarnings("ignore:better weights may exist")

LEARNERS = ("likelihood", "pseudo-likelihood", "piecewise", "max-margin")
NAMES = ("a", "b", "c")


def ring(n: int, seed: int, noise: float = 1.0) -> tuple[LabelingProblem, NDArray[np.int64]]:
    """A chain on which a, b and c follow each other; nodes alone tell little."""
    truth = (np.arange(n) + seed) % 3
    looks = np.eye(3)[truth] + noise * np.random.default_rng(seed).normal(size=(n, 3))
    graph = LabelGraph.from_lattice((n,))
    return LabelingProblem(graph, NAMES, node_features=looks), truth


def board(side: int, seed: int) -> tuple[LabelingProblem, NDArray[np.int64]]:
    """A chess board, whose neighbours always differ."""
    truth = np.add.outer(np.arange(side), np.arange(side)).ravel() % 2
    looks = np.eye(2)[truth] + 1.5 * np.random.default_rng(seed).normal(size=(side * side, 2))
    graph = LabelGraph.from_lattice((side, side))
    return LabelingProblem(graph, ("white", "black"), node_features=looks), truth


@pytest.mark.parametrize("learner", LEARNERS)
def test_labels_that_follow_each_other_are_learned(learner: Any) -> None:
    train, truth = ring(300, 0)
    test, expected = ring(300, 1)
    field = ConditionalRandomField(learner).fit([train], [truth])
    network = build("amn").fit([train], [truth])
    assert field.tables is not None
    assert field.tables[0].argmax(axis=1).tolist() == [1, 2, 0]
    assert np.mean(field.infer(test).labels == expected) > 0.85
    assert np.mean(network.infer(test).labels == expected) < 0.75
    assert field.summary["status"] in ("optimal", "within_tolerance", "oracle_limit")


@pytest.mark.parametrize("learner", LEARNERS[1:])
def test_labels_that_repel_each_other_are_learned_on_a_grid(learner: Any) -> None:
    """The associative network can only ignore the neighbours; a table says that they differ."""
    train, truth = board(12, 0)
    test, expected = board(12, 1)
    field = ConditionalRandomField(learner).fit([train], [truth])
    network = build("amn").fit([train], [truth])
    assert field.tables is not None
    np.testing.assert_array_equal(field.tables, field.tables.transpose(0, 2, 1))
    assert np.mean(field.infer(test).labels == expected) > 0.95
    assert np.mean(network.infer(test).labels == expected) < 0.85


def spots(seed: int, noise: float, side: int = 12) -> tuple[LabelingProblem, NDArray[np.int64]]:
    """A square of another label on a quarter of a grid, seen through noise."""
    rng = np.random.default_rng(seed)
    truth = np.zeros((side, side), np.int64)
    row, column = rng.integers(0, side // 2, 2)
    truth[row : row + side // 2, column : column + side // 2] = 1
    looks = (truth.ravel() + noise * rng.normal(size=side * side))[:, None]
    graph = LabelGraph.from_lattice((side, side))
    return LabelingProblem(graph, ("ground", "spot"), node_features=looks), truth.ravel()


@pytest.mark.parametrize(
    ("noise", "n_train", "least"), [(0.6, 1, 0.88), (0.6, 2, 0.88), (0.8, 1, 0.74)]
)
def test_links_beside_true_neighbours_do_not_give_all_nodes_one_label(
    noise: float, n_train: int, least: float
) -> None:
    """Pseudo-likelihood used to give every node the rarer label: a quarter of them is right.

    With the larger noise half of the links look best on held-out nodes, but give all training nodes
    one label.
    """
    problems, truths = zip(*(spots(seed, noise) for seed in range(4)), strict=True)
    field = ConditionalRandomField("pseudo-likelihood").fit(problems[:n_train], truths[:n_train])
    found = [field.infer(problem).labels for problem in problems[2:]]
    assert np.mean(np.concatenate(found) == np.concatenate(truths[2:])) > least
    assert field.link_scales is not None
    assert field.link_scales[:, 0].tolist() == [1.0, 0.5, 0.25, 0.125, 0.0625, 0.0]


def test_links_that_help_nobody_are_left_out_with_a_word() -> None:
    problems, truths = zip(*(spots(seed, 0.8) for seed in range(2)), strict=True)
    with pytest.warns(LearningWarning, match=r"no better than each node .* learner='max-margin'"):
        field = ConditionalRandomField("pseudo-likelihood").fit(problems, truths)
    assert field.tables is not None
    assert not field.tables.any()
    alone = build("independent").infer(problems[0].with_unary(field.potentials(problems[0]).unary))
    np.testing.assert_array_equal(field.infer(problems[0]).labels, alone.labels)


def test_auto_takes_the_likelihood_where_it_can_be_computed() -> None:
    on_chain = ConditionalRandomField().fit(*_lists(ring(60, 0)))
    on_grid = ConditionalRandomField().fit(*_lists(board(8, 0)))
    chain, grid = ring(30, 1)[0], board(6, 1)[0]
    assert on_chain.infer(chain).info["decoder"] == "sum-product"
    assert on_grid.infer(grid).info["decoder"] == "trw-s"
    assert on_grid.by_margin is not None
    assert bool(on_grid.by_margin[0])
    by_margin = ConditionalRandomField("max-margin").fit(*_lists(ring(60, 0)))
    assert by_margin.infer(chain).info["decoder"] == "max-product"


def _lists(
    example: tuple[LabelingProblem, NDArray[np.int64]],
) -> tuple[list[LabelingProblem], list[NDArray[np.int64]]]:
    return [example[0]], [example[1]]


def test_the_score_is_that_of_the_learned_potentials() -> None:
    """On small trees against brute force, with the labelling of largest score."""
    field = ConditionalRandomField("max-margin", inference="exact").fit(*_lists(ring(60, 0)))
    for seed in range(5):
        tree = nx.random_labeled_tree(6, seed=seed)
        graph = LabelGraph.from_edges(6, np.array(tree.edges))
        looks = np.random.default_rng(seed).normal(size=(6, 3))
        problem = LabelingProblem(graph, NAMES, node_features=looks)
        found, potentials = field.infer(problem), field.potentials(problem)
        model = Model(potentials.unary, graph.edges.astype(np.int64), pairwise=potentials.pairwise)
        assert found.status is Status.EXACT
        assert found.score == pytest.approx(best_score(model))


@pytest.mark.parametrize("learner", ["likelihood", "max-margin"])
def test_nodes_without_a_label_inform_learning(learner: Any) -> None:
    """Every fourth node of a chain is labelled, so no edge has two known ends."""
    problem, truth = ring(400, 0, noise=0.7)
    labels = np.where(np.arange(400) % 4 == 0, truth, -1)
    hidden = ConditionalRandomField(learner).fit([problem], [labels])
    dropped = ConditionalRandomField(learner, unlabelled="dropped").fit([problem], [labels])
    test, expected = ring(200, 1, noise=0.7)
    assert np.mean(hidden.infer(test).labels == expected) > 0.9
    assert np.mean(dropped.infer(test).labels == expected) < 0.8
    assert hidden.summary["status"] == "local_optimum"


def test_the_price_is_chosen_on_held_out_parts() -> None:
    examples = [ring(60, seed) for seed in range(3)]
    problems, truths = [p for p, _ in examples], [t for _, t in examples]
    field = ConditionalRandomField(C=(0.01, 100.0), edge_scale=1.0).fit(problems, truths)
    assert field.penalty_search is not None
    assert field.penalty_search[:, 2].tolist() == [0.01, 100.0]
    assert field.penalty_search[1, 4] > field.penalty_search[0, 4]
    assert field.summary["penalty"] == 100.0
    single = ConditionalRandomField().fit(problems[:1], truths[:1])
    tried = [row["penalty"] for row in single.summary["held_out"]]
    assert 100.0 in tried  # where the search begins
    assert set(tried) <= {1.0, 10.0, 100.0, 1000.0, 10_000.0}
    assert single.summary["penalty"] in tried


def test_learning_goes_on_from_weights_that_are_known() -> None:
    examples = [ring(120, seed) for seed in range(4)]
    problems, truths = [p for p, _ in examples], [t for _, t in examples]
    before = ConditionalRandomField(C=1000.0, warm_start=True).fit(problems[:3], truths[:3])
    again = before.fit(problems[:3], truths[:3])
    assert again.summary["iterations"] <= 2
    warm = before.fit(problems, truths)
    cold = replace(before, warm_start=False).fit(problems, truths)
    assert warm.summary["iterations"] < cold.summary["iterations"]
    assert warm.summary["objective"] == pytest.approx(cold.summary["objective"], rel=0.01)
    hidden = [np.where(np.arange(120) % 9 == 0, -1, truth) for truth in truths]
    with pytest.raises(InputError, match="warm_start with max margin cannot be combined"):
        replace(before, learner="max-margin").fit(problems, hidden)
    fewer = LabelingProblem(problems[0].graph, NAMES, node_features=np.zeros((120, 2)))
    with pytest.raises(InputError, match="3 node features, this problem has 2"):
        before.fit([fewer], truths[:1])


def test_max_margin_goes_on_from_weights_that_are_known() -> None:
    examples = [ring(120, seed) for seed in range(5)]
    problems, truths = [p for p, _ in examples], [t for _, t in examples]
    before = ConditionalRandomField(learner="max-margin", warm_start=True)
    before = before.fit(problems[:4], truths[:4])
    warm = before.fit(problems, truths)
    cold = replace(before, warm_start=False, C=before.summary["penalty"]).fit(problems, truths)
    assert warm.summary["iterations"] < cold.summary["iterations"]
    assert warm.summary["objective"] == pytest.approx(cold.summary["objective"], rel=0.05)


def test_edge_features_of_any_sign_have_tables_of_their_own() -> None:
    """Where the feature is positive neighbours agree, where it is negative they differ."""

    def example(seed: int) -> tuple[LabelingProblem, NDArray[np.int64]]:
        rng = np.random.default_rng(seed)
        same = rng.random(149) < 0.5
        truth = np.concatenate([[0], np.cumsum(~same) % 2])
        looks = np.eye(2)[truth] + 1.5 * rng.normal(size=(150, 2))
        signs = np.where(same, 1.0, -1.0)[:, None]
        graph = LabelGraph.from_lattice((150,))
        return LabelingProblem(graph, ("a", "b"), None, looks, signs), truth

    train, truth = example(0)
    test, expected = example(1)
    field = ConditionalRandomField().fit([train], [truth])
    assert field.tables is not None
    assert len(field.tables) == 2
    assert np.mean(field.infer(test).labels == expected) > 0.95
    with pytest.raises(InputError, match=r"at least 0, got -1.*method 'crf'"):
        build("amn").fit([train], [truth])


def test_the_scale_of_edges_is_that_of_their_features_while_learning() -> None:
    problem, truth = ring(60, 0)
    given = ConditionalRandomField(
        C=10.0, edge_features="given", scale="none", learning_tolerance=1e-6
    )
    ones = np.ones((59, 1))
    narrow, wide = (replace(problem, edge_features=scale * ones) for scale in (1.0, 3.0))
    scaled = replace(given, edge_scale=3.0).fit([narrow], [truth]).potentials(narrow)
    wanted = replace(given, edge_scale=1.0).fit([wide], [truth]).potentials(wide)
    other = replace(given, edge_scale=1.0).fit([narrow], [truth]).potentials(narrow)
    np.testing.assert_allclose(known(scaled.pairwise), known(wanted.pairwise), rtol=1e-6)
    assert np.abs(known(scaled.pairwise) - known(other.pairwise)).max() > 0.1


def test_a_saved_field_labels_as_before(tmp_path: Path) -> None:
    field = ConditionalRandomField("max-margin").fit(*_lists(ring(60, 0)))
    save(field, tmp_path / "field", label_names=NAMES)
    again, test = load(tmp_path / "field"), ring(40, 1)[0]
    assert again.infer(test).score == field.infer(test).score
    assert again.summary == field.summary


def test_what_does_not_fit_is_refused() -> None:
    problem, truth = ring(30, 0)
    with pytest.raises(NotFittedError, match="has not learned yet"):
        ConditionalRandomField().infer(problem)
    with pytest.raises(InputError, match="no node of any training problem has a label"):
        ConditionalRandomField().fit([problem], [np.full(30, -1)])
    with pytest.raises(LabelError, match="'c'"):
        ConditionalRandomField().fit([problem], [truth % 2])
    with pytest.raises(InputError, match="needs a graph without cycles"):
        ConditionalRandomField("likelihood").fit(*_lists(board(4, 0)))
    field = ConditionalRandomField().fit([problem], [truth])
    with pytest.raises(InputError, match="trained on 3 labels, this problem has 2"):
        field.infer(board(4, 0)[0])
    with pytest.raises(InputError, match="trained on 3 node features, this problem has 1"):
        field.infer(replace(problem, node_features=np.ones((30, 1))))
    with pytest.raises(InputError, match="trained on 1 edge features, this problem has 2"):
        field.infer(replace(problem, edge_features=np.ones((29, 1))))
    with pytest.raises(InputError, match="feature_scale must be positive"):
        replace(field, feature_scale=np.zeros(3))


@pytest.mark.parametrize("learner", LEARNERS)
def test_a_weight_of_two_is_the_same_problem_twice(learner: Any) -> None:
    problem, truth = ring(24, 0)
    looks = np.asarray(problem.node_features)
    turns = (0, 5, 10)  # of one ring, so that features are scaled alike however often each is there
    problems = [replace(problem, node_features=np.roll(looks, n, axis=0)) for n in turns]
    truths = [np.roll(truth, 2 * n) for n in turns]
    field = ConditionalRandomField(learner, C=10.0, learning_tolerance=1e-7)
    twice = field.fit([*problems, problems[1]], [*truths, truths[1]]).potentials(problem)
    heavy = field.fit(problems, truths, sample_weight=[1.0, 2.0, 1.0]).potentials(problem)
    plain = field.fit(problems, truths).potentials(problem)
    np.testing.assert_allclose(heavy.unary, twice.unary, atol=2e-3)
    np.testing.assert_allclose(known(heavy.pairwise), known(twice.pairwise), atol=2e-3)
    assert np.abs(known(heavy.pairwise) - known(plain.pairwise)).max() > 0.02


def known(array: NDArray[np.float64] | None) -> NDArray[np.float64]:
    assert array is not None
    return array


@pytest.mark.parametrize("learner", LEARNERS)
def test_problems_of_small_weight_teach_little(learner: Any) -> None:
    """Rings that run the other way, but hardly count."""
    rings = [ring(60, seed) for seed in range(4)]
    problems, truths = [p for p, _ in rings], [t for _, t in rings]
    wrong = [truths[0], truths[1], *((-t) % 3 for t in truths[2:])]
    weights = [1.0, 1.0, 1e-3, 1e-3]
    field = ConditionalRandomField(learner).fit(problems, wrong, sample_weight=weights)
    assert field.tables is not None
    assert field.tables[0].argmax(axis=1).tolist() == [1, 2, 0]


def test_weights_that_a_learner_cannot_take_are_refused() -> None:
    problem, truth = ring(30, 0)
    some = np.where(np.arange(30) % 5 == 0, -1, truth)
    each = [np.linspace(0.5, 1.5, 30)]
    with pytest.raises(InputError, match="equal sample_weight within each connected part"):
        ConditionalRandomField().fit([problem], [truth], sample_weight=each)
    with pytest.raises(InputError, match="sample_weight with max margin cannot be combined"):
        ConditionalRandomField("max-margin").fit([problem], [some], sample_weight=each)
    dropped = ConditionalRandomField("max-margin", unlabelled="dropped")
    assert dropped.fit([problem], [some], sample_weight=each).tables is not None
    with pytest.raises(InputError, match="sample_weight is 0 at every labelled node"):
        dropped.fit([problem], [some], sample_weight=[(some < 0).astype(float)])


def sentences(seed: int, n_sets: int = 24) -> tuple[LabelingProblem, NDArray[np.int64]]:
    """A ring on which a, b and c follow each other, and strewn sets of six nodes of one label."""
    rng = np.random.default_rng(seed)
    n = 6 * n_sets
    truth = np.arange(n) % 3
    of_label = [rng.permutation(np.flatnonzero(truth == k)).reshape(-1, 6) for k in range(3)]
    sets = np.concatenate(of_label)[rng.permutation(n_sets)]
    looks = np.eye(3)[truth] + 2.0 * rng.normal(size=(n, 3))
    graph, cliques = LabelGraph.from_lattice((n,)), Cliques.of(sets, n)
    return LabelingProblem(graph, NAMES, node_features=looks, cliques=cliques), truth


def test_what_sets_earn_is_learned_beside_tables() -> None:
    train, truth = sentences(0)
    test, expected = sentences(1)
    field = ConditionalRandomField().fit([train], [truth])
    alone = ConditionalRandomField("max-margin").fit([replace(train, cliques=None)], [truth])
    assert field.clique_weights is not None
    assert field.clique_weights.shape == (1, 3)
    assert (field.clique_weights > 0).all()
    found = field.infer(test)
    assert found.info["decoder"] == "trw-s"
    assert field.tables is not None
    assert field.tables[0].argmax(axis=1).tolist() == [1, 2, 0]
    assert np.mean(found.labels == expected) > 0.95
    assert np.mean(alone.infer(replace(test, cliques=None)).labels == expected) < 0.85
    assert field.summary["certified_objective"] >= field.summary["lower_bound"]


def test_cliques_complete_labels_choose_the_price_and_go_on() -> None:
    problem, truth = sentences(0, 12)
    some = np.where(np.arange(len(truth)) % 5 == 0, -1, truth)
    hidden = ConditionalRandomField(C=(1.0, 100.0)).fit([problem], [some])
    assert hidden.penalty_search is not None
    assert hidden.summary["status"] == "local_optimum"
    before = ConditionalRandomField(warm_start=True).fit([problem], [truth])
    again = before.fit([problem], [truth])
    assert again.summary["iterations"] < before.summary["iterations"]
    twice = before.fit([problem, problem], [truth, truth], sample_weight=[1.0, 1e-6])
    assert twice.clique_weights is not None


def test_a_field_with_cliques_is_kept_and_refuses_what_does_not_fit(tmp_path: Path) -> None:
    problem, truth = sentences(0, 12)
    bare = replace(problem, cliques=None)
    field = ConditionalRandomField().fit([problem], [truth])
    save(field, tmp_path / "field", label_names=NAMES)
    assert load(tmp_path / "field").infer(problem).score == field.infer(problem).score
    with pytest.raises(InputError, match="likelihood learners cannot learn weights of cliques"):
        ConditionalRandomField("pseudo-likelihood").fit([problem], [truth])
    with pytest.raises(InputError, match="trained on cliques with 0 features, this problem has no"):
        field.infer(bare)
    with pytest.raises(InputError, match="must all have cliques with the same features"):
        ConditionalRandomField().fit([problem, bare], [truth, truth])
    with pytest.raises(InputError, match="clique_weights must be at least 0"):
        replace(field, clique_weights=-np.ones((1, 3)))


# ---------------------------------------------------------------- friends and rivals


def friends(seed: int, n: int = 120) -> tuple[LabelingProblem, NDArray[np.int64]]:
    """A random graph whose edges say, mostly rightly, whether both ends have the same label."""
    rng = np.random.default_rng(seed)
    pairs = np.unique(np.sort(rng.integers(0, n, (3 * n, 2)), axis=1), axis=0)
    pairs = pairs[pairs[:, 0] < pairs[:, 1]]
    truth = rng.integers(0, 3, n)
    alike = (truth[pairs[:, 0]] == truth[pairs[:, 1]]) ^ (rng.random(len(pairs)) < 0.1)
    graph = LabelGraph.from_edges(n, pairs)
    given = graph.edge_order(pairs).values(np.column_stack([alike, ~alike]).astype(float))
    looks = np.eye(3)[truth] + rng.normal(size=(n, 3))
    return LabelingProblem(graph, list("abc"), node_features=looks, edge_features=given), truth


def test_learners_are_compared_on_held_out_problems_and_an_open_gap_is_said() -> None:
    examples = [friends(seed) for seed in range(3)]
    problems, truths = [p for p, _ in examples], [t for _, t in examples]
    test, expected = friends(7)
    with pytest.warns(LearningWarning, match=r"gap of learning is \d+ % .* take learner="):
        ConditionalRandomField("max-margin").fit(problems, truths)
    field = ConditionalRandomField(certified_tolerance=None).fit(problems, truths)
    C = field.summary["penalty"]
    rows = {row["learner"]: row for row in field.summary["held_out"] if row["penalty"] == C}
    assert set(rows) == {"max-margin", "pseudo-likelihood"}
    best = max(rows, key=lambda name: rows[name]["accuracy"] + rows[name]["balanced_accuracy"])
    assert field.summary["learner"] == best
    assert field.summary["reason"] == "labels held-out parts best"
    assert test.node_features is not None
    alone = np.mean(test.node_features.argmax(axis=1) == expected)
    assert np.mean(field.infer(test).labels == expected) > alone + 0.1


def test_learners_are_compared_at_the_best_price() -> None:
    problem, truth = friends(1, 60)
    field = ConditionalRandomField(C=(1.0, 10.0), certified_tolerance=None).fit([problem], [truth])
    rows = field.summary["held_out"]
    margin = {row["penalty"]: row["accuracy"] + row["balanced_accuracy"] for row in rows[:2]}
    assert [row["learner"] for row in rows] == ["max-margin", "max-margin", "pseudo-likelihood"]
    assert set(margin) == {1.0, 10.0}
    assert rows[2]["penalty"] == max(margin, key=margin.__getitem__)


def test_labels_that_are_not_known_are_completed_by_max_margin() -> None:
    problem, truth = friends(1, 60)
    labels = np.where(np.arange(60) % 4, truth, -1)
    field = ConditionalRandomField(certified_tolerance=None).fit([problem] * 2, [labels] * 2)
    assert field.summary["learner"] == "max-margin"
    assert field.summary["reason"] == "completes labels that are not known"
    assert field.summary["held_out"] == []
    assert field.summary["penalty"] == 1000.0


def test_the_path_of_prices_gives_the_labels_of_plain_fits() -> None:
    """Each row's scores are those of fields that learn at this price without each part."""
    problems, truths = zip(*(ring(60, seed, noise=0.9) for seed in range(4)), strict=True)
    field = ConditionalRandomField(learning_tolerance=1e-6).fit(problems, truths)
    row = next(row for row in field.summary["held_out"] if row["penalty"] == 100.0)
    right = 0
    for m in range(4):
        rest = [k for k in range(4) if k != m]
        plain = ConditionalRandomField(C=100.0, scale="none").fit(
            [problems[k] for k in rest], [truths[k] for k in rest]
        )
        right += int((plain.infer(problems[m]).labels == truths[m]).sum())
    assert row["accuracy"] == pytest.approx(right / 240, abs=0.03)


def test_tables_learn_with_costs_as_enumeration_does() -> None:
    rng = np.random.default_rng(3)
    graph = LabelGraph.from_grid(np.ones((2, 3), np.bool_), connectivity=4)
    truth = np.array([0, 1, 2, 0, 1, 2])
    costs = rng.uniform(0.2, 3.0, (3, 3)) * (1 - np.eye(3))
    around = adjacency(6, graph.edges)
    field = TableField(rng.normal(size=(6, 2)), around, np.ones((graph.n_edges, 1)), 3, True)
    loss = rng.uniform(0.5, 2.0, 6)
    problem = TableMarginProblem(field, truth, loss, 5.0, costs=costs)
    listed = all_labelings(6, 3)
    phi = np.array([field.features_of(labels) for labels in listed])
    losses = (loss[:, None] * costs[truth[:, None], listed.T]).sum(axis=0)
    exact, _ = constrained_optimum(problem, phi - field.features_of(truth), losses)

    def best(unary: NDArray[np.float64], tables: NDArray[np.float64]) -> NDArray[np.int64]:
        first, second = listed[:, graph.edges].transpose(2, 0, 1)
        pairs = np.broadcast_to(tables, (graph.n_edges, 3, 3))
        scores = unary[np.arange(6), listed].sum(axis=1)
        scores += pairs[np.arange(graph.n_edges), first, second].sum(axis=1)
        found: NDArray[np.int64] = listed[scores.argmax()]
        return found

    learned = cutting_plane(problem, best, tolerance=1e-6, exact=True)
    assert learned.objective == pytest.approx(exact, rel=1e-4)
