"""What training and test have in common is said in one line."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pgm_places import LabelGraph, LabelingProblem, OccupancyGrid, Trajectory
from pgm_places.experiment.config import parse_config
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.graphs import SourceGraph
from pgm_places.experiment.sources import SourceDrive
from pgm_places.experiment.splits import warn_of_overlap
from pgm_places.maps.labelled_map import LabelledMap

NAMES = ("room", "corridor")


def floor(name: str, seed: int = 0, *, building: str | None = None, **changes: Any) -> LabelledMap:
    """40 labelled cells of one raster; without a name for its building, that is the raster's."""
    cells = np.zeros((5, 8), np.int8)
    cells[seed // 8, seed % 8] = 100
    found = LabelledMap(OccupancyGrid(cells, 0.1), np.zeros((5, 8), np.int16), None, name)
    return replace(found, building=building or f"{seed}.yaml", **changes)


def half(item: LabelledMap, *, left: bool) -> LabelledMap:
    return replace(item, window=np.broadcast_to((np.arange(8) < 4) == left, (5, 8)))


def warned(
    train: Any, test: Any, nodes: str = "cells", buildings: tuple[Any, Any] = ({}, {})
) -> Any:
    """The warnings of a configuration whose sources are these."""
    source = {"graph": "a.graphml"} if nodes == "graph" else {"log": "a.log", "map": "a.yaml"}
    sources = [{"map": "a.yaml", "labels": "a.png"} if nodes == "cells" else source] * 2
    config = parse_config(
        {
            "nodes": nodes,
            "labels": {"names": list(NAMES)},
            "train": [sources[0] | buildings[0]],
            "test": [sources[1] | buildings[1]],
            "methods": [{"name": "independent"}],
        }
    )
    experiment = Experiment(config, Path())
    warn_of_overlap(experiment, train, test)
    return experiment.warnings


def test_cells_of_a_map_that_is_trained_on_are_counted() -> None:
    """Under whatever name: it is the raster that counts."""
    [message] = warned(
        [floor("a"), floor("b", 1)], [floor("copy of a", building="copy"), floor("c", 2)]
    )
    assert message == (
        "39 of 78 labelled test cells are also trained on (copy of a): results on them are "
        "over-optimistic; test on other maps, or on other parts of these"
    )


def test_parts_of_a_map_may_be_trained_and_tested_on() -> None:
    whole = floor("a")
    left, right = half(whole, left=True), half(whole, left=False)
    assert warned([left], [right]) == []
    [message] = warned([left], [whole])
    assert message.startswith("19 of 39 labelled test cells")


def test_a_building_that_is_named_on_both_sides_is_named() -> None:
    one, other = floor("a", building="B79"), floor("b", 1, building="B79")
    named = {"building": "B79"}
    [message] = warned([one], [other], buildings=(named, named))
    assert message == (
        "[[train]] and [[test]] share a building (B79): results are over-optimistic for other "
        "buildings; test in another building"
    )
    assert warned([one], [floor("c", 2)], buildings=(named, {})) == []


def test_maps_simulated_from_one_plan_are_of_one_building() -> None:
    plan = floor("plan", 1, building="plan.yaml")
    [message] = warned([plan], [floor("as a robot sees it", 2, building="plan.yaml")])
    assert "share a building (plan.yaml)" in message


def drive(steps: slice) -> SourceDrive:
    poses = np.column_stack([np.arange(10.0), np.zeros((10, 2))])
    path = Trajectory(np.arange(10.0), poses, labels=np.array([-1] + [0] * 9), label_names=NAMES)
    return SourceDrive(path[steps], floor("its map"))


def test_steps_of_one_log_are_known_again() -> None:
    [message] = warned([drive(slice(0, 6))], [drive(slice(4, 10))], "steps")
    assert message.startswith("2 of 6 labelled test steps are also trained on")
    assert "test on other drives" in message
    assert warned([drive(slice(0, 5))], [drive(slice(5, 10))], "steps") == []


def test_cells_count_with_steps_where_both_are_labelled() -> None:
    messages = warned([drive(slice(0, 5))], [drive(slice(5, 10))], "both")
    assert [message.split(" are")[0] for message in messages] == ["39 of 39 labelled test cells"]


def test_labels_of_one_graph_may_be_divided() -> None:
    graph = LabelGraph.from_lattice((6,))
    problem = LabelingProblem(graph, NAMES, node_features=np.arange(6.0)[:, None])
    truth = np.array([0, 1, 0, 1, -1, -1])
    whole = SourceGraph("ring", problem, truth, "ring.graphml", (("x",), ()))
    seen = np.arange(6) < 2
    parts = [whole.with_labels_at(seen)], [whole.with_labels_at(~seen)]
    assert warned(*parts, "graph") == []
    [message] = warned(parts[0], [replace(whole, name="copy")], "graph")
    assert message.startswith("2 of 4 labelled test nodes are also trained on (copy)")
    other = replace(whole, problem=replace(problem, node_features=np.ones((6, 1))))
    assert warned([whole], [other], "graph") == []


def test_of_many_maps_some_are_named() -> None:
    [message] = warned([floor("a")], [floor(f"copy {n}", building=str(n)) for n in range(5)])
    assert "(copy 0, copy 1, copy 2 and 2 more)" in message
