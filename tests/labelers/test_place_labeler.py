"""PlaceLabeler: learning, labelling, scores, saving, and what it refuses."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pgm_places import LabelledMap, PlaceLabeler, Sensor, evaluate
from pgm_places.errors import ConfigError, InputError, LabelError, ModelFileError, NotFittedError
from pgm_places.inference.backends import build
from pgm_places.labelers.place_labeler import PlaceMethod
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.models.mrf import PottsField
from pgm_places.persistence.model_folder import load_folder, save_folder
from pgm_places.persistence.stored import load, read, save
from pgm_places.simulation import generate_building
from tests.refusals import refused

NAMES = ("corridor", "room", "doorway")


@pytest.fixture(scope="module")
def known() -> LabelledMap:
    building = generate_building(size="small")
    return LabelledMap(building.grid, building.labels, name="small")


@pytest.fixture(scope="module")
def labeler(known: LabelledMap) -> PlaceLabeler:
    methods = {
        "adaboost": PlaceMethod("independent", "laser"),
        "relaxation": PlaceMethod("relaxation", "laser"),
        "amn": PlaceMethod(build("amn", C=10.0), "context"),
        "potts": PlaceMethod(PottsField(0.25, inference="mean-field"), "laser"),
    }
    unfitted = PlaceLabeler(
        NAMES,
        methods,
        classifier=DecisionListClassifier(n_rounds=20, order="rarest-first"),
        context_m=(0.3, 1.5),
        n_folds=3,
    )
    return unfitted.fit([known])


@pytest.mark.parametrize("method", ["adaboost", "relaxation", "amn"])
def test_labels_the_map_it_learned_from(
    labeler: PlaceLabeler, known: LabelledMap, method: str
) -> None:
    labeling = labeler.label(known.grid, method=method)
    truth = known.truth(known.graph())
    assert len(labeling.labels) == known.grid.free.sum()
    assert evaluate(truth, labeling.labels, NAMES).balanced_accuracy > 0.75


def test_the_score_counts_the_window_alone(labeler: PlaceLabeler, known: LabelledMap) -> None:
    half = np.arange(known.grid.shape[1]) < known.grid.shape[1] // 2
    labels = np.where(half, known.labels, (known.labels + 1) % 3)  # wrong outside of the window
    window = np.broadcast_to(half, known.grid.shape)
    part = dataclasses.replace(known, labels=labels, window=window)
    found = labeler.label(known.grid, mask=part.cells, method="adaboost").labels
    wanted = evaluate(part.truth(part.graph()), found, NAMES).accuracy
    assert labeler.score([part], method="adaboost") == wanted > 0.7


def test_held_out_scores_calibrate_the_beliefs_of_a_potts_field(
    labeler: PlaceLabeler, known: LabelledMap
) -> None:
    chosen = labeler.methods_["potts"]
    assert 1.05 < chosen.backend.temperature < 20
    graph, scores = labeler.scores(known.grid, methods=["potts"])
    found = labeler.infer(graph, scores, method="potts")
    surer = dataclasses.replace(chosen.backend, temperature=1.0).infer(
        labeler.problem_of(graph, scores, chosen)
    )
    np.testing.assert_array_equal(found.labels, surer.labels)
    assert found.beliefs is not None
    assert surer.beliefs is not None
    assert found.beliefs.max(axis=1).mean() < surer.beliefs.max(axis=1).mean()


def test_scores_of_lists_that_saw_the_cells_calibrate_nothing(known: LabelledMap) -> None:
    field = PottsField(0.25, inference="mean-field")
    methods = {"amn": PlaceMethod("amn", "laser"), "potts": PlaceMethod(field, "laser")}
    unfitted = PlaceLabeler(
        NAMES, methods, classifier=DecisionListClassifier(n_rounds=5), learn_on="in-sample"
    )
    assert unfitted.fit([known]).methods_["potts"].backend == field


def test_adaboost_alone_is_the_argmax_of_its_histogram(
    labeler: PlaceLabeler, known: LabelledMap
) -> None:
    _, scores = labeler.scores(known.grid)
    labeling = labeler.label(known.grid, method="adaboost")
    assert scores.laser is not None
    assert (labeling.labels == scores.laser.argmax(axis=1)).all()
    np.testing.assert_allclose(np.exp(scores.laser).sum(axis=1), 1.0, rtol=0, atol=1e-9)


@pytest.mark.parametrize("n_threads", [1, 3])
def test_threads_do_not_change_a_bit(
    labeler: PlaceLabeler, known: LabelledMap, n_threads: int
) -> None:
    _, scores = labeler.scores(known.grid, n_threads=n_threads)
    _, reference = labeler.scores(known.grid, n_threads=2)
    np.testing.assert_array_equal(scores.laser, reference.laser, strict=True)
    assert scores.context is not None
    assert reference.context is not None
    assert (scores.context == reference.context).all()
    np.testing.assert_array_equal(scores.node_features, reference.node_features, strict=True)


def test_a_window_gives_the_same_scores_for_its_cells(
    labeler: PlaceLabeler, known: LabelledMap
) -> None:
    mask = np.zeros(known.grid.shape, np.bool_)
    mask[:, : known.grid.shape[1] // 2] = True
    _, whole = labeler.scores(known.grid, methods=["adaboost"])
    graph, part = labeler.scores(known.grid, mask=mask, methods=["adaboost"])
    inside = mask[known.grid.free]
    assert graph.n_nodes == inside.sum()
    assert whole.laser is not None
    np.testing.assert_array_equal(part.laser, whole.laser[inside], strict=True)


def test_saved_and_loaded_labels_the_same(
    labeler: PlaceLabeler, known: LabelledMap, tmp_path: Path
) -> None:
    save(labeler, tmp_path / "model", record={"why": "a test"})
    stored = read(tmp_path / "model", "place-labeler")
    loaded = stored.item
    assert stored.record == {"why": "a test"}
    assert list(loaded.methods_) == list(labeler.methods_)
    for method in labeler.methods_:
        before, after = (one.label(known.grid, method=method) for one in (labeler, loaded))
        assert (before.labels == after.labels).all()
        assert before.score == after.score


@pytest.mark.parametrize(
    ("keys", "value", "message"),
    [
        (("kind",), "cake", "holds a 'cake' model"),
        (("feature_set",), "other", "another definition of the laser features"),
        (("methods", 0, "backend"), "os:system", "no method 'os:system' is installed"),
        (
            *(("methods", 1, "options", "max_iterations"), "many"),
            "max_iterations must be a whole number of at least 1 or 'auto', got 'many'",
        ),
        (("label_names",), None, "label_names"),
        (
            *(("unary/node_columns",), np.array([400])),
            "node_columns must be feature indices below 321",
        ),
    ],
)
def test_a_spoiled_model_is_refused(
    keys: tuple[Any, ...], value: Any, message: str, labeler: PlaceLabeler, tmp_path: Path
) -> None:
    save(labeler, tmp_path / "model")
    manifest, arrays = load_folder(tmp_path / "model")
    arrays = dict(arrays)
    part: Any = arrays if isinstance(value, np.ndarray) else manifest
    for key in keys[:-1]:
        part = part[key]
    part[keys[-1]] = value
    for key in ("arrays", "schema", "sha256", "version"):
        manifest.pop(key, None)
    save_folder(tmp_path / "spoiled", manifest, arrays)
    refused(ModelFileError, message, load, tmp_path / "spoiled")


def test_what_does_not_fit_is_refused(known: LabelledMap, labeler: PlaceLabeler) -> None:
    refused(NotFittedError, "call fit", PlaceLabeler(NAMES).label, known.grid)
    with pytest.raises(LabelError, match="no training cell is labelled 'kitchen' in small"):
        PlaceLabeler((*NAMES, "kitchen")).fit([known])
    with pytest.raises(LabelError, match="label index 2 but there are only 2 labels"):
        PlaceLabeler(NAMES[:2]).fit([known])
    refused(ConfigError, "Did you mean 'adaboost'", labeler.label, known.grid, method="adabost")
    with pytest.raises(ConfigError, match="'space' or 'floor', got 'lidar'"):
        PlaceMethod("independent", "lidar")  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="context_m is empty"):
        PlaceLabeler(NAMES, {"amn": PlaceMethod("amn", "context")}, context_m=()).fit([known])
    other = dataclasses.replace(known.grid, resolution_m=0.3)
    with pytest.raises(InputError, match="training maps must have one resolution"):
        PlaceLabeler(NAMES).fit([known, LabelledMap(other, known.labels, name="other")])
    with pytest.raises(LabelError, match="labels must be integers of the map's shape"):
        LabelledMap(known.grid, known.labels[1:])


def test_lists_may_be_trained_on_a_part_of_each_map(known: LabelledMap) -> None:
    few = PlaceLabeler(
        NAMES,
        classifier=DecisionListClassifier(n_rounds=10, order="rarest-first"),
        max_examples_per_map=300,
        space=None,
        unary="laser",
    )
    labeling = few.fit([known]).label(known.grid)
    truth = known.truth(known.graph())
    assert evaluate(truth, labeling.labels, NAMES).balanced_accuracy > 0.6
    part = few.scores(known.grid)[1].laser
    whole = few.set_params(max_examples_per_map=None).fit([known]).scores(known.grid)[1].laser
    assert not np.array_equal(part, whole)  # type: ignore[arg-type]


def test_noise_changes_scans_but_not_from_run_to_run(known: LabelledMap) -> None:
    from pgm_places import SensorNoise

    noisy = Sensor(noise=SensorNoise(sigma_m=0.05, p_random=0.01, p_max=0.01, seed=3))
    few = DecisionListClassifier(5, order="rarest-first")
    plain = PlaceLabeler(NAMES, classifier=few, space=None)
    first, second = (
        plain.with_options(sensor=noisy).fit([known]).label(known.grid) for _ in range(2)
    )
    assert (first.labels == second.labels).all()
    assert (first.labels != plain.fit([known]).label(known.grid).labels).any()


def test_only_what_the_methods_want_is_computed(labeler: PlaceLabeler, known: LabelledMap) -> None:
    _, plain = labeler.scores(known.grid, methods=["relaxation"])
    assert plain.context is None
    assert plain.node_features is None
    _, every = labeler.scores(known.grid)
    assert every.node_features is not None
    np.testing.assert_array_equal(plain.laser, every.laser)
    _, lean = labeler.scores(known.grid, methods=["relaxation"], lean=True)
    assert lean.laser is not None and lean.laser.dtype == np.float32
    np.testing.assert_array_equal(lean.laser, np.asarray(every.laser, np.float32))
