"""Learning from spaces: gates judged without their building, and a labeler that sees spaces."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pgm_places import LabelledMap, OccupancyGrid, PlaceLabeler, Sensor, evaluate, load, save
from pgm_places.errors import ConfigError
from pgm_places.simulation import generate_building
from pgm_places.unary.learning import UnaryLearner
from pgm_places.unary.list_learning import without_a_domain
from pgm_places.unary.map_model import UnaryModel
from pgm_places.unary.options import MIXED, UNARIES, ClassifierOptions, SpaceOptions
from pgm_places.unary.space_model import learn_spaces
from pgm_places.unary.training_cells import TrainingCells, _chosen

NAMES = ("corridor", "room", "doorway")
FEW = SpaceOptions(n_rounds=20, max_examples_per_map=2000)


def building(seed: int) -> LabelledMap:
    found = generate_building(seed, size="small")
    return LabelledMap(found.grid, found.labels, name=f"building {seed}")


@pytest.fixture(scope="module")
def known() -> list[LabelledMap]:
    return [building(seed) for seed in (1, 2, 3)]


@pytest.fixture(scope="module")
def labeler(known: list[LabelledMap]) -> PlaceLabeler:
    methods = {"laser": "independent", "space": "independent"}
    few = ClassifierOptions(n_rounds=10).classifier(NAMES)
    return PlaceLabeler(
        NAMES,
        methods,
        classifier=few,
        space=FEW,
        n_folds=2,
        max_examples_per_map=3000,
        unary="space",
    ).fit(known)


def test_it_labels_a_building_that_it_has_not_seen(labeler: PlaceLabeler) -> None:
    other = building(4)
    found = labeler.label(other.grid, method="space")
    figures = evaluate(other.truth(other.graph()), found.labels, NAMES)
    assert figures.accuracy > 0.95
    assert figures.balanced_accuracy > 0.85


@pytest.mark.parametrize("n_threads", [1, 3])
def test_threads_do_not_change_a_bit(labeler: PlaceLabeler, n_threads: int) -> None:
    grid = building(4).grid
    _, scores = labeler.scores(grid, n_threads=n_threads)
    _, reference = labeler.scores(grid, n_threads=2)
    np.testing.assert_array_equal(scores.space, reference.space, strict=True)


def test_saved_and_loaded_it_says_the_same(labeler: PlaceLabeler, tmp_path: Path) -> None:
    grid = building(4).grid
    again = load(save(labeler, tmp_path / "model"))
    _, before = labeler.scores(grid)
    _, after = again.scores(grid)
    np.testing.assert_array_equal(before.space, after.space, strict=True)


def test_gates_are_judged_by_lists_that_have_not_seen_their_building(
    known: list[LabelledMap],
) -> None:
    def learned(maps: list[LabelledMap]) -> np.ndarray:
        cells = TrainingCells.of(maps, Sensor(), limit=200)
        return learn_spaces(cells, 2).spaces[0].probability

    turned = LabelledMap(
        known[0].grid, np.where(known[0].labels == 2, 1, known[0].labels), name="no doors"
    )
    # Other labels of the building itself do not change what is said of its gates.
    np.testing.assert_array_equal(learned(known), learned([turned, *known[1:]]))


def test_without_a_label_of_doorways_no_gate_is_one(known: list[LabelledMap]) -> None:
    labels = np.where(known[0].labels == 2, 0, known[0].labels)
    plain = LabelledMap(known[0].grid, labels)
    fitted = PlaceLabeler(NAMES[:2], space=FEW, max_examples_per_map=1000).fit([plain])
    model = fitted.unary_model_.space
    assert model is not None
    assert model.gates is None
    assert not model.spaces(plain.grid).places.accepted.any()
    truth = plain.truth(plain.graph())
    assert (fitted.label(plain.grid).labels == truth)[truth >= 0].mean() > 0.9


def test_a_map_of_one_open_space_has_no_gates() -> None:
    cells = np.zeros((30, 40), np.int8)
    labels = np.where(np.arange(40) < 20, 0, 1) * np.ones((30, 1), np.int16)
    item = LabelledMap(OccupancyGrid(cells, resolution_m=0.1), labels)
    few = ClassifierOptions(n_rounds=1).classifier(NAMES[:2])
    fitted = PlaceLabeler(NAMES[:2], classifier=few, space=SpaceOptions(n_rounds=2)).fit([item])
    assert fitted.unary_model_.space is not None
    assert not len(fitted.unary_model_.space.spaces(item.grid).gates)
    assert len(fitted.label(item.grid).labels) == cells.size


def test_only_what_a_method_wants_is_computed(labeler: PlaceLabeler) -> None:
    grid = building(4).grid
    graph, scores = labeler.scores(grid, methods=["space"])
    assert scores.laser is None
    model = labeler.unary_model_
    for name in set(UNARIES) - {MIXED}:
        part = getattr(model.scores(grid, graph, unaries=[name]), name)
        assert (part is None) == (name in ("context", "floor"))


def test_a_method_that_wants_spaces_needs_their_options() -> None:
    with pytest.raises(ConfigError, match="needs unary='space' but space is None"):
        from pgm_places import PlaceMethod

        PlaceLabeler(NAMES, {"a": PlaceMethod("independent", "space")}, space=None).check_options()


def test_of_several_domains_the_list_is_the_mean_of_those_without_each(
    known: list[LabelledMap],
) -> None:
    def learned(maps: list[LabelledMap]) -> UnaryModel:
        few = ClassifierOptions(n_rounds=5).classifier(NAMES)
        space = SpaceOptions(n_rounds=5, calibration="none")
        return (
            UnaryLearner(
                Sensor(),
                few,
                len(NAMES),
                space=space,
                doorway=2,
                learn_on="in-sample",
                max_examples_per_map=500,
                with_scores=False,
            )
            .fit(maps)
            .model
        )

    names = ["drawn", "mapped", None]
    named = [replace(item, domain=name) for item, name in zip(known, names, strict=True)]
    assert sizes(learned(known)) == [5, 5]
    assert sizes(learned(named)) == [10, 10]
    # One domain alone is left out by no list.
    assert sizes(learned([named[0], named[2]])) == [5, 5]


def test_a_domain_without_which_a_label_has_no_example_is_left_out_by_no_list() -> None:
    truth = np.array([0, 1, 0, 1, 0, 0, 1])
    domain = np.array([0, 0, 1, 1, 2, 2, -1])
    without = [seen.tolist() for seen in without_a_domain(truth, domain)]
    assert without == [(domain != number).tolist() for number in (0, 1, 2)]
    needed = np.array([0, 2, 0, 1, 0, 1, 1])
    without = [seen.tolist() for seen in without_a_domain(needed, domain)]
    assert without == [(domain != number).tolist() for number in (1, 2)]
    only = np.array([0, 2, 0, 1, 0, 0, 0])
    assert [seen.all() for seen in without_a_domain(only, domain)] == [True]
    assert [seen.all() for seen in without_a_domain(truth, None)] == [True]


def sizes(model: UnaryModel) -> list[int]:
    assert model.space is not None
    return [item.n_rounds for item in model.space.classifier.classifiers]


def test_only_maps_with_more_cells_than_the_limit_are_thinned() -> None:
    taken = _chosen([10, 3], 5, 0)
    assert (int(taken[:10].sum()), int(taken[10:].sum())) == (5, 3)
    assert _chosen([10, 3], 10, 0).all() and _chosen([10, 3], None, 0).all()
