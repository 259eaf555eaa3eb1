"""Sparse node features: the same as the dense ones that they stand for, and never made dense."""

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.typing import NDArray

from pgm_places import LabelGraph, LabelingProblem, StructuredLabeler, build
from pgm_places._checks import feature_rows, is_sparse
from pgm_places.errors import InputError
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.models.feature_scaling import CLIP, Standardization
from pgm_places.models.linear_features import edge_features
from pgm_places.solvers.adjacency import adjacency
from pgm_places.solvers.cutting_plane import cutting_plane
from pgm_places.solvers.max_margin import MaxMarginProblem, joined
from pgm_places.solvers.max_margin_qp import max_margin_qp
from pgm_places.solvers.max_oracle import problem_oracle
from pgm_places.solvers.table_field import TableField, beside
from tests.refusals import refused

Example = tuple[LabelingProblem, NDArray[np.int64]]
N_WORDS = 60


def sentence(seed: int, *, sparse: bool = True) -> Example:
    """A chain of 80 steps in runs of a label; words of the label's own third are likelier."""
    rng = np.random.default_rng(seed)
    truth = np.repeat(rng.permutation(np.arange(8) % 2), 10)
    words = np.where(rng.random(80) < 0.6, truth, 2) * 20 + rng.integers(0, 20, 80)
    rows = sp.csr_array((np.ones(80), (np.arange(80), words)), shape=(80, N_WORDS))
    looks: Any = rows if sparse else rows.toarray()
    return LabelingProblem(LabelGraph.from_lattice((80,)), ["a", "b"], node_features=looks), truth


def some_rows(seed: int = 0, n: int = 12, d: int = 5) -> Any:
    rng = np.random.default_rng(seed)
    return sp.csr_array(rng.random((n, d)) * (rng.random((n, d)) < 0.4))


def test_problems_keep_sparse_rows_as_they_are() -> None:
    given = some_rows().tocoo()
    problem: Any = LabelingProblem(LabelGraph.from_lattice((12,)), ["a", "b"], node_features=given)
    assert is_sparse(problem.node_features)
    part: Any = problem.subproblem(np.arange(12) % 2 == 0)
    assert is_sparse(part.node_features)
    np.testing.assert_array_equal(part.node_features.toarray(), given.toarray()[::2])
    assert "node_features (12, 5)" in repr(problem)
    given.data[:] = 7.0
    assert problem.node_features.max() < 7.0
    assert feature_rows("x", problem.node_features, 12) is problem.node_features  # frozen already


def test_rows_that_do_not_fit_are_refused() -> None:
    with pytest.raises(InputError, match=r"node_features must have shape \(3, D\), got \(12, 5\)"):
        LabelingProblem(LabelGraph.from_lattice((3,)), ["a"], node_features=some_rows())
    broken = some_rows()
    broken.data[3] = np.nan
    with pytest.raises(InputError, match="the values of node_features must hold finite numbers"):
        LabelingProblem(LabelGraph.from_lattice((12,)), ["a"], node_features=broken)


def test_columns_are_scaled_and_clipped_without_their_mean() -> None:
    dense = np.vstack([some_rows(n=40).toarray(), 50 * np.eye(5)])
    dense[:, 2] = 0.0  # constant: dropped
    rows: Any = sp.csr_array(dense)
    scaling = Standardization.of(rows, "deviation")
    assert scaling.columns.tolist() == [0, 1, 3, 4]
    found: Any = scaling.apply(rows)
    assert is_sparse(found)
    wanted = np.clip((dense / np.where(dense.std(axis=0) > 0, dense.std(axis=0), 1.0)), -CLIP, CLIP)
    wanted = np.column_stack([wanted[:, [0, 1, 3, 4]], np.ones(len(dense))])
    np.testing.assert_allclose(found.toarray(), wanted)
    np.testing.assert_allclose(scaling.apply(dense), wanted)
    of_dense = Standardization.of(dense)
    refused(
        InputError, "trained on dense node features, whose means it subtracts", of_dense.apply, rows
    )


def test_likeness_of_sparse_ends_is_that_of_dense_ones() -> None:
    (problem, _), (dense, _) = sentence(1), sentence(1, sparse=False)
    np.testing.assert_allclose(
        edge_features(problem, ["raw-difference"]), edge_features(dense, ["raw-difference"])
    )


def margin_problem(features: Any, seed: int = 0) -> MaxMarginProblem:
    rng = np.random.default_rng(seed)
    edges = np.array([(i, i + 1) for i in range(11)], np.int32)
    labels = rng.integers(0, 3, 12)
    return MaxMarginProblem(features, edges, np.ones((11, 1)), labels, 3, np.ones(12), 20.0)


def test_max_margin_finds_the_same_weights() -> None:
    rows = some_rows(3)
    solutions = []
    for features in (rows, rows.toarray()):
        whole = joined([margin_problem(features), margin_problem(features, 1)])
        solutions.append(cutting_plane(whole, problem_oracle(whole), tolerance=1e-6))
    sparse, dense = solutions
    np.testing.assert_allclose(sparse.weights, dense.weights, atol=1e-9)
    assert sparse.objective == pytest.approx(dense.objective)
    with pytest.raises(InputError, match="needs dense node_features, got sparse"):
        max_margin_qp(margin_problem(rows))


@pytest.mark.parametrize("symmetric", [True, False])
def test_fields_of_tables_compute_the_same(symmetric: bool) -> None:
    rows = some_rows(4)
    around = adjacency(12, [(i, i + 1) for i in range(11)])
    sparse, dense = (
        beside([TableField(x, around, np.ones((11, 1)), 3, symmetric)] * 2)
        for x in (rows, rows.toarray())
    )
    rng = np.random.default_rng(0)
    weights, labels = rng.normal(size=sparse.n_weights), rng.integers(0, 3, 24)
    beliefs, pairs = rng.random((24, 3)), rng.random((22, 3, 3))
    np.testing.assert_allclose(sparse.potentials(weights)[0], dense.potentials(weights)[0])
    np.testing.assert_allclose(sparse.features_of(labels), dense.features_of(labels))
    np.testing.assert_allclose(
        sparse.expected_features(beliefs, pairs), dense.expected_features(beliefs, pairs)
    )


@pytest.mark.parametrize(
    ("method", "options"),
    [
        ("amn", {"edge_features": ("constant",)}),
        ("amn", {"C": (1.0, 100.0)}),
        ("crf", {"learner": "max-margin"}),
        ("crf", {"learner": "likelihood"}),
    ],
)
def test_methods_learn_from_sparse_features(
    method: str, options: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    problems, truths = zip(*map(sentence, range(2, 8)), strict=True)
    with monkeypatch.context() as patched:
        patched.setattr(sp.csr_array, "toarray", _refused)
        learned = build(method, options).fit(problems[1:], truths[1:])
        labels = learned.infer(problems[0]).labels
    assert (labels == truths[0]).mean() > 0.85
    dense, _ = sentence(2, sparse=False)  # a model of sparse features takes dense ones, too
    np.testing.assert_array_equal(learned.infer(dense).labels, labels)


_TO_DENSE = sp.csr_array.toarray


def _refused(rows: Any) -> Any:
    if max(rows.shape) >= 80:  # not the sums over nodes
        raise AssertionError("the features were made dense")
    return _TO_DENSE(rows)


def test_labels_and_weights_work_beside_sparse_features() -> None:
    problems, truths = zip(*map(sentence, range(2)), strict=True)
    hidden = [np.where(np.arange(80) % 3 == 0, -1, truth) for truth in truths]
    for method in ("amn", "crf"):
        options = {"unlabelled": "hidden", "learning_tolerance": 0.05}
        learned = build(method, options).fit(problems, hidden)
        assert (learned.infer(problems[0]).labels == truths[0]).mean() > 0.85
    weighed = build("amn").fit(problems, truths, sample_weight=[1.0, 2.0])
    assert is_sparse(problems[0].node_features)
    assert (weighed.infer(problems[0]).labels == truths[0]).mean() > 0.85


def test_a_classifier_in_front_takes_them() -> None:
    from sklearn.linear_model import LogisticRegression

    problems, truths = zip(*map(sentence, range(3)), strict=True)
    labeler = StructuredLabeler("potts", LogisticRegression()).fit(problems, truths)
    assert labeler.score(problems, truths) > 0.85
    with pytest.raises(TypeError, match=r"Sparse data was passed .* Use '.toarray\(\)'"):
        StructuredLabeler("potts", DecisionListClassifier()).fit(problems, truths)
