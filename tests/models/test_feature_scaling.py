"""Features on one scale: what is standardised, what stays, and that units do not matter."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.typing import NDArray

from pgm_places import LabelGraph, LabelingProblem, build
from pgm_places.errors import InputError, LearningWarning
from pgm_places.graph.cliques import Cliques
from pgm_places.models.feature_scaling import CLIP, Standardization, column_sizes

Example = tuple[LabelingProblem, NDArray[np.int64]]
MIXED = np.array([[0.0, 7.0, 3.0], [1.0, 9.0, 0.0], [0.0, 8.0, 0.0], [0.0, 8.0, 4.0]])
"""An indicator, a measurement, and counts that are mostly 0."""


def spot(seed: int, *, unit: float = 1.0, side: int = 12) -> Example:
    """A square of another label on a grid, whose edges say in any unit how alike their ends are."""
    rng = np.random.default_rng(seed)
    truth = np.zeros((side, side), np.int64)
    row, column = rng.integers(0, side // 2, 2)
    truth[row : row + side // 2, column : column + side // 2] = 1
    labels, graph = truth.ravel(), LabelGraph.from_lattice((side, side))
    differ = labels[graph.edges[:, 0]] != labels[graph.edges[:, 1]]
    alike = np.exp(-np.abs(1.5 * differ + 0.3 * rng.normal(size=len(differ))))
    looks = (labels + rng.normal(size=labels.size))[:, None]
    return LabelingProblem(
        graph, ("ground", "spot"), node_features=looks, edge_features=unit * alike[:, None]
    ), labels


def fitted(method: str, examples: list[Example], **options: Any) -> Any:
    problems, truths = zip(*examples, strict=True)
    return build(method, options).fit(problems, truths)


# ---------------------------------------------------------------- columns


def test_indicators_stay_as_they_are_and_measurements_are_standardised() -> None:
    found = Standardization.of(MIXED).apply(MIXED)
    np.testing.assert_array_equal(found[:, 0], MIXED[:, 0])
    np.testing.assert_allclose(found[:, 1:3].mean(axis=0), 0.0, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found[:, 1:3].std(axis=0), 1.0, rtol=1e-12)


def test_sparse_columns_are_divided_by_the_size_of_their_entries() -> None:
    rows: Any = sp.csr_array(MIXED)
    found: Any = Standardization.of(rows).apply(rows)
    np.testing.assert_array_equal(found.toarray()[:, 0], MIXED[:, 0])
    np.testing.assert_allclose(found.toarray()[:, 2], MIXED[:, 2] / np.sqrt(12.5), rtol=1e-12)


@pytest.mark.parametrize("make", [np.asarray, sp.csr_array])
def test_nothing_is_scaled_or_clipped_where_that_is_asked_for(make: Any) -> None:
    rows = make(np.vstack([MIXED, [[0.0, 1e6, -9.0]]]))
    found: Any = Standardization.of(rows, "none").apply(rows)
    dense = found if make is np.asarray else found.toarray()
    np.testing.assert_array_equal(dense[:, :3], np.vstack([MIXED, [[0.0, 1e6, -9.0]]]))


def test_all_is_divided_by_its_deviation_where_that_is_asked_for() -> None:
    found = Standardization.of(MIXED, "deviation").apply(MIXED)
    np.testing.assert_allclose(found[:, :3].std(axis=0), 1.0, rtol=1e-12)


def test_sizes_of_columns_have_the_unit_of_the_column() -> None:
    columns = np.array([[0.0, 0.0, 1.0, 3e200], [0.0, 1.0, -1.0, 4e200]])
    sizes = column_sizes(columns)
    np.testing.assert_allclose(sizes, [1.0, 1.0, 1.0, np.sqrt(12.5) * 1e200], rtol=1e-12)
    np.testing.assert_array_equal(column_sizes(sp.csr_array(columns)), sizes)  # type: ignore[arg-type]
    np.testing.assert_array_equal(column_sizes(np.zeros((0, 2))), [1.0, 1.0])


# ---------------------------------------------------------------- units of edges and cliques


@pytest.mark.filterwarnings("ignore:better weights may exist")
@pytest.mark.parametrize(
    ("method", "options"),
    [("amn", {}), ("crf", {"learner": "piecewise"}), ("crf", {"learner": "max-margin"})],
)
def test_the_unit_of_edge_features_does_not_matter(method: str, options: dict[str, Any]) -> None:
    """The same similarity times 1000 used to end stalled, with other labels."""
    found = []
    for unit in (1.0, 1000.0):
        examples = [spot(seed, unit=unit) for seed in range(3)]
        model = fitted(method, examples[:2], **options)
        found.append((model.infer(examples[2][0]), model.summary))
    (ours, first), (thousand, second) = found
    np.testing.assert_array_equal(thousand.labels, ours.labels)
    assert thousand.score == pytest.approx(ours.score, rel=1e-6)
    assert second["status"] == first["status"] != "stalled"
    assert second["objective"] == pytest.approx(first["objective"], rel=1e-6)


@pytest.mark.filterwarnings("ignore:better weights may exist")
@pytest.mark.parametrize("method", ["amn", "crf"])
def test_the_unit_of_clique_features_does_not_matter(method: str) -> None:
    halves = Cliques.of_segments(np.arange(144) // 72)
    rewards = []
    for unit in (1.0, 1000.0):
        examples = []
        for seed in range(2):
            problem, truth = spot(seed)
            observed = unit * np.array([[1.0], [2.0]])
            examples.append((replace(problem, cliques=halves, clique_features=observed), truth))
        model = fitted(method, examples, learning_tolerance=0.01)
        rewards.append(model.clique_rewards(examples[0][0]))
    np.testing.assert_allclose(rewards[1], rewards[0], rtol=1e-6, atol=1e-12)


def test_problems_with_other_numbers_of_edge_features_are_refused() -> None:
    (first, truth), (second, _) = spot(0), spot(1)
    assert second.edge_features is not None
    wider = replace(second, edge_features=np.hstack([second.edge_features] * 2))
    with pytest.raises(InputError, match=r"same number of edge features, got \[3, 4\]"):
        build("amn").fit([first, wider], [truth, truth])


# ---------------------------------------------------------------- what is said and kept


def test_learning_that_stalls_says_what_to_do() -> None:
    examples = [spot(seed, unit=1e6) for seed in range(2)]
    with pytest.warns(LearningWarning, match=r"learning stalled .* take scale='auto'"):
        found = fitted("amn", examples, learner="cutting-plane", scale="none")
    assert found.summary["status"] == "stalled"
    with pytest.warns(LearningWarning, match=r"learning stalled .* take a smaller C than 1e\+10"):
        fitted("amn", examples, learner="cutting-plane", C=1e10)


def test_a_gap_is_at_most_all_of_the_objective_and_says_what_to_do() -> None:
    """The program's own bound may be far below 0, which no weights are."""
    examples = [spot(seed, unit=1e6) for seed in range(2)]
    with pytest.warns(LearningWarning, match=r"gap of learning is 100 % .* take scale='auto'"):
        found = fitted("amn", examples, learner="qp", scale="none")
    assert found.summary["lower_bound"] == 0
    with pytest.warns(LearningWarning, match=r"take a smaller C, or method 'crf'"):
        fitted("amn", examples, learner="qp", C=1e10)


def test_models_that_know_no_clip_were_clipped() -> None:
    """Those stored by earlier versions."""
    problem, truth = spot(0)
    found = fitted("amn", [(problem, truth)])
    assert found.feature_clip.tolist() == [CLIP]
    earlier = replace(found, feature_clip=None)
    assert problem.node_features is not None
    far = replace(problem, node_features=100 * problem.node_features)
    np.testing.assert_array_equal(earlier.potentials(far).unary, found.potentials(far).unary)
    for clip in ([0.0], [1.0, 2.0]):
        with pytest.raises(InputError, match="feature_clip must hold one positive number"):
            replace(found, feature_clip=np.array(clip))
