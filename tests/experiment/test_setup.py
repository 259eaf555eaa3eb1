"""Every option of a configuration reaches the labelers that it describes."""

from typing import Any

import pytest

from pgm_places.errors import ConfigError
from pgm_places.experiment.config import ExperimentConfig, parse_config
from pgm_places.experiment.runs import method_result
from pgm_places.experiment.setup import graph_labelers, joint_labeler, make_labeler, step_labeler
from pgm_places.labelers.method import PlaceMethod
from tests.report.comparisons import NAMES, labeling_of, small_map

DRIVE = {"drive": {"generated": 1, "length_m": 10.0}}
HMM = [{"name": "hmm"}]

CLASSIFIER = {
    "n_rounds": 7,
    "order": ["doorway", "room", "hall"],
    "max_examples_per_map": 123,
    "learn_on": "in-sample",
    "n_folds": 3,
    "n_node_features": 11,
}


def config(**changes: Any) -> ExperimentConfig:
    content = {
        "labels": {"names": ["corridor", "room", "doorway", "hall"], "halls": "room"},
        "connectivity": 4,
        "sensor": {"max_range_m": 12.0},
        "classifier": CLASSIFIER,
        "context": {"half_widths_m": [0.3, 1.5]},
        "space": {"n_rounds": 9},
        "steps": {
            "every_m": 0.7,
            "loop_m": 2.5,
            "max_range_m": 8.0,
            "n_runs": 17,
            "seed": 4,
            "beams": {"spaces_m": 0.4},
        },
        "train": [{"generated": 1}],
        "methods": [{"id": "field", "name": "potts", "weight": 0.25, "unary": "context"}],
    }
    return parse_config(content | changes)


def test_options_of_maps_reach_the_labeler() -> None:
    given = config()
    found = make_labeler(given).get_params(deep=False)
    classifier, methods = found.pop("classifier"), found.pop("methods")
    assert found == {
        "label_names": ("corridor", "room", "doorway", "hall"),
        "sensor": given.sensor,
        "connectivity": 4,
        "context_m": (0.3, 1.5),
        "space": given.space,
        "learn_on": "in-sample",
        "n_folds": 3,
        "n_node_features": 11,
        "max_examples_per_map": 123,
        "features": (),
        "halls": "room",
        "whole_spaces": True,
        "doorway_depth_m": None,
        "floor": None,
        "unary": "auto",
    }
    assert (classifier.n_rounds, classifier.order) == (7, [2, 1, 3, 0])
    assert (methods["field"].unary, methods["field"].backend.weight) == ("context", 0.25)
    assert given.sensor.max_range_m == 12.0
    assert given.space is not None and given.space.n_rounds == 9


def test_options_of_steps_reach_the_labelers() -> None:
    given = config()
    found = step_labeler(given).get_params(deep=False)
    assert found.pop("classifier").n_rounds == 7
    assert found.pop("sensor").max_range_m == 8.0
    names = ("every_m", "loop_m", "n_folds", "n_runs", "seed")
    assert [found[name] for name in names] == [0.7, 2.5, 3, 17, 4]
    assert found["beams"] == given.steps.beams
    joint = joint_labeler(given)
    assert joint.places is not None and joint.places.connectivity == 4
    assert joint.steps is not None and joint.steps.every_m == 0.7


def test_options_of_graphs_reach_the_labelers() -> None:
    given = {
        "nodes": "graph",
        "labels": {"names": ["corridor", "room", "doorway", "hall"]},
        "classifier": {**CLASSIFIER, "max_examples_per_map": None},
        "train": [{"graph": {"file": "g.graphml"}}],
        "methods": [{"name": "crf", "unary": "none"}, {"name": "potts", "weight": 0.25}],
    }
    found = graph_labelers(parse_config(given))
    assert found["crf"].classifier is None
    assert found["potts"].classifier.n_rounds == 7
    assert found["potts"].backend.weight == 0.25
    assert {(item.learn_on, item.n_folds) for item in found.values()} == {("in-sample", 3)}


def test_the_time_of_a_method_is_without_that_of_recording_its_accuracy() -> None:
    item = small_map()
    labeling = labeling_of(item, beliefs=False, info={"recording_seconds": 2.0})
    method = PlaceMethod("independent", "laser")
    found = method_result("m", method, NAMES, [item], [labeling], {"learn": 1.0, "infer": 5.0})
    assert found.seconds == {"learn": 1.0, "infer": 3.0}


@pytest.mark.parametrize("others", [{}, {"n_folds": 4}, {"n_rounds": 7, "seed": 3}])
def test_the_prior_of_drives_does_not_depend_on_other_options(others: dict[str, Any]) -> None:
    given = config(nodes="steps", train=[DRIVE], test=[DRIVE], classifier=others, methods=HMM)
    found = step_labeler(given)
    assert found.classifier is not None
    assert found.classifier.prior_weight == 0.0
    of_maps = make_labeler(config(classifier=others)).classifier
    assert of_maps is not None and of_maps.prior_weight == 0.5
    chosen = config(
        nodes="steps", train=[DRIVE], test=[DRIVE], classifier={"prior_weight": 0.7}, methods=HMM
    )
    as_given = step_labeler(chosen).classifier
    assert as_given is not None and as_given.prior_weight == 0.7


@pytest.mark.parametrize(
    ("name", "value"),
    [("learn_on", "in-sample"), ("n_node_features", 11), ("max_examples_per_map", 123)],
)
def test_options_of_cells_are_refused_for_drives(name: str, value: Any) -> None:
    with pytest.raises(ConfigError, match=f"classifier.{name} is for cells of maps"):
        config(nodes="steps", train=[DRIVE], test=[DRIVE], classifier={name: value}, methods=HMM)
