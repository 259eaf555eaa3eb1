"""Running an experiment: every method labels every map once, and no record is rewritten."""

import html
import json
from functools import wraps
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pgm_places.cli.terminal import comparison_table
from pgm_places.errors import ConfigError
from pgm_places.experiment.config import ExperimentConfig, parse_config
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.runs import compare, train
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.models.relaxation import Relaxation
from pgm_places.persistence.model_folder import load_folder
from pgm_places.persistence.stored import load, save
from pgm_places.report.comparison_files import write_comparison
from pgm_places.spaces.doorways import match_doors, match_painted


def config(**changes: Any) -> ExperimentConfig:
    halves = [{"generated": 1, "half": half, "name": half} for half in ("left", "right")]
    return parse_config(
        {
            "resolution_m": 0.4,
            "labels": {"names": ["corridor", "room", "doorway"]},
            "train": halves[:1],
            "test": halves[1:],
            "classifier": {"n_rounds": 3, "learn_on": "in-sample", "n_folds": 2},
            "context": {"half_widths_m": []},
            "space": {"n_rounds": 3},
            "methods": [{"name": "relaxation"}],
        }
        | changes
    )


def test_relaxation_labels_a_test_map_once_and_tells_its_accuracy(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    calls = []
    infer = Relaxation.infer

    @wraps(infer)
    def counted(self: Relaxation, *args: Any, **keywords: Any) -> Any:
        calls.append(keywords)
        return infer(self, *args, **keywords)

    monkeypatch.setattr(Relaxation, "infer", counted)
    experiment = Experiment(config(), Path())
    [found] = compare(experiment).methods
    assert len(calls) == 1
    [history] = found.histories
    assert len(history["accuracy"]) == len(history["change"])
    assert history["accuracy"][-1] == pytest.approx(found.evaluation.accuracy, rel=1e-12)
    assert found.seconds["infer"] > 0


def test_options_are_chosen_into_a_new_experiment() -> None:
    rounds = {"classifier.n_rounds": [1, 4]}
    experiment = Experiment(config(select={"options": rounds, "n_folds": 2}), Path())
    before = experiment.config
    trained = train(experiment)
    assert experiment.config is before
    assert experiment.selection is None
    assert trained.experiment.selection is not None
    chosen = trained.experiment.selection["chosen"]["classifier.n_rounds"]
    assert trained.experiment.config.classifier.n_rounds == chosen
    assert trained.experiment.seconds is experiment.seconds
    assert set(experiment.seconds) == {"load", "select", "learn"}


def test_a_comparison_without_test_maps_reads_nothing() -> None:
    experiment = Experiment(config(test=[]), Path())
    with pytest.raises(ConfigError, match="at least one"):
        compare(experiment)
    assert not experiment.seconds


@pytest.mark.parametrize(
    ("method", "message"),
    [
        ({"name": "hmm"}, r"'hmm' \(HiddenMarkovModel\) labels only chains"),
        ({"name": "potts", "inference": "exact"}, "'exact' labels only graphs of few cycles"),
    ],
)
def test_methods_that_cannot_label_maps_are_refused_before_maps_are_read(
    method: dict[str, Any], message: str
) -> None:
    nowhere = [{"map": "nowhere.yaml", "labels": "nowhere.png"}]
    experiment = Experiment(config(train=nowhere, test=nowhere, methods=[method]), Path())
    for run in (train, compare):
        with pytest.raises(ConfigError, match=message):
            run(experiment)


def test_doors_are_counted_by_what_each_method_labels_and_gates_by_themselves() -> None:
    methods = [
        {"name": "independent", "id": "laser", "unary": "laser"},
        {"name": "independent", "id": "space", "unary": "space"},
    ]
    given = config(resolution_m=0.2, methods=methods)
    found = compare(Experiment(given, Path()))
    [item] = found.maps
    laser, space = found.methods
    truth = np.where(item.window, item.truth, -1)
    for method in (laser, space):
        painted = item.layout.to_raster(method.labelings[0].labels.astype(np.int16), fill=-1)
        match = match_painted(painted, item.grid, truth, 2)
        assert method.doors == (match.scores(np.ones(len(match.door), np.bool_)),)
    trained = train(Experiment(given, Path())).labeler
    model = trained.unary_model_.space
    assert model is not None
    spaces = model.spaces(item.grid)
    by_gates = match_doors(spaces.gates, truth, 2).scores(spaces.places.accepted)
    assert found.gates == (by_gates,)
    assert by_gates.doors == laser.doors[0].doors > 0
    assert by_gates.accepted > 0


def test_doors_are_not_counted_without_a_label_for_them() -> None:
    [method] = compare(Experiment(config(topology={"doorway_label": "hatch"}), Path())).methods
    assert method.doors == ()


def test_what_labelers_and_methods_chose_is_in_the_results(monkeypatch: pytest.MonkeyPatch) -> None:
    chosen = {"unary": "laser (the only one)"}
    monkeypatch.setattr(PlaceLabeler, "choices", chosen, raising=False)
    monkeypatch.setattr(Relaxation, "choices", {"max_iterations": "50"}, raising=False)
    found = compare(Experiment(config(), Path()))
    assert found.all_choices == {**chosen, "relaxation, max_iterations": "50"}


def test_the_chosen_unary_is_the_same_in_all_that_a_comparison_says(tmp_path: Path) -> None:
    experiment = Experiment(config(methods=[{"name": "independent"}]), Path())
    trained = train(experiment)
    found = compare(experiment)
    choice = trained.labeler.unary_choice_
    assert choice is not None
    assert set(choice.scores) == {"space"}  # half of a building
    assert found.methods[0].options["unary"] == choice.unary
    write_comparison(found, tmp_path)
    record = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    assert record["choices"] == found.choices == {"unary": choice.words}
    assert record["config"]["methods"][0]["unary"] == choice.unary
    assert f"unary: {choice.words}" in comparison_table(found)
    assert choice.words in html.unescape((tmp_path / "report.html").read_text(encoding="utf-8"))
    save(trained.labeler, tmp_path / "model")
    manifest, _ = load_folder(tmp_path / "model")
    assert manifest["unary_choice"]["unary"] == manifest["methods"][0]["unary"] == choice.unary
    assert load(tmp_path / "model").choices == found.choices
