from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places import (
    LabelGraph,
    Labeling,
    LabelingProblem,
    LabelledMap,
    OccupancyGrid,
    Status,
    build,
    load_labels,
    load_map,
)
from pgm_places._checks import freeze
from pgm_places.errors import InputError, NotFittedError
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN
from pgm_places.models.relaxation import Relaxation, grid_connectivity
from pgm_places.solvers.relaxation import yamamoto_coefficients
from tests.real_data import real_data_folder
from tests.reference.relaxation import pair_counts, relaxed_grid
from tests.refusals import refused

NAMES = ("corridor", "room", "doorway")
WALL = len(NAMES)


def a_floor() -> tuple[OccupancyGrid, NDArray[np.int64]]:
    """A corridor with rooms on both sides, doors between, unknown beyond; and its labels."""
    truth = np.full((40, 66), -1)
    cells = np.full(truth.shape, UNKNOWN)
    cells[3:37, 3:63] = OCCUPIED
    truth[17:23, 4:62] = 0
    for x in range(4, 62, 12):
        truth[4:16, x : x + 10] = 1
        truth[24:36, x : x + 10] = 1
        truth[16, x + 4 : x + 7] = 2
        truth[23, x + 3 : x + 6] = 2
    cells[truth >= 0] = FREE
    return OccupancyGrid(cells.astype(np.int8), 0.2), truth


def a_problem(noise: float, seed: int = 0) -> tuple[LabelingProblem, NDArray[np.int64]]:
    grid, truth = a_floor()
    graph = LabelGraph.from_grid(grid)
    rng = np.random.default_rng(seed)
    true = LabelledMap(grid, truth.astype(np.int16)).truth(graph)
    seen = np.where(rng.random(len(true)) < noise, rng.integers(0, 3, len(true)), true)
    z = np.full((len(true), 3), 0.125)
    z[np.arange(len(true)), seen] = 0.75
    return LabelingProblem(graph, NAMES, unary=np.log(z)), true


def beliefs(labeling: Labeling) -> NDArray[np.floating[Any]]:
    assert labeling.beliefs is not None
    return labeling.beliefs


def test_noise_is_smoothed_away_and_the_history_tells_how() -> None:
    problem, truth = a_problem(0.3)
    method = Relaxation(max_iterations=50).fit([problem], [truth])
    result = method.infer(problem, truth=truth)
    raw = (np.asarray(problem.unary).argmax(axis=1) == truth).mean()
    smooth = (result.labels == truth).mean()
    assert raw < 0.85
    assert smooth > 0.95
    history = result.info["history"]
    assert set(history) == {"change", "mean_change", "support", "accuracy"}
    assert {len(values) for values in history.values()} == {result.info["iterations"]}
    assert history["accuracy"][-1] == pytest.approx(smooth)
    assert history["support"][-1] > history["support"][0]
    assert result.status is Status.STOPPED
    assert result.score is None


def test_unaries_in_single_precision_are_not_copied_and_give_the_same_labels() -> None:
    problem, truth = a_problem(0.3)
    assert problem.unary is not None
    single = LabelingProblem(problem.graph, NAMES, freeze(problem.unary.astype(np.float32)))
    assert single.unary is not None and single.unary.dtype == np.float32
    method = Relaxation(max_iterations=50).fit([problem], [truth])
    found, wanted = method.infer(single), method.infer(problem)
    assert np.array_equal(found.labels, wanted.labels)
    np.testing.assert_allclose(beliefs(found), beliefs(wanted), rtol=0, atol=1e-5)


@pytest.mark.parametrize("name", ["independent", "potts"])
def test_other_methods_compute_in_double_precision(name: str) -> None:
    problem, _ = a_problem(0.3)
    rounded: Any = np.asarray(problem.unary, np.float32)
    known = np.full(len(rounded), -1)
    known[3] = 1
    single = LabelingProblem(problem.graph, NAMES, unary=rounded, known=known)
    double = LabelingProblem(problem.graph, NAMES, rounded.astype(np.float64), known=known)
    found, wanted = build(name).infer(single), build(name).infer(double)
    assert np.array_equal(found.labels, wanted.labels) and found.labels[3] == 1
    assert found.score == wanted.score
    if wanted.beliefs is not None:
        assert beliefs(found).dtype == np.float64
        assert np.array_equal(beliefs(found), beliefs(wanted))


def test_beliefs_are_the_references_with_walls_from_the_map() -> None:
    problem, truth = a_problem(0.3, seed=1)
    method = Relaxation(max_iterations=3, diagonal_weight=0.6, damping=0.2).fit([problem], [truth])
    result = method.infer(problem)
    layout: Any = problem.graph.layout
    start = layout.to_raster(np.exp(np.asarray(problem.unary)), fill=np.nan)
    assert method.compatibility is not None
    want = relaxed_grid(
        start,
        layout.walls,
        method.compatibility,
        diagonal_weight=0.6,
        damping=0.2,
        max_iterations=3,
    )
    np.testing.assert_allclose(beliefs(result), layout.from_raster(want), rtol=0, atol=5e-6)
    np.testing.assert_array_equal(result.labels, beliefs(result).argmax(axis=1))


@pytest.mark.parametrize("directional", [False, True])
def test_counts_are_of_labelled_cells_and_the_walls_that_touch_them(directional: bool) -> None:
    problem, truth = a_problem(0.0)
    layout: Any = problem.graph.layout
    partly = np.where(layout.cells_rc[:, 1] < 30, truth, -1)
    method = Relaxation(directional=directional).fit([problem], [partly])
    raster = layout.to_raster(partly, fill=-1)
    for y, x in np.argwhere(layout.walls):
        if (raster[y - 1 : y + 2, x - 1 : x + 2] % WALL != raster[y, x]).any():
            near = raster[y - 1 : y + 2, x - 1 : x + 2]
            if ((near >= 0) & (near < WALL)).any():
                raster[y, x] = WALL
    want = pair_counts(raster, 4)
    if not directional:
        want = want.sum(axis=0, keepdims=True)
    assert method.pair_counts is not None
    np.testing.assert_array_equal(method.pair_counts, want)
    np.testing.assert_array_equal(
        method.compatibility, yamamoto_coefficients(want, smoothing=method.smoothing)
    )


def test_several_maps_are_counted_together() -> None:
    problem, truth = a_problem(0.0)
    once = Relaxation().fit([problem], [truth])
    twice = Relaxation().fit([problem, problem], [truth, truth])
    assert once.pair_counts is not None
    np.testing.assert_array_equal(twice.pair_counts, 2 * once.pair_counts)


def test_directions_tell_what_lies_above_from_what_lies_below() -> None:
    """Stripes 0 1 2 0 1 2 ...: isotropic neighbours of 1 are 0 and 2 alike."""
    truth = np.tile(np.arange(3), 20)
    graph = LabelGraph.from_grid(np.ones((1, 60), np.bool_))
    z = np.full((60, 3), 1 / 3)
    z[0] = 0.9, 0.05, 0.05
    problem = LabelingProblem(graph, NAMES, unary=np.log(z))
    known = Relaxation(directional=True, max_iterations=400, tolerance=0).fit([problem], [truth])
    np.testing.assert_array_equal(known.infer(problem).labels[:24], truth[:24])
    blind = Relaxation(max_iterations=400, tolerance=0).fit([problem], [truth])
    assert (blind.infer(problem).labels[:24] != truth[:24]).any()


@pytest.mark.parametrize("directional", [False, True])
def test_a_chain_without_layout_is_the_same_as_a_corridor_of_cells(directional: bool) -> None:
    rng = np.random.default_rng(3)
    truth = np.repeat(rng.integers(0, 3, 12), 5)
    unary = np.log(rng.dirichlet(np.ones(3), 60) + 0.5 * np.eye(3)[truth])
    ends = [0, -1]
    steps = np.arange(59)
    chain = LabelGraph.from_edges(60, np.stack([steps, steps + 1], axis=1))
    cells = LabelGraph.from_grid(np.ones((1, 60), np.bool_), connectivity=4)
    method = Relaxation(max_iterations=4, directional=directional)
    on_chain = LabelingProblem(chain, NAMES, unary=unary)
    on_cells = LabelingProblem(cells, NAMES, unary=unary)
    first = method.fit([on_chain], [truth])
    second = method.fit([on_cells], [truth])
    assert first.pair_counts is not None
    assert second.pair_counts is not None
    if directional:
        np.testing.assert_array_equal(first.pair_counts, second.pair_counts[[4, 3]])
    else:
        np.testing.assert_array_equal(first.pair_counts, second.pair_counts)
    # On the chain two neighbours weigh 1/2 each, on the one-row map 1/8: four times the effect.
    weak = replace(first, compatibility=0.25 * np.asarray(first.compatibility))
    a, b = weak.infer(on_chain), second.infer(on_cells)
    inner = slice(6, -6)
    np.testing.assert_allclose(beliefs(a)[inner], beliefs(b)[inner], rtol=0, atol=1e-5)
    assert (np.abs(beliefs(a)[ends] - beliefs(b)[ends]) > 1e-5).any()


def test_connectivity_is_read_from_the_edges() -> None:
    mask = np.random.default_rng(0).random((9, 11)) < 0.6
    assert grid_connectivity(LabelGraph.from_grid(mask)) == 8
    assert grid_connectivity(LabelGraph.from_grid(mask, connectivity=4)) == 4
    eight = LabelGraph.from_grid(mask)
    assert grid_connectivity(eight.subgraph(np.arange(eight.n_nodes) % 3 > 0)) == 8
    cut = LabelGraph.from_edges(eight.n_nodes, eight.edges[1:], layout=eight.layout)
    assert grid_connectivity(cut) is None
    assert grid_connectivity(LabelGraph.from_trajectory(np.zeros((4, 2)))) is None


def test_four_neighbours_count_and_pass_nothing_over_corners() -> None:
    mask = np.eye(6, dtype=np.bool_)
    mask[0, 1] = True
    graph = LabelGraph.from_grid(mask, connectivity=4)
    unary = np.log(np.random.default_rng(1).dirichlet(np.ones(3), graph.n_nodes))
    problem = LabelingProblem(graph, NAMES, unary=unary)
    method = Relaxation(max_iterations=5, tolerance=0).fit([problem], [np.arange(7) % 3])
    assert method.pair_counts is not None
    assert method.pair_counts.sum() == 2 * graph.n_edges
    found = beliefs(method.infer(problem))
    np.testing.assert_allclose(found[3:], np.exp(unary[3:]), rtol=1e-5)


def test_an_edgeless_graph_keeps_its_beliefs() -> None:
    graph = LabelGraph.from_edges(3, [])
    problem = LabelingProblem(graph, NAMES, unary=np.log(np.full((3, 3), 1 / 3)))
    other, truth = a_problem(0.0)
    result = Relaxation().fit([other], [truth]).infer(problem)
    np.testing.assert_allclose(beliefs(result), 1 / 3, rtol=1e-12)
    assert result.status is Status.CONVERGED


@pytest.mark.real_data
def test_noise_on_the_real_building_is_smoothed_away() -> None:
    """Learned on the left half of building 79, a third of the labels wrong on the right half."""
    folder = real_data_folder("freiburg079")
    grid = load_map(folder / "map.yaml").grid
    labels = load_labels(folder / "labels.png", NAMES, grid=grid)
    left = np.zeros(grid.shape, np.bool_)
    left[:, :366] = True
    halves = [LabelGraph.from_grid(grid, mask=mask & (labels >= 0)) for mask in (left, ~left)]
    known, true = (LabelledMap(grid, labels).truth(half) for half in halves)
    rng = np.random.default_rng(0)
    seen = np.where(rng.random(len(true)) < 0.3, rng.integers(0, 3, len(true)), true)
    train = LabelingProblem(halves[0], NAMES, unary=np.zeros((len(known), 3)))
    test = LabelingProblem(halves[1], NAMES, unary=np.log(0.125 + 0.625 * np.eye(3)[seen]))
    result = Relaxation().fit([train], [known]).infer(test, truth=true)
    assert (seen == true).mean() < 0.82
    assert result.info["history"]["accuracy"][9] > 0.99
    assert (result.labels == true).mean() > 0.99


def test_bad_problems() -> None:
    problem, truth = a_problem(0.0)
    chain, five = LabelGraph.from_trajectory(np.zeros((5, 2))), np.zeros(5, int)
    on_chain = LabelingProblem(chain, NAMES, unary=np.zeros((5, 3)))
    fewer = LabelingProblem(chain, NAMES[:2], unary=np.zeros((5, 2)))
    bare = LabelingProblem(chain, NAMES, node_features=np.zeros((5, 1)))
    plain, directional = Relaxation(), Relaxation(directional=True)
    fitted = directional.fit([problem], [truth])
    assert directional.compatibility is None
    refused(NotFittedError, "call fit first", directional.infer, problem)
    refused(InputError, "learned coefficients for 8 directions", fitted.infer, on_chain)
    refused(InputError, "learned 3 labels", fitted.infer, fewer)
    refused(InputError, "needs unary", fitted.infer, bare)
    for message, model, problems, labels in (
        ("at least one problem and a labelling for each", plain, [problem], []),
        ("nothing to count", plain, [problem], [np.full(len(truth), -1)]),
        ("8 directions on grids and 2", directional, [problem, on_chain], [truth, five]),
        (r"labelings\[0\] must have shape", plain, [problem], [truth[1:]]),
        ("different labels", plain, [problem, fewer], [truth, five]),
    ):
        refused(InputError, message, model.fit, problems, labels)
