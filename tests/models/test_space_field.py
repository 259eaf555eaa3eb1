"""The field over cells, gates and places against brute force, and what each weight does."""

from typing import Any

import numpy as np
import pytest

from pgm_places.errors import ConfigError, InputError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.labeling import Status
from pgm_places.inference.potentials import score
from pgm_places.inference.problem import LabelingProblem
from pgm_places.models.mrf import PottsField
from pgm_places.models.space_field import SpaceField
from tests.reference.space_field import DOORWAY, NAMES, TinyFloor

CORRIDOR, ROOM = 0, 1


def floor(seed: int) -> TinyFloor:
    """Four cells, the middle ones at a gate between two places; one cell may lie in no place."""
    rng = np.random.default_rng(seed)
    return TinyFloor(
        log_z=np.log(rng.dirichlet(np.ones(3), 4)),
        place_of_cell=((0, 0, 1, 1), (0, -1, 1, 1), (0, 0, 0, 1))[seed % 3],
        cells_of_gate=((1, 2),),
        sides_of_gate=((0, 1),),
        probability=(float(rng.uniform(0.05, 0.95)),),
        n_places=2,
    )


def weights(seed: int) -> dict[str, Any]:
    names = ("weight", "place_weight", "doorway_weight", "gate_weight", "passage_weight")
    drawn = np.random.default_rng(100 + seed).uniform(0, 2, len(names)).tolist()
    threshold = (0.3, 0.5, 0.7)[seed % 3]
    return {**dict(zip(names, drawn, strict=True)), "gate_threshold": threshold}


@pytest.mark.parametrize("seed", range(6))
def test_every_labelling_scores_what_the_definition_says(seed: int) -> None:
    given, chosen = floor(seed), weights(seed)
    problem = given.problem
    potentials = SpaceField(**chosen).potentials(problem)
    for labels in given.labelings():
        expected = given.score(labels, **chosen)
        assert score(problem.graph, potentials, labels) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("decoder", ["graph-cut", "trw-s", "lp"])
@pytest.mark.parametrize("seed", range(6))
def test_found_labels_and_bounds_hold_against_brute_force(seed: int, decoder: str) -> None:
    given, chosen = floor(seed), weights(seed)
    best = max(given.score(labels, **chosen) for labels in given.labelings())
    found = SpaceField(**chosen, inference=decoder, certify=True).infer(given.problem)  # type: ignore[arg-type]
    assert found.score == pytest.approx(given.score(tuple(found.labels), **chosen), abs=1e-9)
    assert found.score is not None and found.bound is not None
    assert found.score <= best + 1e-9 <= found.bound + 2e-6
    if found.status is Status.EXACT:
        assert found.score == pytest.approx(best, abs=1e-6)


def one_place(n_doubtful: int) -> TinyFloor:
    """Five cells of one place; the first is clearly room, some of the others lean to corridor."""
    room, leaning = [0.02, 0.97, 0.01], [0.55, 0.44, 0.01]
    rows = [room] * (5 - n_doubtful) + [leaning] * n_doubtful
    return TinyFloor(np.log(rows), (0,) * 5, (), (), (), 1)


def test_a_place_wins_over_its_doubtful_cells() -> None:
    problem = one_place(2).problem
    without = SpaceField(weight=0.0, place_weight=0.0).infer(problem)
    with_place = SpaceField(weight=0.0, place_weight=0.5).infer(problem)
    assert without.labels[:5].tolist() == [ROOM] * 3 + [CORRIDOR] * 2
    assert with_place.labels.tolist() == [ROOM] * 6


def test_a_sure_cell_overrules_its_place() -> None:
    rows = [[0.1, 0.89, 0.01]] * 4 + [[0.98, 0.01, 0.01]]
    given = TinyFloor(np.log(rows), (0,) * 5, (), (), (), 1)
    found = SpaceField(weight=0.0, place_weight=0.5).infer(given.problem)
    assert found.labels.tolist() == [ROOM] * 4 + [CORRIDOR, ROOM]


@pytest.mark.parametrize(("probability", "expected"), [(0.9, DOORWAY), (0.1, ROOM)])
def test_a_gate_decides_for_its_cells(probability: float, expected: int) -> None:
    log_z = np.log([[0.01, 0.98, 0.01], [0.01, 0.97, 0.02], [0.01, 0.97, 0.02], [0.01, 0.98, 0.01]])
    given = TinyFloor(log_z, (0, 0, 1, 1), ((1, 2),), ((0, 1),), (probability,), 2)
    found = SpaceField(weight=0.0, gate_threshold=0.5).infer(given.problem)
    assert found.labels[:4].tolist() == [ROOM, expected, expected, ROOM]
    assert (found.labels[4] == DOORWAY) == (expected == DOORWAY)


@pytest.mark.parametrize(("probability", "expected"), [(0.02, ROOM), (0.98, CORRIDOR)])
def test_places_agree_across_a_gate_that_is_no_doorway(probability: float, expected: int) -> None:
    """The place on the right is in doubt; only a doorway may part it from the room."""
    room, doubtful = [0.02, 0.97, 0.01], [0.6, 0.39, 0.01]
    log_z = np.log([room] * 3 + [doubtful] * 2)
    given = TinyFloor(log_z, (0, 0, 0, 1, 1), ((2, 3),), ((0, 1),), (probability,), 2)
    found = SpaceField(weight=0.0, passage_weight=1.0).infer(given.problem)
    assert found.labels[-2:].tolist() == [ROOM, expected]


def test_graphs_of_cells_alone_are_potts_fields() -> None:
    rng = np.random.default_rng(3)
    graph = LabelGraph.from_grid(np.ones((5, 6), np.bool_))
    problem = LabelingProblem(graph, NAMES, np.log(rng.dirichlet(np.ones(3), 30)))
    found, expected = SpaceField(weight=0.6).infer(problem), PottsField(0.6).infer(problem)
    assert found.labels.tolist() == expected.labels.tolist()
    assert found.score == expected.score


def test_the_order_of_labels_does_not_matter() -> None:
    """Doorways are known by what places forbid, not by their index."""
    given = floor(1)
    problem, turn = given.problem, [2, 0, 1]
    assert problem.unary is not None
    turned = LabelingProblem(problem.graph, ("doorway", "corridor", "room"), problem.unary[:, turn])
    method = SpaceField(**weights(1), inference="trw-s")
    found, other = method.infer(problem), method.infer(turned)
    assert other.score == pytest.approx(found.score)
    assert np.array(turn)[other.labels].tolist() == found.labels.tolist()


def test_mean_field_gives_beliefs_of_all_nodes() -> None:
    found = SpaceField(inference="mean-field").infer(floor(0).problem)
    assert found.beliefs is not None
    np.testing.assert_allclose(found.beliefs.sum(axis=1), 1.0, rtol=0, atol=1e-9)


def test_known_labels_hold_at_cells_gates_and_places() -> None:
    problem = floor(0).problem
    for node, label in ((0, CORRIDOR), (4, ROOM), (4, DOORWAY), (6, CORRIDOR), (6, ROOM)):
        known = np.full(problem.graph.n_nodes, -1)
        known[node] = label
        given = LabelingProblem(problem.graph, NAMES, problem.unary, known=known)
        assert SpaceField(gate_weight=0.0).infer(given).labels[node] == label


def test_what_is_refused() -> None:
    with pytest.raises(ConfigError, match="place_weight"):
        SpaceField(place_weight=-1.0)
    graph = LabelGraph.from_edges(2, [(0, 1)], node_kind=[0, 1])
    with pytest.raises(InputError, match="node_kind but no edge_kind"):
        SpaceField().infer(LabelingProblem(graph, NAMES, np.zeros((2, 3))))
    with pytest.raises(InputError, match="needs unary"):
        SpaceField().infer(LabelingProblem(graph, NAMES, node_features=np.zeros((2, 1))))
