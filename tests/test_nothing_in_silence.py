"""What was once taken without a word: writers, words, masks, swapped arguments, labels."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sklearn.exceptions import NotFittedError as SklearnNotFittedError

import pgm_places as p
from pgm_places.errors import ConfigError, InfeasibleError, InputError, NotFittedError, OutputError
from pgm_places.io.atomic import kind_of
from pgm_places.io.places.topology_files import save_topology
from pgm_places.solvers.adjacency import adjacency
from pgm_places.solvers.forward import ForwardFilter
from pgm_places.solvers.likelihood import negative_log_likelihood
from pgm_places.solvers.local_search import allowed_labels
from pgm_places.solvers.pairwise import pairwise_model, total_score
from pgm_places.solvers.table_field import TableField
from tests.labelers.test_contract import NAMES, known, walk
from tests.refusals import refused


def test_no_writer_replaces_a_file_of_another_kind(tmp_path: Path) -> None:
    item = known(0)
    p.save_map(item.grid, tmp_path / "office", image_format="pgm")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(OutputError, match=r"office\.yaml: it is the description of a map"):
        p.save_labels(tmp_path / "office.png", item.labels, NAMES)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    p.save_labels(tmp_path / "labels.png", item.labels, NAMES)
    with pytest.raises(OutputError, match=r"labels\.yaml: it is a file of label names"):
        p.save_map(item.grid, tmp_path / "labels", image_format="pgm")
    assert not (tmp_path / "labels.pgm").exists()
    p.save_labels(tmp_path / "labels.png", item.labels, NAMES)  # once more: the same kind
    p.save_map(item.grid, tmp_path / "office", image_format="pgm")
    (tmp_path / "places.json").write_text('{"mine": 1}')
    with pytest.raises(OutputError, match=r"places\.json: it is JSON"):
        save_topology(tmp_path, p.topological_map(item.grid, item.labels, NAMES))


@pytest.mark.parametrize(
    ("head", "kind"),
    [
        (b"\x89PNG\r\n\x1a\n" + b"\0" * 17 + b"\3", "a PNG (indexed)"),
        (b"P5\n2 2\n255\n", "a PGM"),
        (b'{"format": "a"}', "JSON (a)"),
        (b'{"half', ""),
        (b"a,b\n1,2\n", "text"),
        (b"\0\1\2", "a binary file"),
    ],
)
def test_kinds_are_seen_in_the_first_bytes(head: bytes, kind: str) -> None:
    assert kind_of(head) == kind


def test_a_map_file_and_a_path_stand_for_their_grid(tmp_path: Path) -> None:
    item = known(0)
    path = p.save_map(item.grid, tmp_path / "map")
    wanted = p.LabelGraph.from_grid(item.grid).n_nodes
    for given in (str(path), path, p.load_map(path), item):
        assert p.LabelGraph.from_grid(given).n_nodes == wanted  # type: ignore[arg-type]


def test_swapped_arguments_are_named() -> None:
    with pytest.raises(InputError, match=r"map must be a LabelledMap, got a Tr.*; are map and"):
        p.MappedDrive(walk(0), known(0))  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"graph must be a LabelGraph.*; give its \.graph"):
        problem = p.LabelingProblem(p.LabelGraph.from_lattice((3,)), NAMES, np.zeros((3, 2)))
        p.score(problem, p.Potentials(np.zeros((3, 2))), [0, 1, 0])  # type: ignore[arg-type]


def test_a_status_is_a_status() -> None:
    labels = np.array([0, 1])
    assert p.Labeling(labels, "exact").status is p.Status.EXACT  # type: ignore[arg-type]
    with pytest.raises(InputError, match="status must be a Status, got 'exakt'"):
        p.Labeling(labels, "exakt")  # type: ignore[arg-type]


def test_names_are_a_list_in_order() -> None:
    graph = p.LabelGraph.from_edges(2, [(0, 1)])
    for names in ({"a", "b"}, "ab", [1, 2], None):
        with pytest.raises(InputError, match="label_names must be a list of names"):
            p.LabelingProblem(graph, names, np.zeros((2, 2)))  # type: ignore[arg-type]
        with pytest.raises(InputError, match="label_names must be a list of names"):
            p.evaluate([0, 1], [0, 1], names)  # type: ignore[arg-type]


def test_masks_are_masks() -> None:
    graph = p.LabelGraph.from_edges(3, [(0, 1), (1, 2)])
    problem = p.LabelingProblem(graph, NAMES, np.zeros((3, 2)))
    for nodes in ([0, 1, 2], [np.nan] * 3):
        refused(InputError, "nodes must be a mask of True and False", graph.subgraph, nodes)
        refused(InputError, "nodes must be a mask of True and False", problem.subproblem, nodes)
    masked = np.ma.masked_array(np.zeros((3, 2)), np.eye(3)[:, :2] > 0)
    with pytest.raises(InputError, match="a masked array, 2 of its values masked; fill them"):
        p.LabelingProblem(graph, NAMES, masked)


def test_a_node_without_labels_is_named() -> None:
    graph = p.LabelGraph.from_edges(2, [(0, 1)])
    barred = p.Potentials([[-np.inf, -np.inf], [0.0, 0.0]])  # type: ignore[arg-type]
    refused(InfeasibleError, "node 0", p.decode, graph, barred, "trw-s")
    unlike = p.Potentials(np.zeros((2, 2)), np.where(np.eye(2) > 0, -np.inf, 0.0))
    for method in ("trw-s", "icm", "max-product", "lp"):
        with pytest.raises(
            InfeasibleError, match=r"no label is left for node 0|every label at node 0"
        ):
            p.decode(graph, unlike, method, known=[1, 1])


def test_an_unfitted_method_is_scikit_learns_error_too() -> None:
    with pytest.raises(SklearnNotFittedError) as found:
        p.PlaceLabeler(NAMES).label(known(0).grid)
    assert isinstance(found.value, NotFittedError)


def test_max_product_settles_well_by_default_and_says_what_is_better() -> None:
    """Messages without damping settle at labels that a local search improves."""
    rng = np.random.default_rng(0)
    n, k = 48, 8
    row, column = np.mgrid[:n, :n]
    truth = (row * 3 // n * 3 + column * 3 // n).ravel() % k
    unary = -(((truth + rng.normal(scale=2.0, size=truth.shape))[:, None] - np.arange(k)) ** 2) / 8
    graph, potentials = p.LabelGraph.from_lattice((n, n)), p.Potentials.potts(unary, 1.5)
    usual = p.decode(graph, potentials, "max-product")
    plain = p.decode(graph, potentials, "max-product", damping=0.0)
    half = p.decode(graph, potentials, "max-product", damping=0.5)
    assert usual.score == half.score
    assert usual.score is not None and plain.score is not None
    assert usual.score > plain.score
    for found in (usual, plain):
        if "better_score" in found.info:
            labels = found.info["better_labels"]
            assert p.score(graph, potentials, labels) == pytest.approx(found.info["better_score"])
            assert found.info["better_score"] > found.score
    with pytest.raises(ConfigError, match="damping must be a number of at least 0 and below 1"):
        p.decode(graph, potentials, "max-product", damping=1.0)


def test_words_of_functions_are_those_of_options() -> None:
    rng = np.random.default_rng(0)
    edges = [(0, 1), (1, 2), (2, 3)]
    field = TableField(rng.normal(size=(4, 2)), adjacency(4, edges), np.ones((3, 1)), 2)
    weights = np.zeros(field.n_weights)
    with pytest.raises(ConfigError, match="kind must be 'likelihood', 'pseudo-likelihood' or"):
        negative_log_likelihood(field, np.zeros(4, int), weights, "exact")  # type: ignore[arg-type]
    for labels in ([0, 1, 0, 10**6], [0, 1], [0.0, np.inf, 1.0, 0.0], [0.0, np.nan, 1.0, 0.0]):
        with pytest.raises(InputError, match="labels must"):
            negative_log_likelihood(field, np.array(labels), weights)


@pytest.mark.parametrize("asks", [total_score, allowed_labels])
@pytest.mark.parametrize("labels", [[0, 1, 2, 10**6], [], [0, 1, 2, -1], [0, 1]])
def test_labels_that_do_not_fit_are_refused(asks: Callable[..., Any], labels: list[int]) -> None:
    model = pairwise_model(np.zeros((4, 3)), [(0, 1), (1, 2), (2, 3)], pairwise=np.eye(3))
    refused(InputError, "labels must", asks, model, np.array(labels, np.int64))


def test_infinities_are_no_integers() -> None:
    graph = p.LabelGraph.from_edges(3, [(0, 1), (1, 2)])
    for wrong in (np.inf, -np.inf, np.nan):
        with pytest.raises(InputError, match=r"^known must be .* whole numbers"):
            p.LabelingProblem(graph, ["a", "b"], known=np.array([0.0, wrong, 1.0]))
    assert p.LabelingProblem(graph, ["a", "b"], known=np.array([0.0, -1.0, 1.0])).known is not None


def test_a_column_is_a_step() -> None:
    forward = ForwardFilter(np.full(3, 1 / 3), np.full((1, 3, 3), 1 / 3))
    columns = np.random.default_rng(0).normal(size=(3, 50))
    found, _ = forward.step(columns[:, 0])
    np.testing.assert_array_equal(found, forward.step(columns[:, 0].copy())[0])


@pytest.mark.parametrize("n_dimensions", [2, 11])
def test_nearest_points_are_those_of_all_distances(n_dimensions: int) -> None:
    points = np.random.default_rng(0).normal(size=(2100, n_dimensions))
    graph = p.LabelGraph.from_points(points, n_neighbours=3)
    for i in range(0, 2100, 300):
        nearest = np.argsort(((points - points[i]) ** 2).sum(axis=1))[1:4]
        pairs = {(min(i, j), max(i, j)) for j in nearest.tolist()}
        assert pairs <= set(map(tuple, graph.edges.tolist()))
