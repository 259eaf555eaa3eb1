"""The floor networks beside the lists: the mean of log-odds, by the definition."""

from pathlib import Path

import numpy as np
import pytest

from pgm_places import (
    LabelGraph,
    LabelledMap,
    OccupancyGrid,
    PlaceLabeler,
    PlaceMethod,
    label_map,
    load,
    save,
)
from pgm_places.errors import ConfigError
from pgm_places.floor.raster import holders
from pgm_places.floor.view import FloorScores
from pgm_places.graph.layout import GridLayout
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.models.mrf import PottsField
from pgm_places.simulation import generate_building
from pgm_places.spaces.gates import gate_candidates
from pgm_places.spaces.segmentation import Segmentation
from pgm_places.unary.feature_table import CachedFeatures
from pgm_places.unary.floor_model import FloorJudge, FloorModel, columns_of, with_floor
from pgm_places.unary.options import SpaceOptions
from tests.floor.random_network import random_network
from tests.refusals import refused

LABELS = ("corridor", "room", "doorway")


def seen_by(log_p: list[list[float]], spread: list[float]) -> tuple[FloorScores, GridLayout]:
    """A row of cells of 0.1 m, one for each entry."""
    n = len(log_p)
    scores = FloorScores(
        np.array([log_p], np.float16),
        np.array([spread], np.float16),
        np.zeros(1, np.int64),
        np.arange(n),
    )
    layout = LabelGraph.from_grid(OccupancyGrid(np.zeros((1, n), np.int8), 0.1)).layout
    assert isinstance(layout, GridLayout)
    return scores, layout


def test_it_is_the_weighted_mean_of_both_log_odds() -> None:
    p, q = np.array([0.2, 0.5, 0.2, 0.1]), np.array([0.7, 0.2, 0.1])
    scores, layout = seen_by([np.log(p).tolist()], [0.0])
    model = FloorModel((), share=0.6, doorway_share=0.25)
    found = with_floor(np.log(q)[np.newaxis], scores, model, layout)[0]
    folded = np.array([p[0] + p[3], p[1], p[2]])
    share = np.array([0.6, 0.6, 0.25])
    wanted = np.exp((1 - share) * np.log(q) + share * np.log(folded))
    np.testing.assert_allclose(np.exp(found), wanted / wanted.sum(), rtol=0, atol=1e-3)


def test_a_label_that_networks_do_not_know_has_the_score_of_the_list() -> None:
    scores, layout = seen_by([np.log([0.6, 0.3, 0.1, 1e-3]).tolist()], [0.0])
    q = np.array([[0.3, 0.2, 0.1, 0.4]])
    model = FloorModel((), share=0.5, doorway_share=0.5).with_more(1)
    assert model.columns == (0, 1, 2, -1)
    found = np.exp(with_floor(np.log(q), scores, model, layout))[0]
    wanted = np.sqrt(q[0] * [0.601, 0.3, 0.1, q[0, 3]])
    np.testing.assert_allclose(found, wanted / wanted.sum(), rtol=0, atol=2e-3)


def test_views_that_differ_count_less() -> None:
    log_p = np.log([0.9, 0.05, 0.04, 0.01]).tolist()
    scores, layout = seen_by([log_p] * 3, [0.0, 1.0, 8.0])
    even = np.full((3, 3), np.log(1 / 3))
    found = np.exp(with_floor(even, scores, FloorModel((), share=1.0), layout))
    assert found[0, 0] > found[1, 0] > found[2, 0] > 1 / 3


def test_the_share_of_halls_is_between_both() -> None:
    scores, layout = seen_by([np.log([0.08, 0.1, 0.1, 0.72]).tolist()], [0.0])
    hall = np.array([0.5], np.float32)
    with_floor(np.log([[0.4, 0.4, 0.2]]), scores, FloorModel((), share=0.5), layout, hall)
    np.testing.assert_allclose(hall, [0.75], rtol=0, atol=2e-3)  # odds 9 and 1, in the mean 3


@pytest.mark.parametrize("order", [LABELS, ("room", "corridor"), ("doorway", "room", "corridor")])
def test_labels_are_found_by_name(order: tuple[str, ...]) -> None:
    columns = columns_of(order)
    assert [LABELS[k] for k in columns] == list(order)


@pytest.mark.parametrize("names", [("corridor", "kitchen"), ("room", "doorway"), ("a", "b")])
def test_other_labels_are_refused(names: tuple[str, ...]) -> None:
    refused(ConfigError, "the floor networks tell corridor, room", columns_of, names)


@pytest.fixture(scope="module")
def fitted() -> tuple[PlaceLabeler, LabelledMap]:
    made = generate_building(3, size="small")
    known = LabelledMap(made.grid, made.labels)
    floor = FloorModel((random_network(1), random_network(2)), views_per_network=1, share=0.3)
    methods = {
        "alone": PlaceMethod("independent", "space"),
        "both": PlaceMethod("independent", "floor"),
        "field": PlaceMethod(PottsField(weight=0.3), "floor"),
    }
    labeler = PlaceLabeler(
        made.label_names,
        methods,
        classifier=DecisionListClassifier(n_rounds=10, order="heuristic"),
        space=SpaceOptions(n_rounds=5),
        max_examples_per_map=1000,
        n_folds=2,
        floor=floor,
    )
    return labeler.fit([known]), known


def test_a_method_labels_the_mean(fitted: tuple[PlaceLabeler, LabelledMap]) -> None:
    labeler, known = fitted
    graph, scores = labeler.scores(known.grid)
    assert isinstance(graph.layout, GridLayout)
    assert scores.space is not None
    assert scores.floor is not None
    floor = labeler.unary_model_.floor
    assert floor is not None
    wanted = with_floor(scores.space, floor.scores(known.grid), floor, graph.layout)
    np.testing.assert_array_equal(scores.floor, wanted)
    labels = labeler.with_options(whole_spaces=False).label(known.grid, method="both").labels
    np.testing.assert_array_equal(labels, wanted.argmax(axis=1))
    assert (labels != labeler.label(known.grid, method="alone").labels).any()


def test_it_is_saved_with_its_networks(
    fitted: tuple[PlaceLabeler, LabelledMap], tmp_path: Path
) -> None:
    labeler, known = fitted
    save(labeler, tmp_path / "model")
    again = load(tmp_path / "model")
    floor = again.unary_model_.floor
    assert floor is not None
    assert (floor.views_per_network, floor.share, floor.columns) == (1, 0.3, (0, 1, 2))
    before = labeler.label(known.grid, method="field").labels
    after = again.label(known.grid, method="field").labels
    assert (before == after).mean() > 0.95  # weights are packed into seven bits


def test_threads_give_the_same_bits(fitted: tuple[PlaceLabeler, LabelledMap]) -> None:
    labeler, known = fitted
    one, three = (
        label_map(labeler, known.grid, method="both", n_threads=n).labeling.beliefs for n in (1, 3)
    )
    assert one is not None
    np.testing.assert_array_equal(one, three)


def test_networks_are_needed_for_their_unary() -> None:
    with pytest.raises(ConfigError, match="needs unary='floor' but floor is None"):
        PlaceLabeler(LABELS, {"x": PlaceMethod("independent", "floor")}).check_options()


def test_a_table_keeps_what_was_seen_of_a_map() -> None:
    looks: list[OccupancyGrid] = []

    def look(grid: OccupancyGrid) -> FloorScores:
        looks.append(grid)
        return seen_by([[0.0] * 4], [0.0])[0]

    table = CachedFeatures(np.zeros(0, np.int64))
    cells = np.zeros((4, 5), np.int8)
    first = table.floor_of(OccupancyGrid(cells, 0.1), look)
    assert table.floor_of(OccupancyGrid(cells.copy(), 0.1), look) is first
    cells[1, 1] = 100
    table.floor_of(OccupancyGrid(cells, 0.1), look)
    table.floor_of(OccupancyGrid(cells, 0.05), look)
    assert len(looks) == 3


def test_gates_are_judged_by_the_list_and_by_what_networks_see_there() -> None:
    made = generate_building(3, size="small")
    gates = gate_candidates(Segmentation.of(made.grid))
    assert len(gates) > 1
    given = np.linspace(0.2, 0.8, len(gates))
    rows, columns = (holders(n, made.grid.resolution_m) for n in made.grid.shape)
    log_p = np.full((rows[-1] + 1, columns[-1] + 1, 4), np.log(0.25), np.float16)
    log_p[..., 2] = np.log(0.9)
    seen = FloorScores(log_p, np.zeros(log_p.shape[:2], np.float16), rows, columns)
    odds = given / (1 - given)
    wanted = odds**0.75 * (0.9 / 0.1) ** 0.25
    found = FloorJudge(FloorModel((), gate_share=0.25), seen).judged(gates, given)
    np.testing.assert_allclose(found, wanted / (1 + wanted), rtol=0, atol=2e-3)
    np.testing.assert_allclose(
        FloorJudge(FloorModel((), gate_share=0.0), seen).judged(gates, given),
        given,
        rtol=0,
        atol=1e-9,
    )


@pytest.mark.parametrize(("low", "high", "less"), [(8, 12, 0.0), (6, 15, 0.0), (5, 16, 2.5)])
def test_gates_over_two_metres_must_be_surer(low: int, high: int, less: float) -> None:
    cells = np.full((20, 42), FREE, np.int8)
    cells[:, 20:22], cells[low:high, 20:22] = OCCUPIED, FREE
    gates = gate_candidates(Segmentation.of(OccupancyGrid(cells, 0.2)))
    assert gates.width_m == pytest.approx([0.2 * (high - low)])
    rows, columns = (holders(n, 0.2) for n in cells.shape)
    log_p = np.full((rows[-1] + 1, columns[-1] + 1, 4), np.log(0.25), np.float16)
    seen = FloorScores(log_p, np.zeros(log_p.shape[:2], np.float16), rows, columns)
    judge = FloorJudge(FloorModel((), gate_share=0.0), seen)
    [found] = judge.judged(gates, np.array([0.9])).tolist()
    assert np.log(found / (1 - found)) == pytest.approx(np.log(9) - less)
