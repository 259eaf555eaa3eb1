from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.errors import ConfigError, InputError, LabelError, LearningWarning, NotFittedError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.backends import Backend, Learnable, build
from pgm_places.inference.labeling import Status
from pgm_places.inference.potentials import score
from pgm_places.inference.problem import LabelingProblem
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.models import amn as module
from pgm_places.models.amn import AssociativeMarkovNetwork
from pgm_places.models.held_out_choice import choose
from pgm_places.models.labelled_examples import node_losses
from pgm_places.models.learning_record import LEARNING_STATUSES, REASONS, LearningRecord
from pgm_places.solvers.margin_solution import REACHED, LearningStep

NAMES = ("corridor", "room", "doorway")
Sample = tuple[LabelingProblem, NDArray[np.int64]]


def sample(
    height: int = 8, width: int = 12, *, seed: int = 0, noise: float = 0.8, n_labels: int = 3
) -> Sample:
    """Stripes of labels with noisy scores and features on a grid."""
    rng = np.random.default_rng(seed)
    graph = LabelGraph.from_grid(np.ones((height, width), np.bool_))
    truth = ((np.mgrid[:height, :width][1] * n_labels) // width).ravel().astype(np.int64)
    logits = 2.0 * np.eye(n_labels)[truth] + noise * rng.normal(size=(len(truth), n_labels))
    unary = logits - np.log(np.exp(logits).sum(axis=1, keepdims=True))
    features = np.column_stack([truth + rng.normal(size=len(truth)), rng.normal(size=len(truth))])
    return LabelingProblem(graph, NAMES[:n_labels], unary, features), truth


def learned_arrays(network: AssociativeMarkovNetwork) -> dict[str, NDArray[Any]]:
    values = {item.name: getattr(network, item.name) for item in fields(network)}
    return {
        item.name: values[item.name]
        for item in fields(network)
        if item.metadata.get("learned") and values[item.name] is not None
    }


# ---------------------------------------------------------------- use


def test_it_learns_to_smooth() -> None:
    problem, truth = sample(seed=1)
    assert problem.unary is not None
    network = AssociativeMarkovNetwork().fit([problem], [truth])
    fresh, other_truth = sample(seed=2)
    labeling = network.infer(fresh)
    assert fresh.unary is not None
    alone = (fresh.unary.argmax(axis=1) == other_truth).mean()
    assert (labeling.labels == other_truth).mean() > max(alone, 0.95)
    assert labeling.score == pytest.approx(
        score(fresh.graph, network.potentials(fresh), labeling.labels), rel=1e-12
    )
    assert labeling.info["learning"]["status"] in REACHED


def test_it_is_a_backend_by_name_that_learns() -> None:
    network = build("amn", {"learner": "qp", "C": 5.0, "edge_features": ("constant", "diagonal")})
    assert isinstance(network, Backend)
    assert isinstance(network, Learnable)
    assert vars(network)["C"] == 5.0


def test_fit_returns_a_new_network() -> None:
    problem, truth = sample()
    network = AssociativeMarkovNetwork()
    fitted = network.fit([problem], [truth])
    assert network.node_weights is None
    assert fitted.node_weights is not None
    with pytest.raises(NotFittedError, match="call fit"):
        network.infer(problem)
    with pytest.raises(NotFittedError, match="call fit"):
        _ = network.summary


@pytest.mark.parametrize("inference", ["lp", "trw-s"])
def test_decoders_agree_on_a_learned_network(inference: Any) -> None:
    problem, truth = sample(4, 6, seed=3)
    network = AssociativeMarkovNetwork(certify=True).fit([problem], [truth])
    cut = network.infer(problem)
    other = replace(network, inference=inference).infer(problem)
    assert cut.bound is not None
    assert cut.score is not None
    assert cut.bound >= cut.score
    assert other.score == pytest.approx(cut.score, rel=1e-6)
    np.testing.assert_array_equal(other.labels, cut.labels)


def test_a_graph_without_nodes_gets_no_labels() -> None:
    problem, truth = sample()
    network = AssociativeMarkovNetwork().fit([problem], [truth])
    empty = problem.subproblem(np.zeros(problem.graph.n_nodes, np.bool_))
    labeling = network.infer(empty)
    assert len(labeling.labels) == 0
    assert labeling.status is Status.EXACT


# ---------------------------------------------------------------- learning


def test_learners_minimise_the_same_objective() -> None:
    problem, truth = sample(6, 8, n_labels=2, seed=4)
    options: dict[str, Any] = {"C": 5.0, "learning_tolerance": 1e-3}
    cuts = AssociativeMarkovNetwork(learner="cutting-plane", **options)
    base = cuts.fit([problem], [truth]).summary
    other = AssociativeMarkovNetwork(learner="qp", **options).fit([problem], [truth]).summary
    assert other["status"] in ("optimal", "within_tolerance")
    assert other["objective"] == pytest.approx(base["objective"], rel=3e-3)
    assert other["lower_bound"] <= base["objective"]
    assert base["lower_bound"] <= other["objective"]


@pytest.mark.parametrize("learner", ["cutting-plane", "qp"])
def test_the_summary_certifies_the_objective(learner: Any) -> None:
    problem, truth = sample(6, 8, seed=5)
    network = AssociativeMarkovNetwork(learner=learner, C=5.0).fit([problem], [truth])
    summary = network.summary
    assert summary["lower_bound"] <= summary["certified_objective"]
    assert 0 <= summary["certified_gap"] < 0.1
    assert summary["n_nodes"] == 48
    assert summary["n_maps"] == 1
    without = replace(network, certify_learning=False).fit([problem], [truth]).summary
    assert without["certified_objective"] is None
    assert without["certified_gap"] is None


@pytest.mark.parametrize("learner", ["cutting-plane", "qp"])
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.filterwarnings("ignore:better weights may exist")
def test_the_status_says_no_more_than_the_certified_gap(learner: Any, seed: int) -> None:
    """A hard problem: three labels, noisy features, a high C."""
    problem, truth = sample(5, 6, seed=seed)
    network = AssociativeMarkovNetwork(learner=learner, C=1000.0, max_cuts=200)
    summary = network.fit([problem], [truth]).summary
    assert summary["objective"] >= summary["lower_bound"]
    highest = {"optimal": 1e-6, "within_tolerance": 5e-3}
    assert summary["certified_gap"] <= highest.get(summary["status"], np.inf)


def test_unlabelled_nodes_are_left_out() -> None:
    problem, truth = sample(seed=6)
    known = np.random.default_rng(0).random(len(truth)) < 0.7
    partial = np.where(known, truth, -1)
    network = AssociativeMarkovNetwork().fit([problem], [partial])
    reduced = AssociativeMarkovNetwork().fit([problem.subproblem(known)], [truth[known]])
    np.testing.assert_array_equal(network.node_weights, reduced.node_weights)
    assert network.summary["n_nodes"] == known.sum()


def test_several_maps_are_the_union_of_their_blocks() -> None:
    (first, truth1), (second, truth2) = sample(5, 6, seed=7), sample(4, 9, seed=8)
    assert first.unary is not None and second.unary is not None
    assert first.node_features is not None and second.node_features is not None
    union = LabelingProblem(
        LabelGraph.joined(first.graph, second.graph, []),
        NAMES,
        np.concatenate([first.unary, second.unary]),
        np.concatenate([first.node_features, second.node_features]),
    )
    network = AssociativeMarkovNetwork(
        C=100.0,
        node_features="logz+raw",
        edge_features=("unary-difference",),
        learning_tolerance=1e-4,
    )
    apart = network.fit([first, second], [truth1, truth2])
    together = network.fit([union], [np.concatenate([truth1, truth2])])
    assert apart.summary["objective"] == pytest.approx(together.summary["objective"], rel=1e-9)
    assert apart.node_weights is not None
    assert together.node_weights is not None
    np.testing.assert_allclose(apart.node_weights, together.node_weights, rtol=0, atol=1e-9)
    assert apart.summary["n_maps"] == 2


def test_the_scale_of_edge_features_frees_the_edge_weights() -> None:
    problem, truth = sample(seed=21)
    stiff = AssociativeMarkovNetwork(edge_scale=0.01, C=1.0).fit([problem], [truth])
    free = AssociativeMarkovNetwork(edge_scale=4.0, C=1.0).fit([problem], [truth])
    rewards = [network.potentials(problem).agreement for network in (stiff, free)]
    assert rewards[0] is not None and rewards[1] is not None
    assert rewards[1].mean() > 10 * rewards[0].mean()


def test_doubling_the_map_changes_no_weight() -> None:
    problem, truth = sample(seed=9)
    network = AssociativeMarkovNetwork(
        learner="cutting-plane", C=100.0, node_features="logz+raw", learning_tolerance=1e-4
    )
    once = network.fit([problem], [truth])
    twice = network.fit([problem, problem], [truth, truth])
    assert once.node_weights is not None
    assert twice.node_weights is not None
    np.testing.assert_allclose(twice.node_weights, once.node_weights, rtol=0, atol=1e-6)


def test_duplicate_features_are_dropped() -> None:
    problem, truth = sample(seed=10)
    assert problem.node_features is not None
    padded = np.column_stack(
        [problem.node_features, -3.0 * problem.node_features[:, 0] + 1.0, np.ones(len(truth))]
    )
    more = replace(problem, node_features=padded)
    unfitted = AssociativeMarkovNetwork(edge_features=("constant",))
    network = unfitted.fit([problem], [truth])
    again = unfitted.fit([more], [truth])
    np.testing.assert_array_equal(again.node_weights, network.node_weights)
    np.testing.assert_array_equal(again.infer(more).labels, network.infer(problem).labels)


def test_renaming_labels_renames_the_answer() -> None:
    problem, truth = sample(seed=11, n_labels=2)
    assert problem.unary is not None
    swapped = replace(problem, label_names=NAMES[1::-1], unary=problem.unary[:, ::-1])
    network = AssociativeMarkovNetwork(learning_tolerance=1e-4)
    found = network.fit([problem], [truth]).infer(problem)
    other = network.fit([swapped], [1 - truth]).infer(swapped)
    np.testing.assert_array_equal(1 - other.labels, found.labels)


def test_weighting_classes_keeps_the_rare_one() -> None:
    rng = np.random.default_rng(3)
    graph = LabelGraph.from_grid(np.ones((10, 20), np.bool_))
    truth = np.isin(np.mgrid[:10, :20][1].ravel(), (9, 10)).astype(np.int64)
    features = (truth + 0.8 * rng.normal(size=200))[:, None]
    problem = LabelingProblem(graph, NAMES[:2], node_features=features)
    recalls = []
    weightings: list[tuple[Any, Any]] = [("hamming", "none"), ("class-weighted", "sqrt")]
    for loss, weight in weightings:
        network = AssociativeMarkovNetwork(
            loss=loss, class_weight=weight, node_features="raw", C=100.0
        )
        labels = network.fit([problem], [truth]).infer(problem).labels
        recalls.append((labels[truth == 1] == 1).mean())
    assert recalls[1] > recalls[0] + 0.2


def test_losses_have_mean_one_and_the_stated_ratio() -> None:
    truth = np.repeat([0, 1], [90, 10]).astype(np.int64)
    ratios: dict[Any, float] = {"none": 1, "cube-root": 9 ** (1 / 3), "sqrt": 3, "inverse": 9}
    for weight, ratio in ratios.items():
        losses = node_losses(truth, NAMES[:2], weight)
        assert losses.mean() == pytest.approx(1.0)
        assert losses[-1] / losses[0] == pytest.approx(ratio)


# ---------------------------------------------------------------- stopping


def test_progress_is_reported_and_learning_can_be_stopped() -> None:
    problem, truth = sample(seed=12)
    seen: list[LearningStep] = []

    def stop_at_four(step: LearningStep) -> bool:
        seen.append(step)
        return step.iteration >= 4

    network = AssociativeMarkovNetwork(learner="cutting-plane", C=100.0)
    network = network.fit([problem], [truth], on_iteration=stop_at_four)
    assert [step.iteration for step in seen] == [1, 2, 3, 4]
    assert network.summary["status"] == "stopped"
    assert network.learning_history is not None
    assert network.learning_history.shape == (4, 4)
    assert len(network.infer(problem).labels) == len(truth)


def test_a_time_limit_gives_the_best_so_far() -> None:
    problem, truth = sample(seed=13)
    network = AssociativeMarkovNetwork(time_limit_s=1e-9, learning_tolerance=1e-9, C=100.0)
    with pytest.warns(LearningWarning, match=r"the certified gap of learning is \d+ % of the obj"):
        fitted = network.fit([problem], [truth])
    assert fitted.summary["status"] == "time_limit"
    assert fitted.summary["lower_bound"] <= fitted.summary["certified_objective"]


# ---------------------------------------------------------------- the choice of C


def test_c_is_chosen_on_held_out_blocks() -> None:
    graph = LabelGraph.from_grid(np.ones((6, 40), np.bool_))
    rng = np.random.default_rng(4)
    truth = ((np.mgrid[:6, :40][1] // 4) % 2).ravel().astype(np.int64)
    features = np.column_stack([truth + 0.7 * rng.normal(size=240), rng.normal(size=(240, 3))])
    problem = LabelingProblem(graph, NAMES[:2], node_features=features)
    network = AssociativeMarkovNetwork(C=(1e-4, 10.0), node_features="raw").fit([problem], [truth])
    assert network.summary["penalty"] == 10.0
    assert network.penalty_search is not None
    assert network.penalty_search[:, 2].tolist() == [1e-4, 10.0]
    assert network.penalty_search[1, 4] > network.penalty_search[0, 4]
    listed = network.summary["held_out"]
    assert [(row["penalty"], row["chosen"]) for row in listed] == [(1e-4, False), (10.0, True)]
    direct = AssociativeMarkovNetwork(C=10.0, node_features="raw").fit([problem], [truth])
    np.testing.assert_array_equal(network.node_weights, direct.node_weights)


def test_nothing_is_tried_beyond_a_c_that_labels_all_held_out_parts_right() -> None:
    graph = LabelGraph.from_grid(np.ones((4, 16), np.bool_))
    truth = ((np.mgrid[:4, :16][1] // 2) % 2).ravel().astype(np.int64)
    problem = LabelingProblem(graph, NAMES[:2], node_features=np.eye(2)[truth])
    network = AssociativeMarkovNetwork(C=(100.0, 10.0, 30.0), node_features="raw")
    fitted = network.fit([problem], [truth])
    assert fitted.penalty_search is not None
    assert fitted.penalty_search[:, [2, 4]].tolist() == [[30.0, 1.0]]  # one below the usual 100
    assert fitted.summary["penalty"] == 30.0


def test_auto_tries_the_listed_penalties() -> None:
    problem, _ = sample(6, 24, seed=14, n_labels=2)
    truth = ((np.mgrid[:6, :24][1] // 2) % 2).ravel().astype(np.int64)
    network = AssociativeMarkovNetwork(C="auto").fit([problem], [truth])
    assert network.penalty_search is not None
    assert network.summary["penalty"] in network.penalty_search[:, 2]
    assert AssociativeMarkovNetwork().C == "auto"


def on_map(problem: LabelingProblem) -> LabelingProblem:
    """The problem on a map of free cells, whose graph is the problem's."""
    height, width = problem.graph.grid_layout.shape
    free = OccupancyGrid(np.zeros((height, width), np.int8), resolution_m=0.2)
    return replace(problem, graph=LabelGraph.from_grid(free))


@pytest.mark.parametrize(("of_map", "penalty"), [(False, 100.0), (True, 10.0)])
def test_without_a_block_that_can_be_held_out_c_is_the_usual(of_map: bool, penalty: float) -> None:
    problem, truth = sample(seed=15)
    network = AssociativeMarkovNetwork(n_validation_blocks=3)
    fitted = network.fit([on_map(problem) if of_map else problem], [truth])
    assert fitted.summary["penalty"] == penalty
    assert {row["balanced_accuracy"] for row in fitted.summary["held_out"]} == {None}


def with_noise(n_noise: int, looks: float) -> tuple[LabelingProblem, NDArray[np.int64]]:
    """Stripes with scores that say much, features that say something, and noise."""
    rng = np.random.default_rng(5)
    graph = LabelGraph.from_grid(np.ones((6, 40), np.bool_))
    truth = ((np.mgrid[:6, :40][1] // 4) % 2).ravel().astype(np.int64)
    scores = np.column_stack([np.where(truth, -1.0, 1.0) + rng.normal(size=240), np.zeros(240)])
    features = np.column_stack([looks * truth, np.zeros((240, n_noise))])
    features = features + rng.normal(size=features.shape)
    return LabelingProblem(graph, NAMES[:2], unary=scores, node_features=features), truth


def test_features_join_the_scores_only_where_they_help() -> None:
    noise, truth = with_noise(60, 0.0)
    network = AssociativeMarkovNetwork(edge_features="constant").fit([noise], [truth])
    assert network.summary["node_features"] == "logz"
    network = AssociativeMarkovNetwork(edge_features="constant").fit([on_map(noise)], [truth])
    assert network.summary["node_features"] == "offset+logz"
    clear, truth = with_noise(0, 6.0)
    clear = on_map(clear)
    network = AssociativeMarkovNetwork(edge_features="constant").fit([clear], [truth])
    assert network.summary["node_features"] == "offset+logz+raw"
    names = {row["node_features"] for row in network.summary["held_out"]}
    assert names == {"offset+logz", "offset+logz+raw"}
    arrays: dict[str, Any] = dict(learned_arrays(network))
    again = replace(AssociativeMarkovNetwork(edge_features="constant"), **arrays)
    np.testing.assert_array_equal(again.infer(clear).labels, network.infer(clear).labels)


def test_an_offset_is_the_classifier_until_something_is_learned() -> None:
    problem, truth = sample(6, 20, seed=21)
    assert problem.unary is not None
    network = AssociativeMarkovNetwork(C=1e-6, node_features="offset+logz")
    found = network.fit([problem], [truth]).infer(problem).labels
    np.testing.assert_array_equal(found, problem.unary.argmax(axis=1))
    learned = replace(network, C=100.0).fit([problem], [truth])
    assert (learned.infer(problem).labels == truth).mean() > (found == truth).mean()


def test_an_offset_is_what_a_column_with_weights_of_one_would_be() -> None:
    problem, truth = sample(5, 8, seed=22)
    network = AssociativeMarkovNetwork(C=20.0, node_features="offset+raw", scale="none")
    fitted = network.fit([problem], [truth])
    arrays = dict(learned_arrays(fitted))
    node_weights, k = arrays["node_weights"], problem.n_labels
    assert problem.unary is not None
    columns = np.concatenate([problem.node_features, np.maximum(problem.unary, -15.0)], axis=1)
    beside = replace(problem, unary=None, node_features=columns)
    ones = np.concatenate([node_weights[:-1], np.eye(k), node_weights[-1:]])
    d = columns.shape[1]
    changed: dict[str, Any] = {
        **arrays,
        "node_weights": ones,
        "feature_columns": np.arange(d),
        "feature_mean": np.zeros(d),
        "feature_scale": np.ones(d),
        "n_features": np.array([d]),
        "node_choice": np.array([0]),
    }
    same = replace(AssociativeMarkovNetwork(node_features="raw", scale="none"), **changed)
    mine, other = fitted.potentials(problem), same.potentials(beside)
    np.testing.assert_allclose(mine.unary, other.unary, rtol=1e-9, atol=1e-9)


def test_beside_an_offset_labels_earn_alike() -> None:
    problem, truth = sample(6, 20, seed=21)
    network = AssociativeMarkovNetwork(C=100.0, node_features="offset+logz")
    fitted = network.fit([problem], [truth])
    weights = fitted.edge_weights
    assert weights is not None
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
    problem = on_map(LabelingProblem(graph, NAMES[:2], unary))
    network = AssociativeMarkovNetwork().fit([problem], [truth])
    assert network.summary["node_features"] == "offset+logz"
    alone = (unary.argmax(axis=1) == truth).mean()
    [chosen] = [row for row in network.summary["held_out"] if row["chosen"]]
    assert chosen["accuracy"] >= alone - 0.001


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"unlabelled": "hidden"}, "an offset cannot be combined"),
    ],
)
def test_where_there_is_no_offset(options: dict[str, Any], message: str) -> None:
    problem, truth = sample(5, 8, seed=22)
    truth = np.where(np.arange(len(truth)) % 3 == 0, -1, truth)
    network = AssociativeMarkovNetwork(C=10.0, node_features="offset+logz", **options)
    with pytest.raises(InputError, match=message):
        network.fit([problem], [truth])


def test_fields_know_no_offset() -> None:
    with pytest.raises(ConfigError, match="unknown part 'offset'"):
        build("crf", node_features="offset+logz")


def test_several_problems_are_held_out_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    examples = [with_noise(1, 1.0) for _ in range(3)]
    seen: list[NDArray[np.int64]] = []
    plain = choose

    def noted(
        labels: Any, asked: Any, parts: NDArray[np.int64], *rest: Any, steps: NDArray[np.bool_]
    ) -> Any:
        seen.append(parts)
        return plain(labels, asked, parts, *rest, steps=steps)

    monkeypatch.setattr(module, "choose", noted)
    AssociativeMarkovNetwork().fit([p for p, _ in examples], [t for _, t in examples])
    assert seen[0].tolist() == [0] * 240 + [1] * 240 + [2] * 240


def test_the_learner_follows_the_size_and_the_record_says_why(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem, truth = sample(6, 8, seed=4)
    small = AssociativeMarkovNetwork(C=5.0).fit([problem], [truth]).summary
    assert (small["learner"], small["reason"]) == ("qp", REASONS[1])
    monkeypatch.setattr("pgm_places.solvers.max_margin_qp.QUICK_ENTRIES", 10)
    large = AssociativeMarkovNetwork(C=5.0).fit([problem], [truth]).summary
    assert (large["learner"], large["reason"]) == ("cutting-plane", REASONS[2])
    asked = AssociativeMarkovNetwork(C=5.0, learner="qp").fit([problem], [truth]).summary
    assert (asked["learner"], asked["reason"]) == ("qp", REASONS[0])


def test_weights_by_name_and_costs_of_confusion() -> None:
    problem, truth = sample(6, 8, seed=4)
    network = AssociativeMarkovNetwork(class_weight={NAMES[1]: 4.0})
    losses = network.learning_problem([problem], [truth]).loss
    np.testing.assert_allclose(losses / losses[truth == 0][0], np.where(truth == 1, 4.0, 1.0))
    with pytest.raises(InputError, match="class_weight has a weight for 'hall', which is no label"):
        AssociativeMarkovNetwork(class_weight={"hall": 4.0}).fit([problem], [truth])
    table = [[0, 1, 2], [1, 0, 1], [4, 1, 0]]
    costly = AssociativeMarkovNetwork(loss=table)  # type: ignore[arg-type]
    task = costly.learning_problem([problem], [truth])
    np.testing.assert_allclose(task.node_costs(3), np.array(table)[truth] * 6 / 10)
    plain = AssociativeMarkovNetwork(loss="hamming").learning_problem([problem], [truth])
    ones = AssociativeMarkovNetwork(loss=(1.0 - np.eye(3)).tolist()).learning_problem(
        [problem], [truth]
    )
    np.testing.assert_array_equal(ones.node_costs(3), plain.node_costs(3))
    with pytest.raises(InputError, match="0 on the diagonal"):
        AssociativeMarkovNetwork(loss=((1.0, 1.0), (1.0, 0.0)))
    with pytest.raises(InputError, match=r"shape \(3, 3\)"):
        AssociativeMarkovNetwork(loss=((0.0, 1.0), (1.0, 0.0))).fit([problem], [truth])


# ---------------------------------------------------------------- storing


def test_learned_arrays_bring_the_network_back() -> None:
    problem, truth = sample(seed=16)
    network = AssociativeMarkovNetwork(
        C=(10.0, 50.0), n_validation_blocks=6, certify_learning=False
    )
    truth = ((np.mgrid[:8, :12][1] // 2) % 3).ravel().astype(np.int64)
    fitted = network.fit([problem], [truth])
    arrays = learned_arrays(fitted)
    assert len(arrays) == 12
    assert all(np.isfinite(array).all() for array in arrays.values())
    again = replace(AssociativeMarkovNetwork(), **arrays)  # type: ignore[arg-type]
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
    problem, truth = sample(seed=17)
    network = AssociativeMarkovNetwork(node_features="logz+raw").fit([problem], [truth])
    with pytest.raises((InputError, NotFittedError), match=message):
        replace(network, **{name: value})


# ---------------------------------------------------------------- refusals


def test_a_label_without_examples_is_named() -> None:
    problem, truth = sample(seed=18)
    with pytest.raises(LabelError, match="no training map has a node labelled 'doorway'"):
        AssociativeMarkovNetwork().fit([problem], [np.minimum(truth, 1)])


def test_other_features_than_in_training_are_refused() -> None:
    problem, truth = sample(seed=19)
    assert problem.node_features is not None
    network = AssociativeMarkovNetwork(node_features="logz+raw").fit([problem], [truth])
    fewer = replace(problem, node_features=problem.node_features[:, :1])
    with pytest.raises(InputError, match="trained on 5 node features, this problem has 4"):
        network.infer(fewer)
    two = LabelingProblem(problem.graph, NAMES[:2], node_features=np.zeros((96, 5)))
    with pytest.raises(InputError, match="trained on 3 labels, this problem has 2"):
        network.infer(two)
    given = AssociativeMarkovNetwork(edge_features=("given",))
    one = replace(problem, edge_features=np.ones((problem.graph.n_edges, 1)))
    both = replace(problem, edge_features=np.ones((problem.graph.n_edges, 2)))
    with pytest.raises(InputError, match="trained on 1 edge features, this problem has 2"):
        given.fit([one], [truth]).infer(both)
    with pytest.raises(InputError, match="same number of node features"):
        AssociativeMarkovNetwork().fit([problem, fewer], [truth, truth])


def test_maps_and_labelings_must_belong_together() -> None:
    problem, truth = sample(seed=20)
    network = AssociativeMarkovNetwork()
    with pytest.raises(InputError, match="got 1 problems and 0 labelings"):
        network.fit([problem], [])
    with pytest.raises(InputError, match=r"labelings\[0\] must have shape \(96,\)"):
        network.fit([problem], [truth[:-1]])
    with pytest.raises(InputError, match="no node of any training problem has a label"):
        network.fit([problem], [np.full(96, -1)])
    other = replace(problem, label_names=("a", "b", "c"))
    with pytest.raises(InputError, match="problems have different labels"):
        network.fit([problem, other], [truth, truth])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"learner": "cutting-plan"},
            "learner must be 'auto', 'cutting-plane' or 'qp'",
        ),
        ({"loss": "zero-one"}, "loss must be 'class-weighted' or 'hamming' or a list of"),
        ({"node_features": "logs"}, "Did you mean 'logz'"),
        ({"edge_features": ()}, "edge_features must be one or more parts"),
        ({"C": 0.0}, "C must be a number above 0, 'auto', or a non-empty list of numbers above 0"),
        ({"C": []}, "C must be a number above 0"),
        ({"learning_tolerance": 1.5}, "learning_tolerance must be a number above 0 and below 1"),
    ],
)
def test_options_are_checked(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message.replace(".", r"\.")):
        AssociativeMarkovNetwork(**options)


def test_a_weight_of_two_is_the_same_map_twice() -> None:
    problem, truth = sample(6, 6)
    assert problem.unary is not None
    turns = (0, 7, 19)  # of one map's scores, so that they are scaled alike however often each is
    problems = [
        LabelingProblem(problem.graph, NAMES, np.roll(problem.unary, n, axis=0)) for n in turns
    ]
    truths = [np.roll(truth, 2 * n) for n in turns]
    network = AssociativeMarkovNetwork(C=10.0, loss="hamming", learning_tolerance=1e-6)
    twice = network.fit([*problems, problems[1]], [*truths, truths[1]]).potentials(problems[0])
    heavy = network.fit(problems, truths, sample_weight=[1.0, 2.0, 1.0]).potentials(problems[0])
    plain = network.fit(problems, truths).potentials(problems[0])
    np.testing.assert_allclose(heavy.unary, twice.unary, atol=0.02)
    assert np.abs(heavy.unary - plain.unary).max() > 0.1


def test_learning_goes_on_from_weights_that_are_known() -> None:
    examples = [sample(8, 8, seed=seed, n_labels=2) for seed in range(4)]
    problems, truths = [p for p, _ in examples], [t for _, t in examples]
    before = AssociativeMarkovNetwork(warm_start=True).fit(problems[:3], truths[:3])
    warm = before.fit(problems, truths)
    # the same problem from nothing: with the scaling that was learned before
    cold = replace(before, warm_start=False).fit(problems[:3], truths[:3])
    assert before.fit(problems[:3], truths[:3]).summary["iterations"] < cold.summary["iterations"]
    assert warm.summary["certified_gap"] <= 1e-3
    np.testing.assert_array_equal(warm.feature_mean, before.feature_mean)
    hidden = [np.where(np.arange(64) % 9 == 0, -1, truth) for truth in truths]
    with pytest.raises(InputError, match="warm_start cannot be combined"):
        replace(before, unlabelled="hidden").fit(problems, hidden)
    with pytest.raises(InputError, match="warm_start needs learner='cutting-plane', got 'qp'"):
        replace(before, learner="qp").fit(problems, truths)
    other = replace(problems[0], edge_features=np.ones((problems[0].graph.n_edges, 1)))
    with pytest.raises(InputError, match="needs problems with the model's labels and features"):
        before.fit([other], truths[:1])


def test_costs_follow_their_labels_whatever_the_order_inside() -> None:
    problem, truth = sample(6, 9, seed=4)
    truth = np.where(truth == 0, 2, truth)  # the last label is the most frequent
    truth[:3] = 0
    table = ((0.0, 1.0, 2.0), (1.0, 0.0, 1.0), (4.0, 1.0, 0.0))
    network = AssociativeMarkovNetwork(loss=table, C=5.0, learner="cutting-plane")
    first = network.fit([problem], [truth])
    assert first.loss == table
    turn = np.array([2, 0, 1])
    assert problem.unary is not None
    turned = replace(
        problem, label_names=[NAMES[k] for k in turn], unary=np.asarray(problem.unary)[:, turn]
    )
    again = replace(network, loss=tuple(tuple(table[i][j] for j in turn) for i in turn))
    second = again.fit([turned], [np.argsort(turn)[truth]])
    assert second.summary["objective"] == pytest.approx(first.summary["objective"], rel=1e-9)


def test_nothing_left_to_learn_is_no_gap(recwarn: pytest.WarningsRecorder) -> None:
    graph = LabelGraph.from_grid(np.ones((1, 40), np.bool_))
    truth = (np.arange(40) >= 30).astype(np.int64)
    sure = LabelingProblem(graph, NAMES[:2], np.log(np.where(np.eye(2)[truth], 0.99, 0.01)))
    sure = on_map(sure)
    fitted = AssociativeMarkovNetwork().fit([sure], [truth])
    assert fitted.summary["objective"] < 1e-3
    np.testing.assert_array_equal(fitted.infer(sure).labels, truth)
    assert not recwarn.list
