"""Iterations and the share of the prior that relaxation chooses on held-out parts."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import softmax

from pgm_places import LabelGraph, LabelingProblem, PlaceMethod
from pgm_places.evaluation.folds import contiguous_parts
from pgm_places.labelers.place_learning import learn_from_scores
from pgm_places.models.relaxation import Relaxation
from pgm_places.models.relaxation_choice import best_row
from tests.models.test_relaxation import NAMES, beliefs


def narrow() -> tuple[LabelingProblem, NDArray[np.int64]]:
    """A wide map with doors one cell wide, of which a sure classifier is a little less sure."""
    rng = np.random.default_rng(2)
    graph = LabelGraph.from_grid(np.ones((9, 80), np.bool_))
    column = np.mgrid[:9, :80][1]
    truth = np.where(column % 10 == 9, 2, (column // 10) % 2).ravel().astype(np.int64)
    clear = np.where(truth == 2, 1.0, 3.0)[:, None] * np.eye(3)[truth]
    logits = clear + 0.5 * rng.normal(size=(len(truth), 3))
    return LabelingProblem(graph, NAMES, unary=np.log(softmax(logits, axis=1))), truth


def test_iterations_end_before_they_cost_what_is_narrow() -> None:
    problem, truth = narrow()
    fitted = Relaxation().fit([problem], [truth])
    found = fitted.summary
    assert found["max_iterations"] < 50
    rows = {(row["max_iterations"], row["evidence"]): row for row in found["held_out"]}
    alone, taken = rows[0, 0.0], rows[found["max_iterations"], found["evidence"]]
    assert taken["accuracy"] >= alone["accuracy"]
    assert taken["balanced_accuracy"] > alone["balanced_accuracy"]
    assert taken["balanced_accuracy"] > rows[50, 0.0]["balanced_accuracy"]
    assert fitted.infer(problem).info["iterations"] <= found["max_iterations"]


def test_held_out_counts_are_those_of_relaxing_each_part_by_itself() -> None:
    problem, truth = narrow()
    table = Relaxation().fit([problem], [truth]).held_out
    assert table is not None
    parts = contiguous_parts(problem.graph, 4, truth)
    right = {7: 0, 50: 0}
    for part in range(4):
        rest, asked = parts != part, parts == part
        for n in right:
            method = Relaxation(max_iterations=n, evidence=0.5, tolerance=0.0)
            method = method.fit([problem.subproblem(rest)], [truth[rest]])
            labels = method.infer(problem.subproblem(asked)).labels
            right[n] += int((labels == truth[asked]).sum())
    for n, count in right.items():
        [row] = table[(table[:, 0] == n) & (table[:, 1] == 0.5)]
        assert row[2] == count / len(truth)


def joint() -> tuple[LabelingProblem, NDArray[np.int64], NDArray[np.bool_]]:
    """The narrow map and a drive along its middle, whose scans are as often wrong as right."""
    cells, truth = narrow()
    at = np.argwhere(np.ones((9, 80)))[:, ::-1].astype(float)
    under = np.flatnonzero(at[:, 1] == 4)
    chain = LabelGraph.from_trajectory(at[under])
    fine = LabelGraph.from_edges(len(at), cells.graph.edges, positions_m=at)
    graph = LabelGraph.joined(fine, chain, np.column_stack([under, np.arange(80)]))
    rng = np.random.default_rng(3)
    scans = np.log(softmax(3.0 * rng.normal(size=(80, 3)), axis=1))
    assert cells.unary is not None
    problem = LabelingProblem(graph, NAMES, unary=np.concatenate([cells.unary, scans]))
    return problem, np.concatenate([truth, truth[under]]), np.arange(800) >= 720


def test_steps_of_a_drive_count_as_much_as_the_cells_of_its_map() -> None:
    problem, truth, is_step = joint()
    table = Relaxation().fit([problem], [truth]).held_out
    assert table is not None
    parts = contiguous_parts(problem.graph, 4, truth)
    labels = np.empty((2, len(truth)), np.int64)
    for part in range(4):
        rest, asked = parts != part, parts == part
        method = Relaxation(max_iterations=20, evidence=0.25, tolerance=0.0)
        method = method.fit([problem.subproblem(rest)], [truth[rest]])
        assert problem.unary is not None
        labels[0, asked] = problem.unary[asked].argmax(axis=1)
        labels[1, asked] = method.infer(problem.subproblem(asked)).labels
    for row, found in zip(((0, 0.0), (20, 0.25)), labels, strict=True):
        [scores] = table[(table[:, :2] == row).all(axis=1), 2:]
        kinds = [
            [(found == truth)[kind & (truth == label)].mean() for label in range(3)]
            for kind in (is_step, ~is_step)
        ]
        right = [(found == truth)[kind].mean() for kind in (is_step, ~is_step)]
        np.testing.assert_allclose(scores, [np.mean(right), np.mean(kinds)], rtol=1e-12)


def test_iterations_that_are_given_start_from_the_scores_as_they_are() -> None:
    problem, truth = narrow()
    ten = Relaxation(max_iterations=10).fit([problem], [truth])
    assert ten.summary == {}
    same = Relaxation(max_iterations=10, evidence=0.0).fit([problem], [truth])
    np.testing.assert_array_equal(beliefs(ten.infer(problem)), beliefs(same.infer(problem)))
    half = Relaxation(max_iterations=10, evidence=0.5).fit([problem], [truth]).infer(problem)
    assert half.beliefs is not None
    assert (half.labels == 2).sum() > (ten.infer(problem).labels == 2).sum()


def test_without_scores_to_compare_there_are_fifty_iterations() -> None:
    problem, truth = narrow()
    blind = replace(problem, unary=np.zeros((len(truth), 3)))
    fitted = Relaxation().fit([blind], [truth])
    assert fitted.summary == {}
    assert fitted.infer(problem).info["iterations"] <= 50


@pytest.mark.parametrize("given", [{"max_iterations": 10}, {"compatibility": np.eye(3)}])
def test_relaxation_with_nothing_to_choose_needs_no_scores(given: dict[str, Any]) -> None:
    assert learn_from_scores({"relaxation": PlaceMethod("relaxation")})
    assert not learn_from_scores({"relaxation": PlaceMethod(Relaxation(**given))})


ALONE = (0, 0.0, 0.900, 0.70)
MILD = (3, 0.25, 0.900, 0.72)
COSTLY = (5, 0.25, 0.898, 0.80)
LARGE = (1, 0.5, 0.909, 0.85)
MUCH_BETTER = (7, 0.5, 0.911, 0.80)


@pytest.mark.parametrize(
    ("rows", "best"),
    [
        ([COSTLY, MILD, LARGE], MILD),
        ([COSTLY, MILD, LARGE, MUCH_BETTER], MUCH_BETTER),
        ([(2, 0.0, 0.8995, 0.71), COSTLY], (2, 0.0, 0.8995, 0.71)),
        ([COSTLY, LARGE], ALONE),
    ],
)
def test_a_better_balance_costs_no_accuracy(
    rows: list[tuple[float, ...]], best: tuple[float, ...]
) -> None:
    assert tuple(best_row(np.array([ALONE, *rows])).tolist()) == best


@pytest.mark.parametrize("on_raster", [True, False])
def test_no_iterations_leave_the_scores(on_raster: bool) -> None:
    problem, truth = narrow()
    if not on_raster:
        graph = LabelGraph.from_edges(len(truth), problem.graph.edges)
        problem = replace(problem, graph=graph)
    fitted = replace(Relaxation().fit([problem], [truth]), choice=np.zeros(2))
    found = fitted.infer(problem)
    assert problem.unary is not None
    np.testing.assert_array_equal(found.labels, problem.unary.argmax(axis=1))
    np.testing.assert_allclose(beliefs(found), np.exp(problem.unary), rtol=0, atol=1e-5)
    assert found.info["iterations"] == 0
