"""Places, their connections, and what can be asked of them."""

from dataclasses import replace

import networkx as nx
import numpy as np
import pytest

from pgm_places.errors import InputError, LabelError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.layout import GridLayout
from pgm_places.maps.coarsening import coarsen
from pgm_places.topology.from_labels import topological_map
from tests.refusals import refused
from tests.topology.floors import NAMES, floor_grid, floor_labels, floor_map, gates_of


def test_the_floor_has_seven_places_and_six_connections() -> None:
    found = floor_map()
    assert [r.name for r in found.regions] == [
        *("room 1", "room 2", "room 3", "corridor 4"),
        *("doorway 5", "doorway 6", "doorway 7"),
    ]
    assert [r.id for r in found.regions] == list(range(1, 8))
    pairs = [(c.first, c.second) for c in found.connections]
    assert pairs == [(1, 5), (2, 6), (3, 7), (4, 5), (4, 6), (4, 7)]
    for connection in found.connections:
        assert connection.border_m == pytest.approx(1.5)
        assert connection.width_m == pytest.approx(1.5)
    assert found.connections[0].point_m == pytest.approx((2.25, 2.5))
    np.testing.assert_array_equal(found.labels, floor_labels())


@pytest.mark.parametrize("with_doorways", [False, True])
def test_specks_that_touch_nothing_are_no_places(with_doorways: bool) -> None:
    labels = np.pad(floor_labels(), ((0, 3), (0, 0)), constant_values=-1)
    labels[12, 2:4] = 1
    grid = floor_grid(labels)
    doorways = gates_of(grid) if with_doorways else None
    found = topological_map(grid, labels, NAMES, doorways=doorways)
    assert [(c.was, c.became) for c in found.corrections if c.reason == "touches nothing"] == [
        ("room", "")
    ]
    assert (found.region[12] == 0).all()
    kept = topological_map(grid, labels, NAMES, doorways=doorways, correct=False)
    assert (kept.region[12, 2:4] > 0).all()


def test_questions() -> None:
    found = floor_map(yaw_rad=0.4, origin_xy_m=(5.0, -3.0))
    way = found.path("room 1", "room 3")
    assert [r.name for r in way] == ["room 1", "doorway 5", "corridor 4", "doorway 7", "room 3"]
    doors = ["doorway 5", "doorway 6", "doorway 7"]
    assert [r.name for r in found.neighbours("corridor 4")] == doors
    assert [r.name for r in found.neighbours(1)] == ["doorway 5"]
    for region in found.regions:
        assert found.region_at(*region.anchor_m) is region
    assert found.region_at(-100.0, 0.0) is None
    [[x, y]] = found.grid.cell_centres_m([[0, 0]])
    assert found.region_at(x, y) is None  # a wall


def test_the_cells_of_a_doorway() -> None:
    found = floor_map()
    assert found.cells("doorway 5").tolist() == [[4, 3], [4, 4], [4, 5]]
    for region in found.regions:
        rows, columns = found.cells(region.id).T
        assert (found.region[rows, columns] == region.id).all()
        assert len(rows) == (found.region == region.id).sum()


def test_unknown_places_and_missing_ways() -> None:
    labels = floor_labels()
    labels[4, 3:6] = -1  # the first doorway is walled up
    found = topological_map(floor_grid(labels), labels, NAMES)
    refused(InputError, "no path leads from 'room 1' to 'room 2'", found.path, "room 1", "room 2")
    refused(InputError, r"there is no place 'rom 1'\. Did you mean 'room 1'", found.place, "rom 1")
    refused(InputError, "there is no place 99", found.place, 99)


def test_known_places_are_listed_in_the_order_of_their_numbers() -> None:
    found = floor_map()
    names = ("room 10", "room 2", "room 1", *(region.name for region in found.regions[3:]))
    regions = (replace(r, name=name) for r, name in zip(found.regions, names, strict=True))
    with pytest.raises(InputError) as refusal:
        replace(found, regions=tuple(regions)).place("attic")
    assert str(refusal.value) == (
        "there is no place 'attic'. Known: corridor 4, doorway 5, doorway 6, doorway 7, "
        "room 1, room 2, room 10"
    )


def test_a_class_without_a_name_on_the_map_is_no_place() -> None:
    wanted = r"there is no class or place 'hall'\. Known: corridor, corridor 4, doorway, doorway"
    with pytest.raises(InputError, match=wanted):
        floor_map().ids_of(["hall"])


def test_places_are_joined_by_doorways() -> None:
    places = floor_map().place_graph
    edges = sorted((a, b, values["doorway"]) for a, b, values in places.edges(data=True))
    assert edges == [(1, 4, 5), (2, 4, 6), (3, 4, 7)]
    assert places.nodes[4]["name"] == "corridor 4"
    assert places.edges[1, 4, 0]["width_m"] == pytest.approx(1.5)


def test_touching_doorways_count_as_one_and_rooms_may_touch() -> None:
    labels = np.array([[1, 1, 2, -1, 0, 0], [1, 1, -1, 2, 0, 0]], np.int16)
    labels[0, 2], labels[1, 3] = 2, 2
    found = topological_map(floor_grid(labels), labels, NAMES, correct=False)
    [(first, second, values)] = found.place_graph.edges(data=True)
    assert (first, second, values["doorway"]) == (1, 2, 3)
    open_plan = np.array([[1, 1, 0, 0]], np.int16)
    found = topological_map(floor_grid(open_plan), open_plan, NAMES, correct=False)
    assert [values["doorway"] for *_, values in found.place_graph.edges(data=True)] == [0]


def test_ids_and_names_survive_a_change_of_the_map() -> None:
    before = floor_map()
    labels = floor_labels()
    labels[5:10, 9:16] = -1  # the second room is gone with its doorway
    labels[4, 11:14] = -1
    labels[9, 1:8] = -1  # the first is smaller
    grown = np.pad(labels, ((2, 3), (4, 4)), constant_values=-1)
    grown[6:10, 1:4] = 1  # and there is a new one on the left
    after = topological_map(
        floor_grid(grown, origin_xy_m=(-2.0, -1.0)), grown, NAMES, known=before.known_places
    )
    assert [(r.id, r.name) for r in after.regions] == [
        (1, "room 1"),
        (3, "room 3"),
        (4, "corridor 4"),
        (5, "doorway 5"),
        (7, "doorway 7"),
        (8, "room 8"),
    ]
    assert after.next_id == 9


def test_the_users_names_win_and_must_differ() -> None:
    labels = floor_labels()
    grid = floor_grid(labels)
    found = topological_map(grid, labels, NAMES, own_names={2: "kitchen"})
    assert found.place("kitchen").id == 2
    with pytest.raises(LabelError, match="places 2 and 3 are both named 'kitchen'"):
        topological_map(grid, labels, NAMES, own_names={2: "kitchen", 3: "kitchen"})


@pytest.mark.parametrize("factor", [1, 2])
def test_confidence_is_the_mean_belief_in_the_final_label(factor: int) -> None:
    labels = np.repeat(np.repeat(floor_labels(), 2, axis=0), 2, axis=1)
    grid = floor_grid(labels)
    coarse = grid if factor == 1 else coarsen(grid, 1.0)
    layout = LabelGraph.from_grid(coarse).layout
    assert isinstance(layout, GridLayout)
    beliefs = np.tile([0.2, 0.7, 0.1], (len(layout.cells_rc), 1))
    found = topological_map(grid, labels, NAMES, beliefs=beliefs, layout=layout)
    assert found.place("room 1").confidence == pytest.approx(0.7)
    assert found.place("corridor 4").confidence == pytest.approx(0.2)
    with pytest.raises(InputError, match="pass layout as well"):
        topological_map(grid, labels, NAMES, beliefs=beliefs)


def test_labels_of_walls_are_not_looked_at() -> None:
    labels = floor_labels()
    grid = floor_grid(labels)
    filled = np.where(labels < 0, 1, labels)
    assert len(topological_map(grid, filled, NAMES).regions) == 7


def test_a_hole_in_a_wall_connects_nothing_where_a_width_is_asked_for() -> None:
    labels = floor_labels()
    labels[4, 7] = 1  # room 1 reaches the corridor through a hole of one cell
    grid = floor_grid(labels)
    holed = topological_map(grid, labels, NAMES)
    assert {r.name for r in holed.neighbours("room 1")} == {"corridor 4", "doorway 5"}
    sealed = topological_map(grid, labels, NAMES, min_width_m=0.6)
    assert [r.name for r in sealed.neighbours("room 1")] == ["doorway 5"]


def test_of_several_passages_to_adjacent_doorways_the_widest_counts() -> None:
    found = floor_map()
    doors = [region.id for region in found.regions if region.label == "doorway"][:2]
    rooms = [region.id for region in found.regions if region.label != "doorway"][:2]
    graph: nx.Graph[int] = nx.Graph()
    graph.add_nodes_from(found.graph.nodes(data=True))
    graph.add_edge(rooms[0], doors[0], width_m=1.5)
    graph.add_edge(rooms[0], doors[1], width_m=0.5)
    graph.add_edge(rooms[1], doors[0], width_m=0.9)
    graph.add_edge(*doors, width_m=0.7)
    vars(found)["graph"] = graph  # a cached property
    [(_, _, values)] = found.place_graph.edges(data=True)
    assert (values["doorway"], values["width_m"]) == (min(doors), 0.9)
