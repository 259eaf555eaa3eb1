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
from pgm_places.solvers.max_oracle import TableMarginProblem
from pgm_places.solvers.table_field import TableField
from tests.reference.energy import Model, best_score
from tests.reference.max_margin import all_labelings, constrained_optimum
from tests.refusals import refused

# Max margin on graphs with cycles says so where its certificate is loose; that is tested below.
pytestmark = pytest.mark.filterwarnings("ignore:better weights may exist")

LEARNERS = ("likelihood", "pseudo-likelihood", "piecewise", "max-margin")
Example = tuple[LabelingProblem, NDArray[np.int64]]


def learn(*examples: Example, **options: Any) -> Any:
    problems, truths = zip(*examples, strict=True)
    return ConditionalRandomField(**options).fit(problems, truths)


def share_right(model: Any, example: Example) -> float:
    return float(np.mean(model.infer(example[0]).labels == example[1]))


NAMES = ("a", "b", "c")


def ring(n: int, seed: int, noise: float = 1.0) -> Example:
    """A chain on which a, b and c follow each other; nodes alone tell little."""
    truth = (np.arange(n) + seed) % 3
    looks = np.eye(3)[truth] + noise * np.random.default_rng(seed).normal(size=(n, 3))
    return LabelingProblem(LabelGraph.from_lattice((n,)), NAMES, node_features=looks), truth


def board(side: int, seed: int) -> Example:
    """A chess board, whose neighbours always differ."""
    truth = np.add.outer(np.arange(side), np.arange(side)).ravel() % 2
    looks = np.eye(2)[truth] + 1.5 * np.random.default_rng(seed).normal(size=(side * side, 2))
    graph = LabelGraph.from_lattice((side, side))
    return LabelingProblem(graph, ("white", "black"), node_features=looks), truth


@pytest.mark.parametrize("learner", LEARNERS)
def test_labels_that_follow_each_other_are_learned(learner: str) -> None:
    train, test = ring(300, 0), ring(300, 1)
    field = learn(train, learner=learner)
    assert field.tables[0].argmax(axis=1).tolist() == [1, 2, 0]
    assert share_right(field, test) > 0.85
    assert share_right(build("amn").fit([train[0]], [train[1]]), test) < 0.75
    assert field.summary["status"] in ("optimal", "within_tolerance", "oracle_limit")


@pytest.mark.parametrize("learner", LEARNERS[1:])
def test_labels_that_repel_each_other_are_learned_on_a_grid(learner: str) -> None:
    """The associative network can only ignore the neighbours; a table says that they differ."""
    train, test = board(12, 0), board(12, 1)
    field = learn(train, learner=learner)
    np.testing.assert_array_equal(field.tables, field.tables.transpose(0, 2, 1))
    assert share_right(field, test) > 0.95
    assert share_right(build("amn").fit([train[0]], [train[1]]), test) < 0.85


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
    examples = [spots(seed, noise) for seed in range(4)]
    field = learn(*examples[:n_train], learner="pseudo-likelihood")
    assert np.mean([share_right(field, example) for example in examples[2:]]) > least
    assert field.link_scales[:, 0].tolist() == [1.0, 0.5, 0.25, 0.125, 0.0625, 0.0]


def test_links_that_help_nobody_are_left_out_with_a_word() -> None:
    examples = [spots(seed, 0.8) for seed in range(2)]
    with pytest.warns(LearningWarning, match=r"no better than each node .* learner='max-margin'"):
        field = learn(*examples, learner="pseudo-likelihood")
    assert not field.tables.any()
    problem = examples[0][0]
    alone = build("independent").infer(problem.with_unary(field.potentials(problem).unary))
    np.testing.assert_array_equal(field.infer(problem).labels, alone.labels)


def test_auto_takes_the_likelihood_where_it_can_be_computed() -> None:
    chain, on_grid = ring(30, 1)[0], learn(board(8, 0))
    assert learn(ring(60, 0)).infer(chain).info["decoder"] == "sum-product"
    assert on_grid.infer(board(6, 1)[0]).info["decoder"] == "trw-s"
    assert bool(on_grid.by_margin[0])
    by_margin = learn(ring(60, 0), learner="max-margin")
    assert by_margin.infer(chain).info["decoder"] == "max-product"


def test_the_score_is_that_of_the_learned_potentials() -> None:
    """On small trees against brute force, with the labelling of largest score."""
    field = learn(ring(60, 0), learner="max-margin", inference="exact")
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
def test_nodes_without_a_label_inform_learning(learner: str) -> None:
    """Every fourth node of a chain is labelled, so no edge has two known ends."""
    problem, truth = ring(400, 0, noise=0.7)
    example = problem, np.where(np.arange(400) % 4 == 0, truth, -1)
    hidden = learn(example, learner=learner)
    dropped = learn(example, learner=learner, unlabelled="dropped")
    test = ring(200, 1, noise=0.7)
    assert share_right(hidden, test) > 0.9
    assert share_right(dropped, test) < 0.8
    assert hidden.summary["status"] == "local_optimum"


def test_the_price_is_chosen_on_held_out_parts() -> None:
    examples = [ring(60, seed) for seed in range(3)]
    field = learn(*examples, C=(0.01, 100.0), edge_scale=1.0)
    assert field.penalty_search[:, 2].tolist() == [0.01, 100.0]
    assert field.penalty_search[1, 4] > field.penalty_search[0, 4]
    assert field.summary["penalty"] == 100.0
    single = learn(examples[0]).summary
    tried = [row["penalty"] for row in single["held_out"]]
    assert 100.0 in tried  # where the search begins
    assert set(tried) <= {1.0, 10.0, 100.0, 1000.0, 10_000.0}
    assert single["penalty"] in tried


@pytest.mark.parametrize(
    ("learner", "C", "tolerance"), [("auto", 1000.0, 0.01), ("max-margin", "auto", 0.05)]
)
def test_learning_goes_on_from_weights_that_are_known(
    learner: str, C: Any, tolerance: float
) -> None:
    examples = [ring(120, seed) for seed in range(5)]
    problems, truths = zip(*examples, strict=True)
    before = learn(*examples[:4], learner=learner, C=C, warm_start=True)
    warm = before.fit(problems, truths)
    cold = replace(before, warm_start=False, C=before.summary["penalty"]).fit(problems, truths)
    assert warm.summary["iterations"] < cold.summary["iterations"]
    assert warm.summary["objective"] == pytest.approx(cold.summary["objective"], rel=tolerance)
    if learner == "auto":
        assert before.fit(problems[:4], truths[:4]).summary["iterations"] <= 2
    hidden = [np.where(np.arange(120) % 9 == 0, -1, truth) for truth in truths]
    fewer = LabelingProblem(problems[0].graph, NAMES, node_features=np.zeros((120, 2)))
    by_margin = replace(before, learner="max-margin")
    wanted = "warm_start with max margin cannot be combined"
    refused(InputError, wanted, by_margin.fit, problems, hidden)
    wanted = "3 node features, this problem has 2"
    refused(InputError, wanted, before.fit, [fewer], truths[:1])


def test_edge_features_of_any_sign_have_tables_of_their_own() -> None:
    """Where the feature is positive neighbours agree, where it is negative they differ."""

    def example(seed: int) -> Example:
        rng = np.random.default_rng(seed)
        same = rng.random(149) < 0.5
        truth = np.concatenate([[0], np.cumsum(~same) % 2])
        looks = np.eye(2)[truth] + 1.5 * rng.normal(size=(150, 2))
        signs = np.where(same, 1.0, -1.0)[:, None]
        return LabelingProblem(
            LabelGraph.from_lattice((150,)), list("ab"), None, looks, signs
        ), truth

    field = learn(example(0))
    assert len(field.tables) == 2
    assert share_right(field, example(1)) > 0.95
    problem, truth = example(0)
    wanted = r"at least 0, got -1.*method 'crf'"
    refused(InputError, wanted, build("amn").fit, [problem], [truth])


def test_the_scale_of_edges_is_that_of_their_features_while_learning() -> None:
    problem, truth = ring(60, 0)

    def pairwise(edge_scale: float, unit: float) -> Any:
        item = replace(problem, edge_features=np.full((59, 1), unit))
        options = {"C": 10.0, "edge_features": "given", "scale": "none", "edge_scale": edge_scale}
        return learn((item, truth), learning_tolerance=1e-6, **options).potentials(item).pairwise

    np.testing.assert_allclose(pairwise(3.0, 1.0), pairwise(1.0, 3.0), rtol=1e-6)
    assert np.abs(pairwise(3.0, 1.0) - pairwise(1.0, 1.0)).max() > 0.1


def test_what_does_not_fit_is_refused() -> None:
    problem, truth = ring(30, 0)
    plain, likelihood = ConditionalRandomField(), ConditionalRandomField("likelihood")
    field: Any = plain.fit([problem], [truth])
    grid, labels = board(4, 0)
    looks = replace(problem, node_features=np.ones((30, 1)))
    linked = replace(problem, edge_features=np.ones((29, 1)))
    flat = {"feature_scale": np.zeros(3)}
    for error, message, call, arguments in (
        (NotFittedError, "has not learned yet", plain.infer, [problem]),
        (
            InputError,
            "no node of any training problem has",
            plain.fit,
            [[problem], [truth * 0 - 1]],
        ),
        (LabelError, "'c'", plain.fit, [[problem], [truth % 2]]),
        (InputError, "needs a graph without cycles", likelihood.fit, [[grid], [labels]]),
        (InputError, "trained on 3 labels, this problem has 2", field.infer, [grid]),
        (InputError, "trained on 3 node features, this problem has 1", field.infer, [looks]),
        (InputError, "trained on 1 edge features, this problem has 2", field.infer, [linked]),
        (InputError, "feature_scale must be positive", lambda: replace(field, **flat), []),
    ):
        refused(error, message, call, *arguments)


@pytest.mark.parametrize("learner", LEARNERS)
def test_a_weight_of_two_is_the_same_problem_twice(learner: Any) -> None:
    problem, truth = ring(24, 0)
    looks = np.asarray(problem.node_features)
    turns = (0, 5, 10)  # of one ring, so that features are scaled alike however often each is there
    problems = [replace(problem, node_features=np.roll(looks, n, axis=0)) for n in turns]
    truths = [np.roll(truth, 2 * n) for n in turns]
    field = ConditionalRandomField(learner, C=10.0, learning_tolerance=1e-7)
    twice, heavy, plain = (
        made.potentials(problem)
        for made in (
            field.fit([*problems, problems[1]], [*truths, truths[1]]),
            field.fit(problems, truths, sample_weight=[1.0, 2.0, 1.0]),
            field.fit(problems, truths),
        )
    )
    tables: list[Any] = [item.pairwise for item in (twice, heavy, plain)]
    np.testing.assert_allclose(heavy.unary, twice.unary, atol=2e-3)
    np.testing.assert_allclose(tables[1], tables[0], atol=2e-3)
    assert np.abs(tables[1] - tables[2]).max() > 0.02


@pytest.mark.parametrize("learner", LEARNERS)
def test_problems_of_small_weight_teach_little(learner: Any) -> None:
    """Rings that run the other way, but hardly count."""
    problems, truths = zip(*(ring(60, seed) for seed in range(4)), strict=True)
    wrong = [*truths[:2], *((-t) % 3 for t in truths[2:])]
    weights = [1.0, 1.0, 1e-3, 1e-3]
    field: Any = ConditionalRandomField(learner).fit(problems, wrong, sample_weight=weights)
    assert field.tables[0].argmax(axis=1).tolist() == [1, 2, 0]
    each, some = [np.linspace(0.5, 1.5, 60)], np.where(np.arange(60) % 5 == 0, -1, truths[0])
    plain, margin = ConditionalRandomField(), ConditionalRandomField("max-margin")
    dropped: Any = replace(margin, unlabelled="dropped")
    assert dropped.fit(problems[:1], [some], sample_weight=each).tables is not None
    nowhere = [(some < 0).astype(float)]
    for message, model, labels, weight in (
        ("equal sample_weight within each connected part", plain, truths[0], each),
        ("sample_weight with max margin cannot be combined", margin, some, each),
        ("sample_weight is 0 at every labelled node", dropped, some, nowhere),
    ):
        refused(InputError, message, model.fit, problems[:1], [labels], sample_weight=weight)


def sentences(seed: int, n_sets: int = 24) -> Example:
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
    train, test = sentences(0), sentences(1)

    def bare(example: Example) -> Example:
        return replace(example[0], cliques=None), example[1]

    field, alone = learn(train), learn(bare(train), learner="max-margin")
    assert field.clique_weights.shape == (1, 3)
    assert (field.clique_weights > 0).all()
    assert field.infer(test[0]).info["decoder"] == "trw-s"
    assert field.tables[0].argmax(axis=1).tolist() == [1, 2, 0]
    assert share_right(field, test) > 0.95
    assert share_right(alone, bare(test)) < 0.85
    assert field.summary["certified_objective"] >= field.summary["lower_bound"]


def test_cliques_complete_labels_choose_the_price_and_go_on() -> None:
    problem, truth = sentences(0, 12)
    hidden = learn((problem, np.where(np.arange(72) % 5 == 0, -1, truth)), C=(1.0, 100.0))
    assert hidden.penalty_search is not None
    assert hidden.summary["status"] == "local_optimum"
    before = learn((problem, truth), warm_start=True)
    again = before.fit([problem], [truth])
    assert again.summary["iterations"] < before.summary["iterations"]
    twice = before.fit([problem, problem], [truth, truth], sample_weight=[1.0, 1e-6])
    assert twice.clique_weights is not None


def test_a_field_with_cliques_is_kept_and_refuses_what_does_not_fit(tmp_path: Path) -> None:
    problem, truth = sentences(0, 12)
    bare = replace(problem, cliques=None)
    field = learn((problem, truth))
    save(field, tmp_path / "field", label_names=NAMES)
    assert load(tmp_path / "field").infer(problem).score == field.infer(problem).score
    assert load(tmp_path / "field").summary == field.summary
    negative = {"clique_weights": -np.ones((1, 3))}
    for message, call in (
        (
            "likelihood learners cannot learn weights of cliques",
            lambda: learn((problem, truth), learner="pseudo-likelihood"),
        ),
        ("on cliques with 0 features, this problem has no", lambda: field.infer(bare)),
        ("all have cliques with the same features", lambda: learn((problem, truth), (bare, truth))),
        ("clique_weights must be at least 0", lambda: replace(field, **negative)),
    ):
        refused(InputError, message, call)


# ---------------------------------------------------------------- friends and rivals


def friends(seed: int, n: int = 120) -> Example:
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
    examples, test = [friends(seed) for seed in range(3)], friends(7)
    with pytest.warns(LearningWarning, match=r"gap of learning is \d+ % .* take learner="):
        learn(*examples, learner="max-margin")
    field = learn(*examples, certified_tolerance=None)
    C = field.summary["penalty"]
    rows = {row["learner"]: row for row in field.summary["held_out"] if row["penalty"] == C}
    assert set(rows) == {"max-margin", "pseudo-likelihood"}
    best = max(rows, key=lambda name: rows[name]["accuracy"] + rows[name]["balanced_accuracy"])
    assert field.summary["learner"] == best
    assert field.summary["reason"] == "labels held-out parts best"
    alone = np.mean(np.asarray(test[0].node_features).argmax(axis=1) == test[1])
    assert share_right(field, test) > alone + 0.1


def test_learners_are_compared_at_the_best_price() -> None:
    rows = learn(friends(1, 60), C=(1.0, 10.0), certified_tolerance=None).summary["held_out"]
    margin = {row["penalty"]: row["accuracy"] + row["balanced_accuracy"] for row in rows[:2]}
    assert [row["learner"] for row in rows] == ["max-margin", "max-margin", "pseudo-likelihood"]
    assert set(margin) == {1.0, 10.0}
    assert rows[2]["penalty"] == max(margin, key=margin.__getitem__)


def test_labels_that_are_not_known_are_completed_by_max_margin() -> None:
    problem, truth = friends(1, 60)
    example = problem, np.where(np.arange(60) % 4, truth, -1)
    found = learn(example, example, certified_tolerance=None).summary
    assert (found["learner"], found["penalty"], found["held_out"]) == ("max-margin", 1000.0, [])
    assert found["reason"] == "completes labels that are not known"


def test_the_path_of_prices_gives_the_labels_of_plain_fits() -> None:
    """Each row's scores are those of fields that learn at this price without each part."""
    examples = [ring(60, seed, noise=0.9) for seed in range(4)]
    held_out = learn(*examples, learning_tolerance=1e-6).summary["held_out"]
    row = next(row for row in held_out if row["penalty"] == 100.0)
    right = [
        share_right(learn(*examples[:m], *examples[m + 1 :], C=100.0, scale="none"), examples[m])
        for m in range(4)
    ]
    assert row["accuracy"] == pytest.approx(np.mean(right), abs=0.03)


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
