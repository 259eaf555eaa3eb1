import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places.errors import InputError
from pgm_places.solvers.adjacency import adjacency
from pgm_places.solvers.graph_cut import Expansion, MoveSpace, alpha_expansion
from pgm_places.solvers.pairwise import pairwise_model
from tests.reference.energy import Model, best_move, best_score, score
from tests.strategies import Kind, models

REGULAR: tuple[Kind, ...] = ("associative", "metric")


def grid_model(seed: int, n_labels: int, height: int = 40, width: int = 60) -> Model:
    """Rewards between the neighbours of a grid and unaries that are smooth but noisy."""
    rng = np.random.default_rng(seed)
    number = np.arange(height * width).reshape(height, width)
    pairs = [
        np.stack([number[:, :-1].ravel(), number[:, 1:].ravel()], axis=1),
        np.stack([number[:-1].ravel(), number[1:].ravel()], axis=1),
        np.stack([number[:-1, :-1].ravel(), number[1:, 1:].ravel()], axis=1),
    ]
    edges = np.concatenate(pairs)
    unary = rng.integers(-40, 41, (height * width, n_labels)) / 16
    agreement = rng.integers(0, 17, (len(edges), n_labels)) / 16
    return Model(unary, edges, agreement)


def labels_of(found: Expansion) -> tuple[int, ...]:
    return tuple(found.labels.tolist())


@given(models(REGULAR))
def test_no_move_improves_the_labelling(model: Model) -> None:
    found = alpha_expansion(pairwise_model(*model.arrays))
    assert found.converged
    np.testing.assert_allclose(found.score, score(model, labels_of(found)), rtol=0, atol=1e-9)
    for target in range(model.unary.shape[1]):
        assert best_move(model, labels_of(found), target) <= found.score + 1e-9


@given(models(("associative", "agreement", "metric", "tables"), n_labels=st.just(2)))
def test_two_labels_are_solved_exactly_or_refused(model: Model) -> None:
    try:
        found = alpha_expansion(pairwise_model(*model.arrays))
    except InputError as error:
        assert "no expansion on label" in str(error)
        return
    assert found.exact
    np.testing.assert_allclose(found.score, best_score(model), rtol=0, atol=1e-9)


@pytest.mark.parametrize("n_edges", [0, 1])
def test_three_labels_are_solved_exactly_only_where_nothing_links_nodes(n_edges: int) -> None:
    edges, agreement = np.array([[0, 1]])[:n_edges], np.ones((n_edges, 3))
    model = Model(np.array([[0.0, 2.0, 1.0], [5.0, 1.0, 2.0]]), edges, agreement)
    found = alpha_expansion(pairwise_model(*model.arrays))
    assert (found.exact, labels_of(found)) == (not n_edges, (1, 0))


@pytest.mark.parametrize("seed", range(3))
def test_the_same_graph_serves_many_problems(seed: int) -> None:
    first, second = grid_model(seed, 3), grid_model(seed + 100, 3)
    around = adjacency(len(first.unary), first.edges)
    space = MoveSpace(around)
    for model in (first, second, first):
        checked = pairwise_model(model.unary, around, model.agreement)
        again = alpha_expansion(checked, space=space)
        fresh = alpha_expansion(pairwise_model(*model.arrays))
        np.testing.assert_array_equal(again.labels, fresh.labels)
        assert again.score == fresh.score


@pytest.mark.parametrize("seed", range(3))
def test_tables_and_agreement_give_the_same_moves(seed: int) -> None:
    model = grid_model(seed, 3, 20, 20)
    assert model.agreement is not None
    tables = np.zeros((len(model.edges), 3, 3))
    tables[:, range(3), range(3)] = model.agreement
    # Node constants moved into the tables keep them from being read as agreement.
    shift = np.array([0.0, 0.25, 0.5])
    tables += shift[:, None]
    unary = model.unary.copy()
    np.subtract.at(unary, model.edges[:, 0], shift)
    start = model.unary.argmax(axis=1)
    np.testing.assert_array_equal(
        alpha_expansion(pairwise_model(unary, model.edges, pairwise=tables), initial=start).labels,
        alpha_expansion(pairwise_model(*model.arrays), initial=start).labels,
    )


@pytest.mark.parametrize("n_labels", [2, 3])
def test_scores_rise_from_sweep_to_sweep_and_end_at_the_score(n_labels: int) -> None:
    model = grid_model(7, n_labels)
    seen: list[float] = []
    found = alpha_expansion(
        pairwise_model(*model.arrays), on_iteration=lambda _, value: seen.append(value)
    )
    assert len(seen) == found.n_sweeps
    assert seen == sorted(seen)
    np.testing.assert_allclose(seen[-1], found.score, rtol=1e-12)


def test_limit_on_sweeps_is_reported() -> None:
    model, seen = grid_model(7, 3), []
    found = alpha_expansion(
        pairwise_model(*model.arrays),
        max_sweeps=1,
        on_iteration=lambda sweep, _: seen.append(sweep),
    )
    assert not found.converged
    assert seen == [1] and found.n_sweeps == 1


@pytest.mark.parametrize(
    ("agreement", "pairwise", "text"),
    [
        (
            [[0.0, 0.0, 0.0], [1.0, -0.5, 1.0]],
            None,
            r"no expansion on label a=1 over labels b=0, c=2 at edge 1 \(1, 2\): agreement must be "
            r"at least 0, got \[1.0, -0.5, 1.0\]. Use 'trw-s' or another decoder",
        ),
        (
            None,
            [[0.0, -1.0, -5.0], [-1.0, 0.0, -1.0], [-5.0, -1.0, 0.0]],
            r"no expansion on label a=1 over labels b=0, c=2 at edge 0 \(0, 1\)",
        ),
        (
            None,
            [[0.0, -np.inf, -1.0], [-np.inf, 0.0, -1.0], [-1.0, -1.0, 0.0]],
            r"expansion needs finite pairwise .*, got -inf for labels 0 and 1 at edge 0",
        ),
    ],
)
def test_irregular_potentials_are_refused_with_edge_and_labels(
    agreement: list[list[float]] | None, pairwise: list[list[float]] | None, text: str
) -> None:
    with pytest.raises(InputError, match=text):
        alpha_expansion(pairwise_model(np.zeros((3, 3)), [(0, 1), (1, 2)], agreement, pairwise))


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({"unary": [[0.0, -np.inf], [-np.inf, -np.inf]]}, "unary forbids every label at node 1"),
        ({"unary": np.zeros((2, 0))}, "unary must have a column for at least one label"),
        ({"agreement": [[1.0]]}, r"agreement must have shape \(1, 2\), got \(1, 1\)"),
        ({"pairwise": np.zeros((2, 2))}, "give agreement or pairwise, not both"),
        ({"initial": [0, 2]}, "initial must hold integers from 0 to 1, got 2"),
        ({"max_sweeps": 0}, "max_sweeps must be at least 1, got 0"),
        ({"edges": [(0, 5)]}, "edges must hold integers from 0 to 1, got 5"),
    ],
)
def test_bad_problems_are_refused(changed: dict[str, object], text: str) -> None:
    changed = dict(changed)
    problem: dict[str, object] = {
        "unary": [[0.0, 1.0], [1.0, 0.0]],
        "edges": [(0, 1)],
        "agreement": [[1.0, 1.0]],
    }
    potentials = {name: changed.pop(name) for name in [*changed] if name in (*problem, "pairwise")}
    with pytest.raises(InputError, match=text):
        model = pairwise_model(**(problem | potentials))  # type: ignore[arg-type]
        alpha_expansion(model, **changed)  # type: ignore[arg-type]


def test_a_forbidden_start_is_refused() -> None:
    with pytest.raises(InputError, match="initial gives node 1 the label 0, which unary forbids"):
        alpha_expansion(
            pairwise_model([[0.0, 1.0], [-np.inf, 0.0]], [(0, 1)], [[1.0, 1.0]]), initial=[0, 0]
        )
