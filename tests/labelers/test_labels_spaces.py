"""A method that labels gates and places together with the cells, behind PlaceLabeler."""

from copy import copy
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from pgm_places import LabelledMap, PlaceLabeler
from pgm_places.datasets import LabelledBuilding, generate_building
from pgm_places.errors import ConfigError, InputError
from pgm_places.graph.node_kind import NodeKind
from pgm_places.labelers.label_map import label_map
from pgm_places.labelers.method import PlaceMethod
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.models.space_field import SpaceField
from pgm_places.persistence.stored import load, save
from pgm_places.unary.options import SpaceOptions

NAMES = ("corridor", "room", "doorway")


@cache
def building() -> LabelledBuilding:
    return generate_building(9, size="small", resolution_m=0.1)


@cache
def labeler() -> PlaceLabeler:
    unfitted = PlaceLabeler(
        NAMES,
        {"alone": "independent", "field": SpaceField(place_weight=0.4)},
        classifier=DecisionListClassifier(n_rounds=10, order="rarest-first"),
        space=SpaceOptions(n_rounds=20),
        n_folds=2,
    )
    return unfitted.fit([LabelledMap(building().grid, building().labels)])


def test_the_labeling_is_that_of_the_cells_in_the_whole_graph() -> None:
    grid = building().grid
    problem = labeler().problem(grid, method="field")
    kinds = problem.graph.node_kind
    assert kinds is not None and {*kinds} == {*NodeKind}
    whole = SpaceField(place_weight=0.4).infer(problem)
    found = labeler().label(grid, method="field")
    assert len(found.labels) == grid.free.sum() == (kinds == NodeKind.CELL).sum()
    assert np.array_equal(found.labels, whole.labels[: len(found.labels)])
    assert found.score == whole.score


def test_label_map_and_parts_of_maps_take_the_same_way() -> None:
    grid = building().grid
    found = label_map(labeler(), grid, method="field")
    assert np.array_equal(found.labels[grid.free], labeler().label(grid, method="field").labels)
    mask = np.zeros(grid.shape, np.bool_)
    mask[:, : grid.shape[1] // 2] = True
    part = labeler().label(grid, method="field", mask=mask)
    assert len(part.labels) == (grid.free & mask).sum()


def test_without_links_and_weights_the_field_is_the_list_where_there_is_no_gate() -> None:
    grid = building().grid
    graph, scores = labeler().scores(grid)
    assert scores.spaces is not None and scores.space is not None
    nothing = SpaceField(weight=0.0, place_weight=0.0, gate_weight=0.0, doorway_weight=0.0)
    problem = labeler().problem_of(graph, scores, PlaceMethod(nothing, "space"))
    found = nothing.infer(problem).labels[: graph.n_nodes]
    far = scores.spaces.at_gates(graph.layout) == 0  # type: ignore[arg-type]
    assert far.any()
    assert np.array_equal(found[far], scores.space.argmax(axis=1)[far])


def test_a_stored_model_labels_alike(tmp_path: Path) -> None:
    save(labeler(), tmp_path / "model")
    loaded = load(tmp_path / "model")
    assert isinstance(loaded, PlaceLabeler)
    assert loaded.method("field").backend == SpaceField(place_weight=0.4)
    before, after = (one.label(building().grid, method="field") for one in (labeler(), loaded))
    assert np.array_equal(before.labels, after.labels)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"methods": {"field": PlaceMethod("space_field", "laser")}},
            "method 'field' labels gates and places, so it needs unary = 'space', got 'laser'",
        ),
        ({"space": None}, "so it needs unary = 'space', got 'laser'"),
        (
            {"label_names": ("corridor", "room", "door")},
            r"one of the labels must be that of doorways; .* \(doorway_label\)",
        ),
    ],
)
def test_what_knows_no_gates_is_refused_before_learning(
    options: dict[str, object], message: str
) -> None:
    given: dict[str, object] = {"label_names": NAMES, "methods": ["space_field"], **options}
    with pytest.raises(ConfigError, match=message):
        PlaceLabeler(**given).fit([LabelledMap(building().grid, building().labels)])  # type: ignore[arg-type]


def test_scores_without_spaces_are_refused() -> None:
    graph, scores = labeler().scores(building().grid, methods=["alone"])
    without = copy(scores)
    object.__setattr__(without, "spaces", None)
    with pytest.raises(InputError, match="SpaceField labels gates and places, and these scores"):
        labeler().infer(graph, without, method="field")
