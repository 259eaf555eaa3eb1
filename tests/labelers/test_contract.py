"""What all labelers promise: options, learning in place, cloning, searching, saving."""

import copy
import inspect
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from sklearn.base import clone
from sklearn.exceptions import NotFittedError as SklearnNotFittedError
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GridSearchCV
from sklearn.utils.validation import check_is_fitted

from pgm_places import (
    LabelGraph,
    LabelingProblem,
    LabelledMap,
    OccupancyGrid,
    PlaceLabeler,
    PlaceMethod,
    Sensor,
    StructuredLabeler,
    Trajectory,
    TrajectoryLabeler,
    build,
    load,
    save,
)
from pgm_places.errors import ConfigError, InputError, NotFittedError
from pgm_places.labelers.labeler import Labeler
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.models.mrf import PottsField
from pgm_places.unary.options import SpaceOptions
from pgm_places.unary.scan_model import BeamOptions
from tests.refusals import refused

QUICK = DecisionListClassifier(n_rounds=4, order="rarest-first")
FEW = SpaceOptions(n_rounds=4)
SENSOR = Sensor(n_beams=36, max_range_m=8.0)
NAMES = ("corridor", "room")


@lru_cache
def known(seed: int = 0) -> LabelledMap:
    """Two rooms with a corridor behind each; the seed moves the walls."""
    side = 10 + seed
    cells = np.full((16, 4 * side + 2), 100, np.int8)
    labels = np.full(cells.shape, -1, np.int16)
    for first in (1, 2 * side + 1):
        cells[1:9, first : first + side] = 0
        cells[4:6, first + side : first + 2 * side] = 0
        labels[1:9, first : first + side] = 1
        labels[4:6, first + side : first + 2 * side] = 0
    return LabelledMap(OccupancyGrid(cells, 0.25), labels, name=f"map {seed}")


@lru_cache
def walk(seed: int = 0) -> Trajectory:
    """Through the middle of that map, with labels and without scans."""
    item = known(seed)
    columns = np.arange(2, item.grid.shape[1] - 2)
    xy = item.grid.cell_centres_m(np.column_stack([np.full(len(columns), 4), columns]))
    poses = np.column_stack([xy, np.zeros(len(xy))])
    return Trajectory(np.arange(len(xy), dtype=np.float64), poses).labelled_by(item, NAMES)


@lru_cache
def chain(seed: int = 0) -> LabelingProblem:
    truth = np.repeat([0, 1, 0], 20)
    noise = np.random.default_rng(seed).normal(size=(60, 2))
    return LabelingProblem(
        LabelGraph.from_lattice((60,)), NAMES, node_features=truth[:, None] + 0.6 * noise
    )


TRUTH = np.repeat([0, 1, 0], 20)


@dataclass(frozen=True)
class Case:
    """A labeler, how it learns from data number 0 or 1, and how it labels."""

    labeler: Callable[[], Any]
    fit: Callable[[Any, int], Any]
    label: Callable[[Any], NDArray[np.int64]]
    option: str
    inner: dict[str, Any]
    call_first: str


CASES = {
    "places": Case(
        lambda: PlaceLabeler(
            list(NAMES),
            {"alone": "independent", "potts": PottsField(0.5)},
            SENSOR,
            QUICK,
            space=FEW,
            n_folds=2,
            unary="laser",  # on blocks of so small a map, others are a matter of luck
        ),
        lambda labeler, seed: labeler.fit([known(seed)]),
        lambda labeler: labeler.label(known(2).grid).labels,
        "n_folds",
        {"sensor__max_range_m": 5.0, "methods__potts__backend__weight": 2.0},
        r"fit\(maps\)",
    ),
    "trajectories": Case(
        lambda: TrajectoryLabeler(
            list(NAMES), "potts", 0.0, BeamOptions("known-map"), SENSOR, QUICK, n_folds=2
        ),
        lambda labeler, seed: labeler.fit([], [walk(seed)], known_map=known(seed).grid),
        lambda labeler: labeler.label(walk(2), known_map=known(2).grid).labels,
        "n_folds",
        {"sensor__max_range_m": 5.0, "method__weight": 2.0, "beams__local_size_m": 20.0},
        r"fit\(maps, trajectories\), or from_places\(places\)",
    ),
    "structured": Case(
        lambda: StructuredLabeler("potts", LogisticRegression(C=3.0), n_folds=2),
        lambda labeler, seed: labeler.fit([chain(seed), chain(seed + 5)], [TRUTH, TRUTH]),
        lambda labeler: labeler.label(chain(9)).labels,
        "n_folds",
        {"backend__weight": 2.0, "classifier__C": 0.5},
        r"fit\(X, y\)",
    ),
}


@pytest.fixture(params=list(CASES))
def case(request: pytest.FixtureRequest) -> Case:
    return CASES[request.param]


def test_the_constructor_keeps_its_options_as_they_are(case: Case) -> None:
    """As scikit-learn asks: nothing is copied, converted or learned before fit."""
    labeler = case.labeler()
    assert all(not name.endswith("_") for name in vars(labeler))
    given = labeler.get_params(deep=False)
    again = type(labeler)(**given)
    assert list(given) == list(inspect.signature(type(labeler)).parameters)
    assert all(getattr(again, name) is value for name, value in given.items())


def test_fit_returns_the_labeler_itself_and_changes_no_option(case: Case) -> None:
    labeler = case.labeler()
    before = labeler.get_params(deep=False)
    assert case.fit(labeler, 0) is labeler
    assert all(getattr(labeler, name) is value for name, value in before.items())
    assert labeler.label_names_ == NAMES
    assert len(case.label(labeler))


def test_before_fit_it_says_what_to_call(case: Case) -> None:
    labeler = case.labeler()
    wanted = f"this {type(labeler).__name__} is not fitted yet; call {case.call_first} first"
    refused(NotFittedError, wanted, case.label, labeler)
    refused(SklearnNotFittedError, "is not fitted yet", check_is_fitted, labeler)
    check_is_fitted(case.fit(labeler, 0))


def test_a_clone_has_the_options_and_nothing_learned(case: Case) -> None:
    labeler = case.fit(case.labeler().set_params(**{case.option: 3}), 0)
    twin = clone(labeler)
    assert twin.get_params()[case.option] == 3
    assert twin.get_params().keys() == labeler.get_params().keys()
    refused(NotFittedError, "is not fitted yet", case.label, twin)
    np.testing.assert_array_equal(case.label(case.fit(twin, 0)), case.label(labeler))


def test_options_of_options_are_read_and_set_by_name(case: Case) -> None:
    labeler = case.labeler().set_params(**case.inner)
    found = labeler.get_params()
    assert {name: found[name] for name in case.inner} == case.inner
    untouched = case.labeler().get_params()
    assert all(untouched[name] != value for name, value in case.inner.items())


def test_an_option_that_is_none_is_refused_with_the_nearest(case: Case) -> None:
    labeler = case.labeler()
    with pytest.raises(ConfigError, match=rf"has no option 'n_fold'\. Did you mean '{case.option}"):
        labeler.set_params(n_fold=3)
    name = next(iter(case.inner))
    refused(ConfigError, "has no option", labeler.set_params, **{f"{name}x": 1})


def test_its_text_shows_the_options_that_differ(case: Case) -> None:
    labeler = case.labeler()
    text = repr(labeler)
    assert text.startswith(f"{type(labeler).__name__}(")
    assert "n_folds=2" in text
    own = re.sub(r"(?<=\w)\([^()]*\)", "", text[:-1])  # options of options are shown in full
    assert "seed" not in own and "learn_on" not in own
    assert "n_folds" not in repr(labeler.set_params(n_folds=5))


def test_what_was_learned_before_is_gone_after_another_fit(case: Case) -> None:
    twice, once = case.labeler(), case.labeler()
    case.fit(twice, 0)
    twice.stray_ = "left behind"
    case.fit(twice, 1)
    case.fit(once, 1)
    assert vars(twice).keys() == vars(once).keys()
    np.testing.assert_array_equal(case.label(twice), case.label(once))


def test_saved_and_loaded_it_labels_the_same(case: Case, tmp_path: Path) -> None:
    labeler = case.fit(case.labeler(), 0)
    again = load(save(labeler, tmp_path / "model"))
    assert type(again) is type(labeler)
    assert again.label_names_ == NAMES
    assert again.get_params()[case.option] == 2
    np.testing.assert_array_equal(case.label(again), case.label(labeler))
    with pytest.raises(NotFittedError, match="is not fitted yet"):
        case.label(clone(again))


def test_other_options_of_a_fitted_one_are_a_copys(case: Case) -> None:
    labeler = case.fit(case.labeler(), 0)
    before = case.label(labeler)
    name, value = next(item for item in case.inner.items() if item[0].endswith("weight"))
    other = labeler.with_options(**{name: 1e6})
    assert len(np.unique(case.label(other))) == 1  # that much smoothing leaves one label
    assert len(np.unique(before)) == 2
    np.testing.assert_array_equal(case.label(labeler), before)
    assert labeler.get_params()[name] != 1e6 and value != 1e6


def test_a_copy_shares_nothing_that_a_fit_changes(case: Case) -> None:
    labeler = case.fit(case.labeler(), 0)
    before = case.label(labeler)
    case.fit(copy.copy(labeler), 1)
    np.testing.assert_array_equal(case.label(labeler), before)


def test_the_three_take_the_same_keywords() -> None:
    shared = {"method", "mask", "truth", "n_threads", "progress"}
    own = {"self", "known", "known_map", "map_prior", "extra", "lean", "methods", "scores", "own"}
    own |= {"with_spaces"}
    for kind in (PlaceLabeler, TrajectoryLabeler, StructuredLabeler):
        for name in ("label", "infer", "scores"):
            found = inspect.signature(getattr(kind, name)).parameters
            keywords = {key for key, item in found.items() if item.kind is item.KEYWORD_ONLY}
            assert keywords <= shared | own
            assert "truth" in keywords or name == "scores"
        assert issubclass(kind, Labeler)


@pytest.mark.parametrize(
    ("name", "option", "thing", "options", "truth"),
    [
        (
            *("places", {"methods": ["relaxation"]}, known(2).grid, {}),
            known(2).truth(known(2).graph()),
        ),
        (
            *("trajectories", {"method": "relaxation"}, walk(2), {"known_map": known(2).grid}),
            walk(2).labels,
        ),
        ("structured", {"backend": "relaxation"}, chain(9), {}, TRUTH),
    ],
)
def test_true_labels_add_a_history_and_change_no_label(
    name: str, option: dict[str, Any], thing: Any, options: dict[str, Any], truth: Any
) -> None:
    labeler = CASES[name].fit(CASES[name].labeler().set_params(**option), 0)
    plain, told = labeler.label(thing, **options), labeler.label(thing, truth=truth, **options)
    np.testing.assert_array_equal(plain.labels, told.labels)
    assert told.info.keys() > plain.info.keys()


def test_a_search_chooses_among_options_of_methods() -> None:
    search = GridSearchCV(
        PlaceLabeler(NAMES, {"potts": "potts"}, SENSOR, QUICK, space=FEW, n_folds=2),
        {"methods__potts__backend__weight": [0.5, 1e6]},
        cv=2,
        error_score="raise",
    ).fit([known(0), known(1), known(2), known(3)])
    assert search.best_params_ == {"methods__potts__backend__weight": 0.5}
    assert search.best_score_ > 0.9


def test_all_methods_start_from_the_same_unary_unless_told_otherwise() -> None:
    methods = {"independent": "independent", "potts": "potts"}
    labeler = PlaceLabeler(NAMES, methods, SENSOR, QUICK, context_m=(0.5,), space=None, n_folds=2)
    labeler.fit([known(0)])
    alone, other = (labeler.problem(known(0).grid, method=name) for name in methods)
    np.testing.assert_array_equal(alone.unary, other.unary)

    told = labeler.set_params(methods={"alone": PlaceMethod("independent", "laser")})
    assert told.fit([known(0)]).unary_model_.context_classifier is None  # nobody asks for it


def test_a_method_for_chains_is_refused_before_anything_is_learned(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def learned(*arguments: object, **options: object) -> None:
        raise AssertionError("it has learned")

    monkeypatch.setattr(DecisionListClassifier, "fit", learned)
    monkeypatch.setattr(LogisticRegression, "fit", learned)
    with pytest.raises(
        ConfigError,
        match=r"method 'way' \(HiddenMarkovModel\) labels only chains such as trajectories, and a "
        r"map is not a chain; use one of independent, relaxation, amn, crf, potts",
    ):
        PlaceLabeler(NAMES, {"alone": "independent", "way": "hmm"}).fit([known(0)])
    ring = LabelingProblem(
        LabelGraph.from_edges(3, [[0, 1], [0, 2], [1, 2]]), NAMES, node_features=np.zeros((3, 1))
    )
    with pytest.raises(ConfigError, match=r"the backend \(HiddenMarkovModel\) labels only chains"):
        StructuredLabeler("hmm", LogisticRegression()).fit([ring], [np.array([0, 1, 0])])
    with pytest.raises(InputError, match="Relaxation is trained on labelled trajectories"):
        TrajectoryLabeler(NAMES, "relaxation").fit([known(0)])


@pytest.mark.parametrize(
    ("name", "value", "wanted"),
    [
        ("places", {"n_folds": 1}, "n_folds must be a whole number from 2 to 50, got 1"),
        ("places", {"learn_on": "all"}, "learn_on must be 'out-of-fold' or 'in-sample', got 'all'"),
        ("places", {"connectivity": 6}, "connectivity must be 4 or 8, got 6"),
        ("places", {"context_m": (0.5, -1.0)}, "context_m must be a list of numbers above 0, got"),
        ("trajectories", {"every_m": -1.0}, "every_m must be a number of at least 0 or 'auto'"),
        ("trajectories", {"n_runs": 0}, "n_runs must be a whole number of at least 1, got 0"),
        ("trajectories", {"n_folds": 2.5}, "n_folds must be a whole number from 2 to 50, got 2.5"),
        ("structured", {"n_folds": 1}, "n_folds must be a whole number from 2 to 50, got 1"),
        ("structured", {"metric": "f1"}, "metric must be 'accuracy', 'balanced_accuracy', 'mac"),
        ("structured", {"min_probability": 0}, "min_probability must be a number above 0 and be"),
        ("places", {"doorway_depth_m": 0.0}, "doorway_depth_m must be a number above 0"),
    ],
)
def test_an_option_out_of_its_limits_is_refused_before_anything_is_learned(
    name: str, value: dict[str, Any], wanted: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    labeler = CASES[name].labeler().set_params(**value)
    monkeypatch.setattr(DecisionListClassifier, "fit", None)
    monkeypatch.setattr(LogisticRegression, "fit", None)
    for refuses in (lambda: CASES[name].fit(labeler, 0), labeler.with_options):
        with pytest.raises(ConfigError) as caught:
            refuses()
        assert str(caught.value).startswith(wanted)


@pytest.mark.parametrize("method", [3, PottsField, "amnn"])
def test_what_is_no_method_is_refused_by_all(method: object) -> None:
    labelers: list[tuple[Any, tuple[Any, ...]]] = [
        (PlaceLabeler(NAMES, {"a": method}), ([known(0)],)),
        (TrajectoryLabeler(NAMES, method), ([], [walk(0)])),
        (StructuredLabeler(method), ([chain(0)], [TRUTH])),
    ]
    for labeler, data in labelers:
        with pytest.raises(ConfigError, match=r"must be a backend or a method's name|Did you mean"):
            labeler.fit(*data)


def test_labelling_does_not_import_scikit_learn() -> None:
    code = (
        "import sys; from pgm_places import trained_labeler, TrajectoryLabeler, StructuredLabeler; "
        "TrajectoryLabeler.from_places(trained_labeler()); sys.exit('sklearn' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_built_methods_serve_as_well_as_names() -> None:
    by_name, built = (
        PlaceLabeler(NAMES, {"potts": method}, SENSOR, QUICK, space=FEW, n_folds=2).fit([known(0)])
        for method in ("potts", build("potts"))
    )
    grid = known(1).grid
    np.testing.assert_array_equal(by_name.label(grid).labels, built.label(grid).labels)
