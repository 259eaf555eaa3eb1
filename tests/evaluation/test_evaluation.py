import json
import warnings
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pgm_places.errors import InputError, LabelError
from pgm_places.evaluation.bootstrap import block_bootstrap, square_blocks
from pgm_places.evaluation.evaluation import Evaluation, evaluate
from tests.refusals import refused

NAMES = ["room", "corridor", "doorway", "kitchen"]


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 60), st.integers(1, 4))
def test_every_figure_is_scikit_learns(seed: int, n: int, k: int) -> None:
    from sklearn import metrics

    rng = np.random.default_rng(seed)
    truth = rng.integers(0, k, n)
    predicted = np.where(rng.random(n) < 0.5, truth, rng.integers(0, k, n))
    result = evaluate(truth, predicted, NAMES[:k])
    labels = list(range(k))
    close: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-12}
    np.testing.assert_allclose(result.accuracy, metrics.accuracy_score(truth, predicted), **close)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about labels that occur on one side only
        balanced = metrics.balanced_accuracy_score(truth, predicted)
        mcc = metrics.matthews_corrcoef(truth, predicted)
        confusion = metrics.confusion_matrix(truth, predicted, labels=labels)
    np.testing.assert_array_equal(result.confusion, confusion)
    np.testing.assert_allclose(result.balanced_accuracy, balanced, **close)
    np.testing.assert_allclose(result.mcc, mcc, **close)
    np.testing.assert_allclose(
        result.macro_f1, metrics.f1_score(truth, predicted, average="macro"), **close
    )
    by_label = metrics.precision_recall_fscore_support(
        truth, predicted, labels=labels, zero_division=np.nan
    )
    for ours, theirs in zip((result.precision, result.recall, result.f1), by_label, strict=False):
        got = [np.nan if value is None else value for value in ours.values()]
        np.testing.assert_allclose(got, theirs, equal_nan=True, **close)
    iou = metrics.jaccard_score(truth, predicted, labels=labels, average=None, zero_division=0)
    np.testing.assert_allclose([value or 0.0 for value in result.iou.values()], iou, **close)


def test_absent_labels_are_none_and_left_out_of_means() -> None:
    result = evaluate([0, 0, 1], [0, 2, 1], NAMES)
    assert result.recall == {"room": 0.5, "corridor": 1.0, "doorway": None, "kitchen": None}
    assert result.precision == {"room": 1.0, "corridor": 1.0, "doorway": 0.0, "kitchen": None}
    assert result.f1["doorway"] == 0.0
    assert result.f1["kitchen"] is None
    assert result.iou["kitchen"] is None
    assert result.balanced_accuracy == 0.75


def test_nodes_without_truth_do_not_count_whatever_was_predicted() -> None:
    result = evaluate([0, -1, 1, -1], [0, 7, 1, -1], ["a", "b"])
    assert (result.n, result.accuracy) == (2, 1.0)


def test_to_dict_survives_json() -> None:
    rng = np.random.default_rng(3)
    beliefs = rng.dirichlet(np.ones(4), 30)
    result = evaluate(rng.integers(-1, 3, 30), beliefs.argmax(1), NAMES, beliefs=beliefs)
    again = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert again["recall"]["kitchen"] is None
    assert {"accuracy", "balanced_accuracy", "macro_f1", "precision", "f1", "iou", "mcc"} <= set(
        again
    )
    assert again["confusion"] == result.confusion.tolist()


def test_reliability_counts_by_hand() -> None:
    beliefs = [[0.95, 0.05], [0.85, 0.15], [1.0, 0.0], [0.45, 0.55]]
    result = evaluate([0, 1, 0, 1], [0, 0, 0, 1], ["a", "b"], beliefs=beliefs)
    table = result.reliability
    assert table is not None
    assert table.count.tolist() == [0, 0, 0, 0, 0, 1, 0, 0, 1, 2]
    np.testing.assert_allclose(table.mean_confidence[[5, 8, 9]], [0.55, 0.85, 0.975], rtol=1e-12)
    np.testing.assert_array_equal(table.accuracy[[5, 8, 9]], [1.0, 0.0, 1.0])
    expected = (0.45 + 0.85 + 0.05) / 4
    assert result.expected_calibration_error == pytest.approx(expected, rel=1e-12)


def test_merged_is_the_evaluation_of_everything_together() -> None:
    rng = np.random.default_rng(7)
    beliefs = rng.dirichlet(np.ones(3), 90)
    truth, predicted = rng.integers(-1, 3, 90), beliefs.argmax(1)
    parts = [
        evaluate(truth[s], predicted[s], NAMES[:3], beliefs=beliefs[s])
        for s in (slice(0, 20), slice(20, 50), slice(50, 90))
    ]
    whole = evaluate(truth, predicted, NAMES[:3], beliefs=beliefs)
    merged = Evaluation.merged(parts)
    np.testing.assert_array_equal(merged.confusion, whole.confusion)
    assert merged.expected_calibration_error == pytest.approx(whole.expected_calibration_error)
    without = evaluate(truth, predicted, NAMES[:3])
    assert Evaluation.merged([without, whole]).reliability is None


def test_merging_other_labels_is_refused() -> None:
    first, second = evaluate([0], [0], ["a", "b"]), evaluate([0], [0], ["a", "c"])
    refused(LabelError, "different labels", Evaluation.merged, [first, second])
    refused(InputError, "at least one", Evaluation.merged, [])


@pytest.mark.parametrize(
    ("truth", "predicted", "message"),
    [
        ([-1, -1], [0, 0], "no node has a true label"),
        ([0, 1], [0], "shape of truth"),
        ([0, 2], [0, 0], "truth must hold integers"),
        ([0, 1], [0, -1], "predicted must hold integers"),
        ([0.0, 1.0], [0, 1], "truth must hold integers"),
    ],
)
def test_bad_input(truth: list[int], predicted: list[int], message: str) -> None:
    refused(InputError, message, evaluate, truth, predicted, ["a", "b"])


# ---------------------------------------------------------------------- bootstrap


def test_bootstrap_of_single_nodes_is_the_binomial_interval() -> None:
    rng = np.random.default_rng(2)
    truth = np.zeros(400, np.int64)
    predicted = (rng.random(400) < 0.2).astype(np.int64)
    interval = block_bootstrap(
        truth, predicted, np.arange(400), n_labels=2, n_resamples=4000, seed=1
    )["accuracy"]
    share = float((predicted == 0).mean())
    half = 1.96 * np.sqrt(share * (1 - share) / 400)
    assert interval.estimate == share
    np.testing.assert_allclose(
        [interval.low, interval.high], [share - half, share + half], atol=5e-3
    )


def test_blocks_that_err_together_widen_the_interval() -> None:
    rng = np.random.default_rng(4)
    blocks = np.repeat(np.arange(20), 50)
    truth = np.zeros(1000, np.int64)
    predicted = (rng.random(20) < 0.3).astype(np.int64)[blocks]
    single = block_bootstrap(truth, predicted, np.arange(1000), n_labels=2)["accuracy"]
    joint = block_bootstrap(truth, predicted, blocks, n_labels=2)["accuracy"]
    assert joint.high - joint.low > 3 * (single.high - single.low)


def test_bootstrap_agrees_with_evaluate_and_repeats() -> None:
    rng = np.random.default_rng(6)
    truth, predicted = rng.integers(-1, 3, 200), rng.integers(0, 3, 200)
    cells = np.stack([np.arange(200) // 20, np.arange(200) % 20], axis=1)
    blocks = square_blocks(cells, 5)
    assert len(np.unique(blocks)) == 8
    first = block_bootstrap(truth, predicted, blocks, n_labels=3, seed=9)
    assert first == block_bootstrap(truth, predicted, blocks, n_labels=3, seed=9)
    assert first != block_bootstrap(truth, predicted, blocks, n_labels=3, seed=8)
    likelier = block_bootstrap(truth, predicted, blocks, n_labels=3, seed=9, confidence=0.5)
    assert first["accuracy"].low < likelier["accuracy"].low
    assert likelier["accuracy"].high < first["accuracy"].high
    whole = evaluate(truth, predicted, NAMES[:3])
    assert first["balanced_accuracy"].estimate == pytest.approx(whole.balanced_accuracy)
    assert first["accuracy"].low <= whole.accuracy <= first["accuracy"].high


def test_bootstrap_checks_its_input() -> None:
    refused(InputError, "confidence", block_bootstrap, [0], [0], [0], n_labels=1, confidence=1.0)
    refused(InputError, "no node", block_bootstrap, [-1], [0], [0], n_labels=1)
    refused(InputError, "square_blocks", square_blocks, np.zeros((3, 3), int), 2)
