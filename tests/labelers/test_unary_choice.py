"""PlaceLabeler with unary = "auto": the candidates, the choice, and what is learned for it."""

import dataclasses
from functools import wraps
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places import LabelledMap, PlaceLabeler
from pgm_places.evaluation.evaluation import evaluate
from pgm_places.inference.backends import build
from pgm_places.inference.temperature import likeliest_temperature
from pgm_places.labelers.place_labeler import PlaceMethod
from pgm_places.labelers.place_learning import unary_candidates
from pgm_places.maps.coarsening import coarsen, coarsen_labels
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.persistence.model_folder import load_folder
from pgm_places.persistence.stored import load, save
from pgm_places.simulation import generate_building
from pgm_places.unary import learning, list_learning
from pgm_places.unary.learning import Halls
from pgm_places.unary.map_model import log_mean
from pgm_places.unary.options import SpaceOptions

NAMES = ("corridor", "room", "doorway")
QUICK = DecisionListClassifier(n_rounds=5, order="rarest-first")


def known(seed: int) -> LabelledMap:
    made, name = generate_building(seed, size="small"), f"small {seed}"
    grid = coarsen(made.grid, 0.1)
    return LabelledMap(grid, coarsen_labels(made.labels, made.grid, grid), None, name, name)


@pytest.fixture(scope="module")
def maps() -> list[LabelledMap]:
    return [known(seed) for seed in range(3)]


def quick(methods: Any = ("independent",), **options: Any) -> PlaceLabeler:
    options = {"space": SpaceOptions(n_rounds=5), "n_folds": 3, **options}
    return PlaceLabeler(NAMES, methods, classifier=QUICK, max_examples_per_map=300, **options)


def test_candidates_depend_on_what_the_buildings_can_tell(maps: list[LabelledMap]) -> None:
    one, two = maps[:1], maps[:2]
    everything = ("laser+space", "space", "laser", "context")
    assert unary_candidates(quick(), maps, None) == everything
    assert unary_candidates(quick(), one, None) == ("laser+space", "laser")
    assert unary_candidates(quick(), two, None) == ("laser+space", "laser")
    same = [dataclasses.replace(item, building="one") for item in maps]
    assert unary_candidates(quick(), same, None) == ("laser+space", "laser")
    half = np.arange(maps[0].grid.shape[1]) < maps[0].grid.shape[1] // 2
    window = np.broadcast_to(half, maps[0].grid.shape)
    windowed = dataclasses.replace(maps[0], window=window)
    assert unary_candidates(quick(), [windowed], None) == ("space",)
    assert unary_candidates(quick(), [windowed, maps[1]], None)[0] == "laser+space"
    assert unary_candidates(quick(space=None), maps, None) == ("laser", "context")
    assert unary_candidates(quick(context_m=(), space=None), maps, None) == ("laser",)
    halls = Halls(0, np.zeros(1, np.bool_))
    assert unary_candidates(quick(), maps, halls) == ("laser+space", "space")
    assert unary_candidates(quick(space=None), maps, halls) == ("laser", "context")


@pytest.mark.parametrize("best", ["laser", "context", "laser+space", "space"])
def test_the_best_by_stubbed_scores_is_given_to_every_open_method(
    maps: list[LabelledMap], monkeypatch: pytest.MonkeyPatch, best: str, tmp_path: Path
) -> None:
    candidates = iter(["laser+space", "space", "laser", "context"])

    def stubbed(*_: Any) -> NDArray[np.float64]:
        return np.full(3, 0.9 if next(candidates) == best else 0.8)

    monkeypatch.setattr(learning, "accuracy_by_part", stubbed)
    methods = {"open": "relaxation", "told": PlaceMethod("independent", "laser")}
    labeler = quick(methods).fit(maps)
    choice, model = labeler.unary_choice_, labeler.unary_model_
    assert choice is not None
    assert choice.unary == best
    assert choice.held_out == "buildings"
    assert [item.unary for item in labeler.methods_.values()] == [best, "laser"]
    assert (model.context_classifier is not None) == (best == "context")
    assert (model.space is not None) == ("space" in best)
    save(labeler, tmp_path / "model")
    back = load(tmp_path / "model")
    assert back.unary_choice_ == choice
    assert back.choices == labeler.choices == {"unary": choice.words}
    np.testing.assert_array_equal(
        back.label(maps[0].grid, method="open").labels,
        labeler.label(maps[0].grid, method="open").labels,
    )


def test_models_without_a_choice_load(maps: list[LabelledMap], tmp_path: Path) -> None:
    folder = save(
        quick({"a": PlaceMethod("independent", "laser")}).fit(maps[:1]), tmp_path / "model"
    )
    assert "unary_choice" not in load_folder(folder)[0]
    assert load(folder).unary_choice_ is None
    assert load(folder).choices == {}


def test_the_scores_are_those_of_buildings_left_out(maps: list[LabelledMap]) -> None:
    methods = {name: PlaceMethod("independent", name) for name in ("laser", "context", "space")}
    labeler = quick({**methods, "open": "independent"})
    unary = labeler.learn(maps, with_scores=True)
    choice = labeler.unary_choice_
    assert choice is not None
    assert unary.scores is not None
    truths = [item.truth(item.graph(labelled_only=True)) for item in maps]
    for name, score in choice.scores.items():
        of_maps = [
            evaluate(truth, found.of(name).argmax(axis=1), NAMES).balanced_accuracy
            for truth, found in zip(truths, unary.scores, strict=True)
        ]
        assert score == pytest.approx(np.mean(of_maps))
    # The list on scans, by hand: one for each building that learned from the other two.
    alone = [quick({"a": PlaceMethod("independent", "laser")}) for _ in maps]
    by_hand = []
    for k, item in enumerate(maps):
        others = [other for other in maps if other is not item]
        order = labeler.unary_model_.classifier
        told = list_learning.like(QUICK, order=order.classes[order.order].tolist())
        alone[k].set_params(classifier=told).fit(others)
        graph, scores = alone[k].scores(item.grid, mask=item.labelled_cells)
        found = scores.of("laser").argmax(axis=1)
        by_hand.append(evaluate(item.truth(graph), found, NAMES).balanced_accuracy)
    assert choice.scores["laser"] == pytest.approx(np.mean(by_hand))


def test_one_building_is_scored_by_its_blocks(maps: list[LabelledMap]) -> None:
    labeler = quick().fit(maps[:1])
    assert labeler.unary_choice_ is not None
    assert labeler.unary_choice_.held_out == "blocks"
    assert set(labeler.unary_choice_.scores) == {"laser+space", "laser"}


def test_lists_are_trained_once_for_the_choice_and_for_methods(
    maps: list[LabelledMap], monkeypatch: pytest.MonkeyPatch
) -> None:
    fits: list[int] = []
    fit = list_learning._fitted

    @wraps(fit)
    def counted(*arguments: Any) -> Any:
        fits.append(1)
        return fit(*arguments)

    monkeypatch.setattr(list_learning, "_fitted", counted)
    network = build("amn", C=0.01)  # it learns from held-out scores
    told = {name: PlaceMethod(network, name) for name in ("laser", "context", "space")}
    quick(told).fit(maps)
    without, fits[:] = len(fits), []
    quick({**told, "open": network}).fit(maps)
    assert len(fits) == without == 3 * (1 + 3)


def test_the_mixture_is_the_normalised_geometric_mean(maps: list[LabelledMap]) -> None:
    one, other = np.log([[0.8, 0.2], [0.5, 0.5]]), np.log([[0.2, 0.8], [0.9, 0.1]])
    np.testing.assert_allclose(np.exp(log_mean(one, other)), [[0.5, 0.5], [0.75, 0.25]])
    powers = np.array([[0.8**0.2 * 0.2**0.6, 0.2**0.2 * 0.8**0.6]])
    weighted = np.exp(log_mean(one[:1], other[:1], (0.2, 0.6)))
    np.testing.assert_allclose(weighted, powers / powers.sum())
    labeler = quick({"a": PlaceMethod("independent", "laser+space")}).fit(maps[:1])
    _, scores = labeler.scores(maps[0].grid)
    found = labeler.problem(maps[0].grid, method="a").unary
    assert found is not None
    np.testing.assert_allclose(np.exp(scores.of("laser+space")).sum(axis=1), 1.0)


def test_both_lists_count_by_how_likely_they_make_what_they_have_not_seen(
    maps: list[LabelledMap], tmp_path: Path
) -> None:
    methods = {"a": PlaceMethod("independent", "laser+space")}
    labeler = quick({**methods, "b": PlaceMethod(build("amn", C=0.01), "laser+space")})
    unary = labeler.learn(maps[:2], with_scores=True)
    assert unary.scores is not None
    truths = [item.truth(item.graph(labelled_only=True)) for item in maps[:2]]
    expected = []
    for name, share in (("laser", 0.55), ("space", 0.45)):
        beliefs = [np.exp(part.of(name)) for part in unary.scores]
        expected.append(share / likeliest_temperature(beliefs, truths))
    assert unary.model.exponents == pytest.approx(tuple(expected))
    assert unary.scores[0].exponents == unary.model.exponents
    save(labeler, tmp_path / "model")
    assert load(tmp_path / "model").unary_model_.exponents == unary.model.exponents
    # Without scores to learn from, lists are held out for this alone.
    alone = quick(methods).fit(maps[:2])
    assert alone.unary_model_.exponents == pytest.approx(unary.model.exponents)


def test_a_unary_for_all_methods_is_an_option_of_the_labeler(maps: list[LabelledMap]) -> None:
    labeler = quick(unary="laser").fit(maps[:1])
    assert labeler.unary_choice_ is None
    assert labeler.method().unary == "laser"
    assert labeler.unary_model_.space is None
