"""Halls: folded into corridors for whatever is learned, and split off again as one wants them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pgm_places import (
    Labeling,
    LabelledMap,
    OccupancyGrid,
    PlaceLabeler,
    Status,
    evaluate,
    label_map,
    load,
    save,
    trained_labeler,
)
from pgm_places.experiment.config import parse_config
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.runs import compare_fitted
from pgm_places.experiment.tasks import Trained, task_of
from pgm_places.simulation import generate_building
from pgm_places.unary.cell_scorers import without_halls
from pgm_places.unary.halls import HallNames
from pgm_places.unary.options import SpaceOptions
from tests.foyer import foyer_map

HALLS = HallNames(("corridor", "hall", "room", "doorway"))


def test_halls_are_told_apart_only_beside_corridors_and_rooms() -> None:
    assert HallNames.among(("room", "hall", "corridor")) is not None
    assert HallNames.among(("hall", "kitchen", "room")) is None
    assert HALLS.folded == ("corridor", "room", "doorway")
    assert HALLS.shown("hall") == ("corridor", "room", "doorway", "hall")
    assert HALLS.shown("room") == HALLS.shown("corridor") == HALLS.folded


@pytest.mark.parametrize(
    ("halls", "wanted"), [("corridor", 0), ("room", 1), ("hall", 3)], ids=lambda item: str(item)
)
def test_labels_of_halls_become_those_that_are_wanted(halls: Any, wanted: int) -> None:
    labels = np.array([[0, 1, 2, 3, -1]], np.int16)
    item = LabelledMap(OccupancyGrid(np.zeros((1, 5), np.int8), 0.05), labels)
    assert HALLS.fold(item, halls).labels.tolist() == [[0, wanted, 1, 2, -1]]
    assert HALLS.are_halls(item).tolist() == [False, True, False, False]


@pytest.mark.parametrize("halls", ["corridor", "room", "hall"])
def test_a_hall_takes_its_share_of_the_corridor_and_nothing_else(halls: Any) -> None:
    beliefs = np.array([[0.8, 0.1, 0.1], [0.8, 0.1, 0.1], [0.3, 0.6, 0.1]])
    labeling = Labeling(beliefs.argmax(axis=1), Status.EXACT, beliefs=beliefs)
    share = np.array([0.75, 0.25, 1.0], np.float32)
    found = HALLS.split(labeling, share, halls)
    to = HALLS.shown(halls).index(halls)
    assert found.labels.tolist() == [to, 0, 1]
    assert found.beliefs is not None
    np.testing.assert_allclose(found.beliefs.sum(axis=1), 1.0, rtol=0, atol=1e-12)
    if halls == "hall":
        np.testing.assert_allclose(found.beliefs[:, 3], [0.6, 0.2, 0.3], rtol=0, atol=1e-12)
    others = [k for k in range(3) if k not in (0, to)]
    np.testing.assert_array_equal(found.beliefs[:, others], beliefs[:, others])


def test_scores_of_halls_are_added_to_those_of_corridors() -> None:
    rng = np.random.default_rng(0)
    z = rng.dirichlet(np.ones(4), 50)
    found, share = without_halls(np.log(z), 1)
    wanted = z[:, :3] + z[:, 3:] * [0, 1, 0]
    np.testing.assert_allclose(np.exp(found), wanted, rtol=1e-12, atol=0)
    np.testing.assert_allclose(share, z[:, 3] / (z[:, 1] + z[:, 3]), rtol=1e-12, atol=0)


@pytest.fixture(scope="module")
def foyer() -> LabelledMap:
    return foyer_map()


def test_the_shipped_model_knows_halls_and_labels_them_as_corridors_by_default(
    foyer: LabelledMap,
) -> None:
    labeler = trained_labeler("generated")
    named = HallNames(("corridor", "room", "doorway", "hall"))
    by_name = {}
    for halls in ("corridor", "room", "hall"):
        found = label_map(labeler.with_options(halls=halls), foyer.grid)
        assert found.label_names == named.shown(halls)
        truth = named.fold(foyer, halls).labels
        figures = evaluate(truth[truth >= 0], found.labels[truth >= 0], found.label_names)
        assert figures.accuracy > 0.9
        by_name[halls] = found.labels
    hall = by_name["hall"] == 3
    assert hall.any()
    assert (by_name["corridor"][hall] == 0).all()
    assert (by_name["room"][hall] == 1).all()
    for halls in ("corridor", "room"):
        np.testing.assert_array_equal(by_name[halls][~hall], by_name["hall"][~hall])
    assert labeler.halls == "corridor"


def test_a_comparison_takes_true_halls_for_what_they_are_to_be_labelled(
    foyer: LabelledMap,
) -> None:
    labeler = trained_labeler("generated").with_options(halls="room")
    config = parse_config(
        {
            "labels": {"names": ["corridor", "room", "doorway", "hall"]},
            "train": [{"generated": 1}],
            "methods": [{"name": "potts"}],
        }
    )
    labelers = dict.fromkeys(labeler.methods_, labeler)
    trained = Trained(task_of(config), Experiment(config, Path()), labelers)
    *_, found = compare_fitted(trained, [foyer]).methods
    assert found.evaluation.label_names == labeler.label_names_
    assert found.evaluation.accuracy > 0.9


def test_a_labeler_that_learns_halls_keeps_its_choice_when_it_is_saved(tmp_path: Any) -> None:
    made = [generate_building(seed, size="small") for seed in (1, 2)]
    names = ("corridor", "room", "doorway", "hall")
    maps = []
    for item in made:
        labels = np.array(item.labels)
        corridor = np.argwhere(labels == 0)
        half = corridor[corridor[:, 1] < np.median(corridor[:, 1])]
        labels[tuple(half.T)] = 3
        maps.append(LabelledMap(item.grid, labels))
    few = SpaceOptions(n_rounds=10)
    options: dict[str, Any] = {"space": few, "n_folds": 2, "max_examples_per_map": 500}
    labeler = PlaceLabeler(names, ["relaxation"], halls="hall", **options).fit(maps)
    assert labeler.label_names_ == names
    again = load(save(labeler, tmp_path / "model"))
    grid = made[0].grid
    np.testing.assert_array_equal(again.label(grid).labels, labeler.label(grid).labels)
    assert again.label_names_ == names
    folded = again.with_options(halls="corridor")
    assert folded.label_names_ == names[:3]
    assert folded.label(grid).labels.max() < 3
    assert labeler.score(maps) > 0.9
