import numpy as np
import pytest

from pgm_places import EdgeKind, LabelGraph, LabelingProblem
from pgm_places.errors import ConfigError, InputError
from pgm_places.models.feature_scaling import Standardization
from pgm_places.models.linear_features import (
    LOG_FLOOR,
    edge_feature_count,
    edge_features,
    node_features,
    parse_edge_features,
    parse_node_features,
)
from tests.refusals import refused


def grid_problem(**parts: np.ndarray) -> LabelingProblem:
    graph = LabelGraph.from_grid(np.ones((2, 2), np.bool_))
    z = np.array([[0.9, 0.1], [0.5, 0.5], [1.0, 0.0], [0.2, 0.8]])
    with np.errstate(divide="ignore"):
        given = {"unary": np.log(z), "node_features": np.arange(8.0).reshape(4, 2), **parts}
    return LabelingProblem(graph, ["a", "b"], **given)


def test_parts_are_put_side_by_side() -> None:
    features = node_features(grid_problem(), ("raw", "logz", "z"))
    assert features.shape == (4, 6)
    np.testing.assert_array_equal(features[:, :2], np.arange(8.0).reshape(4, 2))
    np.testing.assert_allclose(features[0, 2:], [np.log(0.9), np.log(0.1), 0.9, 0.1], rtol=1e-12)


@pytest.mark.parametrize(
    ("missing", "n_columns"), [({}, 4), ({"unary": None}, 2), ({"node_features": None}, 2)]
)
def test_auto_takes_what_is_there(missing: dict[str, np.ndarray], n_columns: int) -> None:
    features = node_features(grid_problem(**missing), ("auto",))
    assert features.shape == (4, n_columns)


def test_auto_repeats_nothing() -> None:
    assert node_features(grid_problem(), ("z", "auto")).shape == (4, 6)
    assert node_features(grid_problem(), ("raw", "auto")).shape == (4, 4)


def test_impossible_labels_are_floored() -> None:
    features = node_features(grid_problem(), ("logz",))
    assert features[2, 1] == pytest.approx(LOG_FLOOR)


@pytest.mark.parametrize(
    ("parts", "missing", "message"),
    [
        (("raw",), {"node_features": None}, "needs the problem's node features"),
        (("logz",), {"unary": None}, "'logz' features need the problem's unary"),
    ],
)
def test_missing_inputs_are_named(
    parts: tuple[str, ...], missing: dict[str, np.ndarray], message: str
) -> None:
    refused(InputError, message, node_features, grid_problem(**missing), parts)


def test_names_are_parsed_or_the_nearest_is_offered() -> None:
    assert parse_node_features("logz+raw") == ("logz", "raw")
    assert parse_edge_features("constant+diagonal") == ("constant", "diagonal")
    assert parse_edge_features(["constant"]) == ("constant",)
    refused(ConfigError, r"unknown part 'logx'\. Did you mean 'logz'", parse_node_features, "logx")
    refused(ConfigError, "each once", parse_edge_features, ["constant", "constant"])
    refused(ConfigError, "unknown part ''", parse_edge_features, "")


def test_edge_features_by_hand() -> None:
    problem = grid_problem()
    # edges of a 2 x 2 grid: 0-1, 0-2, 0-3 (diagonal), 1-2 (diagonal), 1-3, 2-3
    names = ("constant", "diagonal", "unary-difference")
    found = edge_features(problem, names)
    assert found.shape == (6, edge_feature_count(problem, names))
    half = np.sqrt(0.5)
    np.testing.assert_allclose(found[:, 0], [1, 1, half, half, 1, 1], rtol=1e-12)
    np.testing.assert_allclose(found[:, 1], [0, 0, 1, 1, 0, 0], rtol=0, atol=0)
    np.testing.assert_allclose(found[[0, 2, 4], 2], [0.6, 0.3, 0.7], rtol=1e-9)
    assert (found >= 0).all()


def test_edges_between_like_nodes_weigh_more() -> None:
    features = np.array([[0.0, 7.0], [0.0, 7.0], [5.0, 7.0], [5.0, 7.0]])
    found = edge_features(grid_problem(node_features=features), ("raw-difference",))[:, 0]
    np.testing.assert_allclose(found[[0, 5]], 1.0, rtol=1e-12)
    assert (found[1:5] < 0.5).all()
    constant = edge_features(grid_problem(node_features=np.ones((4, 1))), ("raw-difference",))
    np.testing.assert_array_equal(constant, 1.0)


def test_automatic_edge_features_take_what_is_there() -> None:
    assert edge_features(grid_problem(), ("auto",)).shape == (6, 2)
    assert edge_feature_count(grid_problem(), ("auto", "diagonal", "constant")) == 3
    given = grid_problem(edge_features=np.ones((6, 2)))
    assert edge_features(given, ("auto",)).shape == (6, 4)
    bare: dict[str, None] = {"node_features": None}
    assert edge_features(grid_problem(**bare), ("auto",)).shape == (6, 1)  # type: ignore[arg-type]


def test_given_edge_features_pass_through_and_must_be_there() -> None:
    given = np.arange(12.0).reshape(6, 2)
    problem = grid_problem(edge_features=given)
    np.testing.assert_array_equal(edge_features(problem, ("given",)), given)
    assert edge_feature_count(problem, ("constant", "given")) == 3
    with pytest.raises(InputError, match="needs the problem's edge features"):
        edge_features(grid_problem(), ("given",))


def test_standardisation_drops_what_says_nothing_new() -> None:
    rng = np.random.default_rng(0)
    first, second = rng.normal(size=(2, 100))
    features = np.column_stack([first, np.ones(100), 3.0 - 2.0 * first, second, first])
    scaling = Standardization.of(features)
    assert scaling.columns.tolist() == [0, 3]
    scaled = scaling.apply(features)
    assert scaled.shape == (100, 3)
    np.testing.assert_allclose(scaled[:, :2].mean(axis=0), 0.0, rtol=0, atol=1e-12)
    np.testing.assert_allclose(scaled[:, :2].std(axis=0), 1.0, rtol=1e-12)
    np.testing.assert_array_equal(scaled[:, 2], 1.0)


def test_outliers_are_clipped_and_training_numbers_are_kept() -> None:
    scaling = Standardization.of(np.array([[0.0], [2.0]]))
    np.testing.assert_allclose(scaling.apply(np.array([[101.0], [1.0], [-50.0]]))[:, 0], [5, 0, -5])


def test_another_number_of_features_is_refused() -> None:
    scaling = Standardization.of(np.random.default_rng(0).normal(size=(9, 3)))
    with pytest.raises(InputError, match="trained on 3 node features, this problem has 2"):
        scaling.apply(np.zeros((4, 2)))


def test_the_kinds_of_edges_are_told_apart_where_asked() -> None:
    cells = LabelGraph.from_grid(np.ones((2, 2), np.bool_))
    chain = LabelGraph.from_trajectory(np.arange(6.0).reshape(3, 2))
    joined = LabelGraph.joined(cells, chain, [[0, 1]])
    problem = LabelingProblem(joined, ["a", "b"], unary=np.zeros((7, 2)))
    columns = edge_features(problem, ("kind",))
    of_kind = dict(zip(EdgeKind, columns.sum(axis=0), strict=True))
    present = {kind: count for kind, count in of_kind.items() if count}
    assert present == {
        EdgeKind.AXIS: 4,
        EdgeKind.DIAGONAL: 2,
        EdgeKind.TIME: 2,
        EdgeKind.LINK: 1,
    }
    assert (columns.sum(axis=1) == 1).all()
    assert edge_feature_count(problem, ("constant", "kind")) == 1 + len(EdgeKind)
    plain = LabelGraph.from_edges(2, [(0, 1)])
    with pytest.raises(InputError, match="needs the kinds of the graph's edges; it has none"):
        edge_features(LabelingProblem(plain, ["a"], unary=np.zeros((2, 1))), ("kind",))
