import numpy as np
import pytest

from pgm_places.errors import InputError
from pgm_places.solvers import frank_wolfe as module
from pgm_places.solvers.frank_wolfe import frank_wolfe
from pgm_places.solvers.max_margin import MaxMarginProblem, MaxMarginSolution, joined
from pgm_places.solvers.max_margin_qp import max_margin_qp
from pgm_places.solvers.max_oracle import graph_cut_oracle
from tests.reference import max_margin as reference
from tests.solvers.max_margin_problems import grid_problem


def learn(problems: list[MaxMarginProblem], **options: object) -> MaxMarginSolution:
    oracles = [graph_cut_oracle(problem.n_nodes, problem.edges) for problem in problems]
    return frank_wolfe(problems, oracles, **options)  # type: ignore[arg-type]


@pytest.mark.parametrize(("n_labels", "width"), [(2, 4), (3, 3)])
def test_with_an_exact_oracle_it_finds_the_optimum(n_labels: int, width: int) -> None:
    problem = grid_problem(2, width, n_labels, seed=1, weighted=True)
    exact, _ = reference.optimum(problem)
    oracle = reference.exact_oracle(problem)
    found = frank_wolfe([problem], [oracle], tolerance=1e-3, exact=True)
    assert found.status == "within_tolerance"
    assert found.lower_bound <= exact * (1 + 1e-9)
    assert found.objective == pytest.approx(exact, rel=1e-3)
    assert found.objective == pytest.approx(reference.objective(problem, found.weights), rel=1e-9)


@pytest.mark.parametrize("seed", [0, 1])
def test_several_maps_reach_the_qp_of_their_union(seed: int) -> None:
    maps = [grid_problem(4, 4, 2, seed=2), grid_problem(3, 6, 2, seed=3), grid_problem(5, 4, 2)]
    exact = max_margin_qp(joined(maps), tolerance=1e-8)
    found = learn(maps, tolerance=2e-3, seed=seed)
    assert found.status == "oracle_limit"
    assert found.lower_bound <= exact.objective * (1 + 1e-7)
    assert found.objective == pytest.approx(exact.objective, rel=2e-3)
    assert (found.weights[maps[0].n_node_weights :] >= 0).all()


def test_the_lower_bound_never_falls() -> None:
    found = learn([grid_problem(4, 4, 2, seed=4), grid_problem(4, 4, 2, seed=5)])
    lower = np.array([step.lower_bound for step in found.history])
    assert (np.diff(lower) >= -1e-9).all()


def test_the_same_seed_gives_the_same_bits() -> None:
    maps = [grid_problem(4, 4, 3, seed=6), grid_problem(4, 4, 3, seed=7)]
    first, second = learn(maps, max_passes=10, seed=3), learn(maps, max_passes=10, seed=3)
    np.testing.assert_array_equal(first.weights, second.weights)


def test_few_remembered_planes_suffice(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MAX_PLANES", 12)
    problem = grid_problem(4, 4, 2, seed=8)
    found = learn([problem], tolerance=5e-3)
    exact = max_margin_qp(problem, tolerance=1e-8)
    assert found.objective == pytest.approx(exact.objective, rel=5e-3)


@pytest.mark.parametrize(
    ("options", "status"),
    [
        ({"time_limit_s": 1e-9}, "time_limit"),
        ({"max_passes": 2}, "iteration_limit"),
        ({"on_iteration": lambda step: step.iteration == 2}, "stopped"),
    ],
)
def test_limits_give_the_best_so_far(options: dict[str, object], status: str) -> None:
    found = learn([grid_problem(5, 5, 2, seed=9, penalty=50.0)], tolerance=1e-9, **options)
    assert found.status == status
    assert found.lower_bound <= found.objective < np.inf


def test_every_map_needs_its_oracle() -> None:
    with pytest.raises(InputError, match="got 0 for 1 maps"):
        frank_wolfe([grid_problem(2, 2, 2)], [])
