"""Why a cell has its label: parts that sum to what was computed."""

from functools import cache

import numpy as np
import pytest

from pgm_places import LabelledMap, PlaceLabeler
from pgm_places.errors import InputError
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.simulation import generate_building
from pgm_places.teaching.explanation import explain_cell, explain_region
from pgm_places.teaching.interactive_labeler import InteractiveLabeler, InteractiveResult
from pgm_places.teaching.reasons import CellExplanation
from pgm_places.trained import trained_labeler

MADE = generate_building(4, size="small", resolution_m=0.05)


@cache
def taught() -> InteractiveResult:
    teacher = InteractiveLabeler(MADE.grid, trained_labeler())
    return teacher.teach(teacher.blank().with_cells([[30, 30]], None))


def log_z(found: CellExplanation) -> dict[str, float]:
    """The histogram z (eq. 8) from the questions, gates and networks, halls among corridors."""
    shares, left = {}, 1.0
    for question in found.questions:
        yes = 1 / (1 + np.exp(-question.log_odds))
        shares[question.label] = left * yes
        left *= 1 - yes
    [last] = {"corridor", "room", "doorway", "hall"} - set(shares)
    shares[last] = left
    shares["corridor"] += shares.pop("hall")
    shares["doorway"] *= np.exp(found.gate_log_odds)
    if found.networks is not None:
        total = sum(shares.values())
        for name, weight in found.network_shares.items():
            shares[name] = (shares[name] / total) ** (1 - weight) * found.networks[name] ** weight
    total = sum(shares.values())
    return {name: value / total for name, value in shares.items()}


def positions(n: int) -> list[list[float]]:
    cells = np.argwhere(taught().topology.region > 0)
    chosen = np.random.default_rng(1).permutation(len(cells))[:n]
    return MADE.grid.cell_centres_m(cells[chosen]).tolist()


@pytest.mark.parametrize("number", range(8))
def test_votes_and_gates_give_the_probabilities_before_the_graph(number: int) -> None:
    x, y = positions(8)[number]
    found = explain_cell(taught(), x, y)
    assert found.probabilities_alone is not None
    shares = log_z(found)
    if found.doorway_log_odds:
        shares["doorway"] *= np.exp(found.doorway_log_odds)
        shares = {name: share / sum(shares.values()) for name, share in shares.items()}
    assert shares == pytest.approx(found.probabilities_alone, rel=0, abs=1e-4)
    for question in found.questions:
        whole = question.bias + question.from_scan + question.from_spaces
        assert whole == pytest.approx(question.log_odds, rel=0, abs=1e-9)
    assert found.region is not None and found.probabilities is not None
    assert len(found.ranges_m) == len(found.angles_rad) == 360


def test_doorways_are_likely_in_the_middle_of_accepted_gates() -> None:
    doorways = taught().labelled.doorways
    assert doorways is not None
    gate = doorways.gates[0]
    assert explain_cell(taught(), *gate.centre_m).doorway_log_odds == 0
    ahead = np.array([np.cos(gate.heading_rad), np.sin(gate.heading_rad)])
    beyond = gate.centre_m + ahead * (gate.depth_m / 2 + 0.7)
    assert explain_cell(taught(), *beyond.tolist()).doorway_log_odds == np.log(0.4)
    others = {explain_cell(taught(), x, y).doorway_log_odds for x, y in positions(20)}
    assert np.log(0.02) in others
    without = taught().labeler.method("adaboost")
    assert taught().labeler.doorway_at_gates(without) is None


def test_beams_end_at_walls() -> None:
    found = explain_cell(taught(), *taught().topology.regions[0].anchor_m)
    x, y = found.x_m, found.y_m
    ends = np.array([x, y]) + found.ranges_m[:, None] * np.stack(
        [np.cos(found.angles_rad), np.sin(found.angles_rad)], axis=1
    )
    beyond = ends + 0.05 * (ends - [x, y]) / found.ranges_m[:, None]
    cells = MADE.grid.cells_at_m(beyond).clip(0, np.array(MADE.grid.shape) - 1)
    assert (~MADE.grid.free[tuple(cells.T)]).mean() > 0.9


def test_unreachable_space_has_no_label_to_explain() -> None:
    unentered = taught().labelled.unentered
    assert unentered is not None
    x, y = MADE.grid.cell_centres_m(np.argwhere(unentered.cells)[:1])[0].tolist()
    with pytest.raises(InputError, match=r"cannot reach the space at .*, so it has no label"):
        explain_cell(taught(), x, y)


def test_where_the_graph_changes_a_label_neighbours_pull_to_it() -> None:
    changed = np.argwhere((taught().labels != taught().unary_labels) & (taught().labels >= 0))
    if not len(changed):
        pytest.skip("the graph changes nothing on this map")
    x, y = MADE.grid.cell_centres_m(changed[:1])[0].tolist()
    found = explain_cell(taught(), x, y)
    assert found.label != found.alone
    assert sum(item.towards for item in found.neighbours) > 0


def test_painted_cells_say_so_and_on_a_turned_map_too() -> None:
    turned = OccupancyGrid(MADE.grid.cells, 0.05, (3.0, -2.0), 0.7)
    teacher = InteractiveLabeler(turned, trained_labeler())
    cell = np.argwhere(MADE.grid.free)[500]
    found = teacher.label(teacher.blank().with_cells([cell], "doorway"))
    x, y = turned.cell_centres_m([cell])[0].tolist()
    why = explain_cell(found, x, y)
    assert why.painted and why.label == "doorway"
    assert why.probabilities == {"corridor": 0, "room": 0, "doorway": 1}
    assert why.x_m == pytest.approx(x, abs=0.1) and why.y_m == pytest.approx(y, abs=0.1)


def test_regions_have_shapes_and_gates() -> None:
    room = max(taught().topology.regions, key=lambda region: region.area_m2)
    found = explain_region(taught(), room.id)
    assert found.features["area"] > 0
    assert found.gates and all(0 <= p <= 1 for _, p in found.gates)
    assert [p for _, p in found.gates] == sorted((p for _, p in found.gates), reverse=True)
    with pytest.raises(InputError, match="there is no place 'attic'"):
        explain_region(taught(), "attic")


def test_a_labeler_of_scans_only() -> None:
    classifier = DecisionListClassifier(n_rounds=15, order="rarest-first")
    names = MADE.label_names
    methods = ["independent"]
    labeler = PlaceLabeler(names, methods, classifier=classifier, space=None, unary="laser")
    labeler.fit([LabelledMap(MADE.grid, MADE.labels)])
    teacher = InteractiveLabeler(MADE.grid, labeler)
    found = teacher.label(teacher.blank())
    [(x, y)] = positions(1)
    why = explain_cell(found, x, y)
    assert why.gate_probability is None and why.probabilities_alone is not None
    assert not any(vote.of_space for question in why.questions for vote in question.votes)
    first = why.questions[0]
    share = 1 / (1 + np.exp(-first.log_odds))
    assert share == pytest.approx(why.probabilities_alone[first.label], rel=0, abs=1e-4)
    assert explain_region(found, found.topology.regions[0].id).features == {}


def test_positions_off_the_map_are_refused() -> None:
    with pytest.raises(InputError, match=r"there is no free cell at \(-100, 0\)"):
        explain_cell(taught(), -100, 0)
