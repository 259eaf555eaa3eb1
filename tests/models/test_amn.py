from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places import LabelGraph, LabelingProblem, OccupancyGrid, Status, build, score
from pgm_places.errors import ConfigError, InputError, LabelError, LearningWarning, NotFittedError
from pgm_places.models.amn import AssociativeMarkovNetwork
from pgm_places.models.amn_learning import resolved_learner
from pgm_places.models.labelled_examples import node_losses
from pgm_places.models.learning_record import LEARNING_STATUSES, REASONS, LearningRecord
from pgm_places.solvers.margin_solution import REACHED, LearningStep
from tests.refusals import refused

NAMES = ("corridor", "room", "doorway")
TABLE = ((0.0, 1.0, 2.0), (1.0, 0.0, 1.0), (4.0, 1.0, 0.0))
"""Costs of confusion."""


def stripes(height: int, width: int, n: int, n_labels: int) -> NDArray[np.int64]:
    """The labels of a grid in columns, ``n`` stripes of them in turn."""
    column = np.mgrid[:height, :width][1].ravel()
    return (column * n // width % n_labels).astype(np.int64)


def sample(height: int = 8, width: int = 12, *, seed: int = 0, n_labels: int = 3) -> Any:
    """A problem of stripes of labels with noisy scores and features on a grid, and its truth."""
    rng = np.random.default_rng(seed)
    truth = stripes(height, width, n_labels, n_labels)
    logits = 2.0 * np.eye(n_labels)[truth] + 0.8 * rng.normal(size=(len(truth), n_labels))
    unary = logits - np.log(np.exp(logits).sum(axis=1, keepdims=True))
    features = np.column_stack([truth + rng.normal(size=len(truth)), rng.normal(size=len(truth))])
    graph = LabelGraph.from_grid(np.ones((height, width), np.bool_))
    return LabelingProblem(graph, NAMES[:n_labels], unary, features), truth


def learn(problem: LabelingProblem, truth: Any, **options: Any) -> Any:
    return AssociativeMarkovNetwork(**options).fit([problem], [truth])


def learned_arrays(network: Any) -> dict[str, Any]:
    learned = [item.name for item in fields(network) if item.metadata.get("learned")]
    return {name: value for name in learned if (value := getattr(network, name)) is not None}


# ---------------------------------------------------------------- use


def test_it_learns_to_smooth() -> None:
    problem, truth = sample(seed=1)
    unfitted = AssociativeMarkovNetwork()
    network: Any = unfitted.fit([problem], [truth])
    fresh, other_truth = sample(seed=2)
    labeling = network.infer(fresh)
    alone = (fresh.unary.argmax(axis=1) == other_truth).mean()
    assert (labeling.labels == other_truth).mean() > max(alone, 0.95)
    wanted = score(fresh.graph, network.potentials(fresh), labeling.labels)
    assert labeling.score == pytest.approx(wanted, rel=1e-12)
    assert labeling.info["learning"]["status"] in REACHED
    refused(NotFittedError, "call fit", unfitted.infer, problem)
    refused(NotFittedError, "call fit", lambda: unfitted.summary)
    nothing = network.infer(problem.subproblem(np.zeros(96, np.bool_)))
    assert (len(nothing.labels), nothing.status) == (0, Status.EXACT)


# ---------------------------------------------------------------- learning


def test_learners_minimise_the_same_objective() -> None:
    problem, truth = sample(6, 8, n_labels=2, seed=4)
    base, other = (
        learn(problem, truth, C=5.0, learning_tolerance=1e-3, learner=learner).summary
        for learner in ("cutting-plane", "qp")
    )
    assert other["status"] in ("optimal", "within_tolerance")
    assert other["objective"] == pytest.approx(base["objective"], rel=3e-3)
    assert other["lower_bound"] <= base["objective"]
    assert base["lower_bound"] <= other["objective"]


@pytest.mark.parametrize("learner", ["cutting-plane", "qp"])
def test_the_summary_certifies_the_objective(learner: str) -> None:
    problem, truth = sample(6, 8, seed=5)
    network = learn(problem, truth, learner=learner, C=5.0)
    summary = network.summary
    assert summary["lower_bound"] <= summary["certified_objective"]
    assert 0 <= summary["certified_gap"] < 0.1
    assert (summary["n_nodes"], summary["n_maps"]) == (48, 1)
    without = replace(network, certify_learning=False).fit([problem], [truth]).summary
    assert without["certified_objective"] is without["certified_gap"] is None


@pytest.mark.parametrize("learner", ["cutting-plane", "qp"])
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.filterwarnings("ignore:better weights may exist")
def test_the_status_says_no_more_than_the_certified_gap(learner: str, seed: int) -> None:
    """A hard problem: three labels, noisy features, a high C."""
    summary = learn(*sample(5, 6, seed=seed), learner=learner, C=1000.0, max_cuts=200).summary
    assert summary["objective"] >= summary["lower_bound"]
    highest = {"optimal": 1e-6, "within_tolerance": 5e-3}
    assert summary["certified_gap"] <= highest.get(summary["status"], np.inf)


def test_unlabelled_nodes_are_left_out() -> None:
    problem, truth = sample(seed=6)
    known = np.random.default_rng(0).random(len(truth)) < 0.7
    network = learn(problem, np.where(known, truth, -1))
    reduced = learn(problem.subproblem(known), truth[known])
    np.testing.assert_array_equal(network.node_weights, reduced.node_weights)
    assert network.summary["n_nodes"] == known.sum()


def test_several_maps_are_the_union_of_their_blocks_and_one_twice_is_one() -> None:
    (first, truth1), (second, truth2) = sample(5, 6, seed=7), sample(4, 9, seed=8)
    union = LabelingProblem(
        LabelGraph.joined(first.graph, second.graph, []),
        NAMES,
        np.concatenate([first.unary, second.unary]),
        np.concatenate([first.node_features, second.node_features]),
    )
    options: dict[str, Any] = {"C": 100.0, "node_features": "logz+raw", "learning_tolerance": 1e-4}
    network = AssociativeMarkovNetwork(edge_features=("unary-difference",), **options)
    apart: Any = network.fit([first, second], [truth1, truth2])
    together: Any = network.fit([union], [np.concatenate([truth1, truth2])])
    assert apart.summary["objective"] == pytest.approx(together.summary["objective"], rel=1e-9)
    np.testing.assert_allclose(apart.node_weights, together.node_weights, rtol=0, atol=1e-9)
    assert apart.summary["n_maps"] == 2
    network = AssociativeMarkovNetwork(learner="cutting-plane", **options)
    problem, truth = sample(seed=9)
    once: Any = network.fit([problem], [truth])
    twice: Any = network.fit([problem, problem], [truth, truth])
    np.testing.assert_allclose(twice.node_weights, once.node_weights, rtol=0, atol=1e-6)


def test_the_scale_of_edge_features_frees_the_edge_weights() -> None:
    problem, truth = sample(seed=21)
    stiff, free = (
        learn(problem, truth, edge_scale=scale, C=1.0).potentials(problem).agreement.mean()
        for scale in (0.01, 4.0)
    )
    assert free > 10 * stiff


def test_duplicate_features_are_dropped() -> None:
    problem, truth = sample(seed=10)
    looks = problem.node_features
    more = replace(problem, node_features=np.c_[looks, 1.0 - 3.0 * looks[:, 0], np.ones(96)])
    network, again = (learn(item, truth, edge_features=("constant",)) for item in (problem, more))
    np.testing.assert_array_equal(again.node_weights, network.node_weights)
    np.testing.assert_array_equal(again.infer(more).labels, network.infer(problem).labels)


def test_weighting_classes_keeps_the_rare_one() -> None:
    rng = np.random.default_rng(3)
    graph = LabelGraph.from_grid(np.ones((10, 20), np.bool_))
    truth = np.isin(np.mgrid[:10, :20][1].ravel(), (9, 10)).astype(np.int64)
    features = (truth + 0.8 * rng.normal(size=200))[:, None]
    problem = LabelingProblem(graph, NAMES[:2], node_features=features)
    recalls = []
    for loss, weight in (("hamming", "none"), ("class-weighted", "sqrt")):
        options = {"loss": loss, "class_weight": weight, "node_features": "raw", "C": 100.0}
        labels = learn(problem, truth, **options).infer(problem).labels
        recalls.append((labels[truth == 1] == 1).mean())
    assert recalls[1] > recalls[0] + 0.2


def test_losses_have_mean_one_and_the_stated_ratio() -> None:
    truth = np.repeat([0, 1], [90, 10]).astype(np.int64)
    ratios: dict[Any, float] = {"none": 1, "cube-root": 9 ** (1 / 3), "sqrt": 3, "inverse": 9}
    for weight, ratio in ratios.items():
        losses = node_losses(truth, NAMES[:2], weight)
        assert losses.mean() == pytest.approx(1.0)
        assert losses[-1] / losses[0] == pytest.approx(ratio)


def test_weights_by_name_and_costs_of_confusion() -> None:
    problem, truth = sample(6, 8, seed=4)

    def task(**options: Any) -> Any:
        return AssociativeMarkovNetwork(**options).learning_problem([problem], [truth])

    losses = task(class_weight={NAMES[1]: 4.0}).loss
    np.testing.assert_allclose(losses / losses[truth == 0][0], np.where(truth == 1, 4.0, 1.0))
    np.testing.assert_allclose(task(loss=TABLE).node_costs(3), np.array(TABLE)[truth] * 6 / 10)
    plain, ones = task(loss="hamming"), task(loss=(1.0 - np.eye(3)).tolist())
    np.testing.assert_array_equal(ones.node_costs(3), plain.node_costs(3))
    refused(
        InputError, "has a weight for 'hall', which is no label", task, class_weight={"hall": 1}
    )
    refused(InputError, "0 on the diagonal", task, loss=((1.0, 1.0), (1.0, 0.0)))
    refused(InputError, r"shape \(3, 3\)", learn, problem, truth, loss=((0.0, 1.0), (1.0, 0.0)))


def test_costs_follow_their_labels_whatever_the_order_inside() -> None:
    problem, truth = sample(6, 9, seed=4)
    truth = np.where(truth == 0, 2, truth)  # the last label is the most frequent
    truth[:3] = 0
    first = learn(problem, truth, loss=TABLE, C=5.0, learner="cutting-plane")
    assert first.loss == TABLE
    turn = np.array([2, 0, 1])
    names = [NAMES[k] for k in turn]
    turned = replace(problem, label_names=names, unary=problem.unary[:, turn])
    costs = tuple(tuple(TABLE[i][j] for j in turn) for i in turn)
    second = replace(first, loss=costs).fit([turned], [np.argsort(turn)[truth]])
    assert second.summary["objective"] == pytest.approx(first.summary["objective"], rel=1e-9)


# ---------------------------------------------------------------- stopping


def test_progress_is_reported_and_learning_can_be_stopped() -> None:
    problem, truth = sample(seed=12)
    seen: list[LearningStep] = []

    def stop_at_four(step: LearningStep) -> bool:
        seen.append(step)
        return step.iteration >= 4

    network: Any = AssociativeMarkovNetwork(learner="cutting-plane", C=100.0)
    network = network.fit([problem], [truth], on_iteration=stop_at_four)
    assert [step.iteration for step in seen] == [1, 2, 3, 4]
    assert network.summary["status"] == "stopped"
    assert network.learning_history.shape == (4, 4)
    assert len(network.infer(problem).labels) == len(truth)


def test_a_time_limit_gives_the_best_so_far() -> None:
    options: dict[str, Any] = {"time_limit_s": 1e-9, "learning_tolerance": 1e-9, "C": 100.0}
    with pytest.warns(LearningWarning, match=r"the certified gap of learning is \d+ % of the obj"):
        summary = learn(*sample(seed=13), **options).summary
    assert summary["status"] == "time_limit"
    assert summary["lower_bound"] <= summary["certified_objective"]


def test_the_learner_follows_the_size_and_the_record_says_why() -> None:
    problem, truth = sample(6, 8, seed=4)
    for learner, reason in (("auto", REASONS[1]), ("qp", REASONS[0])):
        found = learn(problem, truth, C=5.0, learner=learner).summary
        assert (found["learner"], found["reason"]) == ("qp", reason)
    large, labels = sample(120, 120)
    task = AssociativeMarkovNetwork(C=5.0).learning_problem([large], [labels])
    assert resolved_learner(task, "auto", needs_cuts=False) == ("cutting-plane", REASONS[2])


# ---------------------------------------------------------------- the choice of C


def test_c_is_chosen_on_held_out_blocks() -> None:
    graph, truth = LabelGraph.from_grid(np.ones((6, 40), np.bool_)), stripes(6, 40, 10, 2)
    rng = np.random.default_rng(4)
    features = np.column_stack([truth + 0.7 * rng.normal(size=240), rng.normal(size=(240, 3))])
    problem = LabelingProblem(graph, NAMES[:2], node_features=features)
    network = learn(problem, truth, C=(1e-4, 10.0), node_features="raw")
    assert network.summary["penalty"] == 10.0
    assert network.penalty_search[:, 2].tolist() == [1e-4, 10.0]
    assert network.penalty_search[1, 4] > network.penalty_search[0, 4]
    listed = network.summary["held_out"]
    assert [(row["penalty"], row["chosen"]) for row in listed] == [(1e-4, False), (10.0, True)]
    direct = learn(problem, truth, C=10.0, node_features="raw")
    np.testing.assert_array_equal(network.node_weights, direct.node_weights)


def test_nothing_is_tried_beyond_a_c_that_labels_all_held_out_parts_right() -> None:
    graph, truth = LabelGraph.from_grid(np.ones((4, 16), np.bool_)), stripes(4, 16, 8, 2)
    problem = LabelingProblem(graph, NAMES[:2], node_features=np.eye(2)[truth])
    fitted = learn(problem, truth, C=(100.0, 10.0, 30.0), node_features="raw")
    assert fitted.penalty_search[:, [2, 4]].tolist() == [[30.0, 1.0]]  # one below the usual 100
    assert fitted.summary["penalty"] == 30.0


def on_map(problem: LabelingProblem) -> LabelingProblem:
    """The problem on a map of free cells, whose graph is the problem's."""
    height, width = problem.graph.grid_layout.shape
    free = OccupancyGrid(np.zeros((height, width), np.int8), resolution_m=0.2)
    return replace(problem, graph=LabelGraph.from_grid(free))


@pytest.mark.parametrize(("of_map", "penalty"), [(False, 100.0), (True, 10.0)])
def test_without_a_block_that_can_be_held_out_c_is_the_usual(of_map: bool, penalty: float) -> None:
    problem, truth = sample(seed=15)
    summary = learn(on_map(problem) if of_map else problem, truth, n_validation_blocks=3).summary
    assert summary["penalty"] == penalty
    assert {row["balanced_accuracy"] for row in summary["held_out"]} == {None}


def with_noise(n_noise: int, looks: float) -> tuple[LabelingProblem, NDArray[np.int64]]:
    """Stripes with scores that say much, features that say something, and noise."""
    rng = np.random.default_rng(5)
    graph, truth = LabelGraph.from_grid(np.ones((6, 40), np.bool_)), stripes(6, 40, 10, 2)
    scores = np.column_stack([np.where(truth, -1.0, 1.0) + rng.normal(size=240), np.zeros(240)])
    features = np.column_stack([looks * truth, np.zeros((240, n_noise))])
    features = features + rng.normal(size=features.shape)
    return LabelingProblem(graph, NAMES[:2], unary=scores, node_features=features), truth


def test_features_join_the_scores_only_where_they_help() -> None:
    noise, truth = with_noise(60, 0.0)
    clear = on_map(with_noise(0, 6.0)[0])
    parts = {"logz": noise, "offset+logz": on_map(noise), "offset+logz+raw": clear}
    for wanted, problem in parts.items():
        network = learn(problem, truth, edge_features="constant")
        assert network.summary["node_features"] == wanted
    names = {row["node_features"] for row in network.summary["held_out"]}
    assert names == {"offset+logz", "offset+logz+raw"}
    plain: Any = AssociativeMarkovNetwork(edge_features="constant")
    again = replace(plain, **learned_arrays(network))
    np.testing.assert_array_equal(again.infer(clear).labels, network.infer(clear).labels)


def test_an_offset_is_the_classifier_until_something_is_learned() -> None:
    problem, truth = sample(6, 20, seed=21)
    network = learn(problem, truth, C=1e-6, node_features="offset+logz")
    found = network.infer(problem).labels
    np.testing.assert_array_equal(found, problem.unary.argmax(axis=1))
    learned = replace(network, C=100.0).fit([problem], [truth])
    assert (learned.infer(problem).labels == truth).mean() > (found == truth).mean()


def test_an_offset_is_what_a_column_with_weights_of_one_would_be() -> None:
    problem, truth = sample(5, 8, seed=22)
    fitted = learn(problem, truth, C=20.0, node_features="offset+raw", scale="none")
    arrays, k = learned_arrays(fitted), problem.n_labels
    columns = np.concatenate([problem.node_features, np.maximum(problem.unary, -15.0)], axis=1)
    weights, d = arrays["node_weights"], columns.shape[1]
    changed: dict[str, Any] = {
        **arrays,
        "node_weights": np.concatenate([weights[:-1], np.eye(k), weights[-1:]]),
        "feature_columns": np.arange(d),
        "feature_mean": np.zeros(d),
        "feature_scale": np.ones(d),
        "n_features": np.array([d]),
        "node_choice": np.array([0]),
    }
    same = replace(AssociativeMarkovNetwork(node_features="raw", scale="none"), **changed)
    beside = replace(problem, unary=None, node_features=columns)
    mine, other = fitted.potentials(problem), same.potentials(beside)
    np.testing.assert_allclose(mine.unary, other.unary, rtol=1e-9, atol=1e-9)


def test_beside_an_offset_labels_earn_alike() -> None:
    problem, truth = sample(6, 20, seed=21)
    fitted = learn(problem, truth, C=100.0, node_features="offset+logz")
    weights = fitted.edge_weights
    assert weights.max() > 0
    np.testing.assert_array_equal(weights, np.repeat(weights[:, :1], problem.n_labels, axis=1))
    again = replace(fitted, warm_start=True).fit([problem], [truth])
    assert again.summary["iterations"] <= fitted.summary["iterations"]
    assert again.summary["objective"] == pytest.approx(fitted.summary["objective"], rel=1e-2)


def test_an_offset_gives_up_no_held_out_accuracy() -> None:
    rng = np.random.default_rng(3)
    graph = LabelGraph.from_grid(np.ones((8, 60), np.bool_))
    truth = rng.integers(0, 2, graph.n_nodes)  # neighbours say nothing
    lead = np.where(truth, 1.0, -1.0) * rng.uniform(0.5, 4.0, size=len(truth))
    lead[rng.random(len(truth)) < 0.1] *= -1
    unary = -np.logaddexp(0.0, np.column_stack([lead, -lead]))
    summary = learn(on_map(LabelingProblem(graph, NAMES[:2], unary)), truth).summary
    assert summary["node_features"] == "offset+logz"
    [chosen] = [row for row in summary["held_out"] if row["chosen"]]
    assert chosen["accuracy"] >= (unary.argmax(axis=1) == truth).mean() - 0.001


def test_where_there_is_no_offset() -> None:
    problem, truth = sample(5, 8, seed=22)
    some = np.where(np.arange(len(truth)) % 3 == 0, -1, truth)
    options = {"C": 10.0, "node_features": "offset+logz"}
    refused(
        InputError, "an offset cannot be c", learn, problem, some, unlabelled="hidden", **options
    )
    refused(ConfigError, "unknown part 'offset'", build, "crf", node_features="offset+logz")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"learner": "cutting-plan"}, "learner must be 'auto', 'cutting-plane' or 'qp'"),
        ({"node_features": "logs"}, "Did you mean 'logz'"),
        ({"edge_features": ()}, "edge_features must be one or more parts"),
    ],
)
def test_options_are_checked(options: dict[str, Any], message: str) -> None:
    refused(ConfigError, message, AssociativeMarkovNetwork, **options)


# ---------------------------------------------------------------- storing


def test_learned_arrays_bring_the_network_back() -> None:
    problem, _ = sample(seed=16)
    options = {"C": (10.0, 50.0), "n_validation_blocks": 6, "certify_learning": False}
    fitted = learn(problem, stripes(8, 12, 6, 3), **options)
    arrays = learned_arrays(fitted)
    assert len(arrays) == 12
    assert all(np.isfinite(array).all() for array in arrays.values())
    again = replace(AssociativeMarkovNetwork(), **arrays)
    np.testing.assert_array_equal(again.infer(problem).labels, fitted.infer(problem).labels)
    assert again.summary == fitted.summary


@pytest.mark.parametrize("status", LEARNING_STATUSES)
@pytest.mark.parametrize("certified", [None, 2.5])
def test_records_survive_as_arrays(status: str, certified: float | None) -> None:
    record = LearningRecord(status, 10.0, 2.0, 1.5, certified, 7, 0.1, 0.2, 100, 300, 2)
    if status == "optimal":  # which a gap of 0.5 is not, whatever an earlier version wrote
        assert LearningRecord.from_array(record.to_array()).status == "oracle_limit"
        record = replace(record, certified_objective=1.5)
    assert LearningRecord.from_array(record.to_array()) == record


# ---------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("node_weights", np.zeros((2, 3)), "node_weights must have shape"),
        ("node_weights", np.full((6, 3), np.nan), "node_weights must hold finite numbers"),
        ("edge_weights", -np.ones((1, 3)), "edge_weights must be at least 0"),
        ("feature_columns", np.full(5, 99), "feature_columns must hold integers"),
        ("feature_scale", np.zeros(5), "feature_scale must be positive"),
        ("learning", np.zeros(3), "learning must hold 13 numbers"),
        ("penalty_search", np.zeros(5), "penalty_search must be a table"),
        ("penalty_search", np.array([["room"] * 5]), "penalty_search must"),
        ("penalty_search", np.array([[5.0, 0, 1, 1, 1]]), "penalty_search must hold 0 to 4"),
        ("penalty_search", np.array([[0, 1e300, 1, 1, 1]]), "penalty_search must hold 0 to 5"),
        ("penalty_search", np.array([[0, np.nan, 1, 1, 1]]), "penalty_search must hold 0 to 5"),
        ("feature_mean", None, "has not learned"),
    ],
)
def test_damaged_arrays_are_refused(name: str, value: Any, message: str) -> None:
    network = learn(*sample(seed=17), node_features="logz+raw", C=10.0)
    refused((InputError, NotFittedError), message, replace, network, **{name: value})


def test_what_does_not_fit_is_refused() -> None:
    problem, truth = sample(seed=19)
    network = learn(problem, truth, node_features="logz+raw", C=10.0)
    fewer = replace(problem, node_features=problem.node_features[:, :1])
    two = LabelingProblem(problem.graph, NAMES[:2], node_features=np.zeros((96, 5)))
    one, both = (
        replace(problem, edge_features=np.ones((problem.graph.n_edges, n))) for n in (1, 2)
    )
    given = learn(one, truth, edge_features=("given",), C=10.0)
    other = replace(problem, label_names=("a", "b", "c"))
    fit = AssociativeMarkovNetwork().fit
    rare = np.minimum(truth, 1)
    for error, message, call, arguments in (
        (InputError, "trained on 5 node features, this problem has 4", network.infer, [fewer]),
        (InputError, "trained on 3 labels, this problem has 2", network.infer, [two]),
        (InputError, "trained on 1 edge features, this problem has 2", given.infer, [both]),
        (InputError, "same number of node features", fit, [[problem, fewer], [truth, truth]]),
        (InputError, "got 1 problems and 0 labelings", fit, [[problem], []]),
        (InputError, r"labelings\[0\] must have shape \(96,\)", fit, [[problem], [truth[:-1]]]),
        (InputError, "no node of any training problem has a", fit, [[problem], [np.full(96, -1)]]),
        (InputError, "have different labels", fit, [[problem, other], [truth, truth]]),
        (LabelError, "no node .* is labelled 'doorway'", fit, [[problem], [rare]]),
    ):
        refused(error, message, call, *arguments)


# ---------------------------------------------------------------- weights and going on


def test_a_weight_of_two_is_the_same_map_twice() -> None:
    problem, truth = sample(6, 6)
    turns = (0, 7, 19)  # of one map's scores, so that they are scaled alike however often each is
    graph = problem.graph
    problems = [LabelingProblem(graph, NAMES, np.roll(problem.unary, n, axis=0)) for n in turns]
    truths = [np.roll(truth, 2 * n) for n in turns]
    network = AssociativeMarkovNetwork(C=10.0, loss="hamming", learning_tolerance=1e-6)
    twice = network.fit([*problems, problems[1]], [*truths, truths[1]]).potentials(problems[0])
    heavy = network.fit(problems, truths, sample_weight=[1.0, 2.0, 1.0]).potentials(problems[0])
    plain = network.fit(problems, truths).potentials(problems[0])
    np.testing.assert_allclose(heavy.unary, twice.unary, atol=0.02)
    assert np.abs(heavy.unary - plain.unary).max() > 0.1


def test_learning_goes_on_from_weights_that_are_known() -> None:
    problems, truths = zip(*(sample(8, 8, seed=seed, n_labels=2) for seed in range(4)), strict=True)
    before: Any = AssociativeMarkovNetwork(warm_start=True).fit(problems[:3], truths[:3])
    warm = before.fit(problems, truths)
    # the same problem from nothing: with the scaling that was learned before
    cold = replace(before, warm_start=False).fit(problems[:3], truths[:3])
    assert before.fit(problems[:3], truths[:3]).summary["iterations"] < cold.summary["iterations"]
    assert warm.summary["certified_gap"] <= 1e-3
    np.testing.assert_array_equal(warm.feature_mean, before.feature_mean)
    hidden = [np.where(np.arange(64) % 9 == 0, -1, truth) for truth in truths]
    other = replace(problems[0], edge_features=np.ones((problems[0].graph.n_edges, 1)))
    completing, by_qp = replace(before, unlabelled="hidden"), replace(before, learner="qp")
    refused(InputError, "warm_start cannot be combined", completing.fit, problems, hidden)
    refused(InputError, "learner='cutting-plane', got 'qp'", by_qp.fit, problems, truths)
    refused(InputError, "the model's labels and features", before.fit, [other], truths[:1])


def test_nothing_left_to_learn_is_no_gap(recwarn: pytest.WarningsRecorder) -> None:
    graph = LabelGraph.from_grid(np.ones((1, 40), np.bool_))
    truth = (np.arange(40) >= 30).astype(np.int64)
    sure = LabelingProblem(graph, NAMES[:2], np.log(np.where(np.eye(2)[truth], 0.99, 0.01)))
    fitted = learn(on_map(sure), truth)
    assert fitted.summary["objective"] < 1e-3
    np.testing.assert_array_equal(fitted.infer(sure).labels, truth)
    assert not recwarn.list
