"""Configurations: defaults, and one clear line for everything that is wrong."""

from pathlib import Path
from typing import Any

import pytest

from pgm_places.errors import ConfigError
from pgm_places.experiment.config import load_config, parse_config
from pgm_places.experiment.setup import make_labeler, resolved_config
from pgm_places.labelers.presets import preset_record


def minimal() -> dict[str, Any]:
    return {
        "labels": {"names": ["corridor", "room"]},
        "train": [{"map": "a.yaml", "labels": "a.png"}],
        "methods": [{"name": "independent"}],
    }


def changed(**parts: Any) -> dict[str, Any]:
    return {**minimal(), **parts}


def source(**keys: Any) -> dict[str, Any]:
    """With further keys of its only map."""
    return changed(train=[{"map": "a.yaml", "labels": "a.png", **keys}])


def test_a_file_may_be_named_by_text(tmp_path: Path) -> None:
    path = tmp_path / "config.toml"
    path.write_text(
        '[labels]\nnames = ["corridor", "room"]\n[[train]]\ngenerated = 1\n'
        '[[methods]]\nname = "independent"\n'
    )
    assert load_config(str(path)) == load_config(path)
    with pytest.raises(ConfigError, match=r"absent\.toml: no such file"):
        load_config(str(tmp_path / "absent.toml"))


def test_defaults_are_filled_in() -> None:
    config = parse_config(minimal())
    assert config.sensor.n_beams == 360
    assert config.classifier.n_rounds == 100
    assert config.methods[0].id == "independent"
    assert config.methods[0].unary == "auto"
    assert config.test == ()


def test_windows_may_be_open() -> None:
    config = parse_config(source(columns=[366, "end"], rows=["", 10]))
    assert config.train[0].window == {"columns": (366, None), "rows": (None, 10)}


def test_other_keys_of_a_method_are_its_options() -> None:
    config = parse_config(changed(methods=[{"name": "relaxation", "max_iterations": 7}]))
    assert config.methods[0].options == {"max_iterations": 7}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (changed(resolution=0.2), "unknown key 'resolution'. Did you mean 'resolution_m'?"),
        (
            source(collumns=[0, 1]),
            "unknown key 'train[0].collumns'. Did you mean 'columns'?",
        ),
        (changed(sensor={"beams": 1}), "unknown key 'sensor.beams'. Did you mean 'n_beams'?"),
        (changed(sensor={"n_beams": "360"}), "n_beams must be a whole number from 3 to 3600"),
        (changed(resolution_m=-0.1), "resolution_m must be a number above 0 or None, got -0.1"),
        (changed(resolution_m=float("nan")), "resolution_m must be a number above 0 or None, got"),
        (
            source(half="left"),
            "train[0]: half is for generated buildings",
        ),
        (
            source(furniture=False),
            "train[0]: furniture: for generated buildings only",
        ),
        (changed(train=[{"labels": "a.png"}]), "train[0]: either map (a YAML file) or"),
        (
            source(generated=1),
            "train[0]: either map (a YAML file) or generated",
        ),
        (changed(train=[{"generated": 1, "labels": "a.png"}]), "train[0]: a generated building"),
        (changed(classifier={"prior_weight": -1.0}), "prior_weight must be a number from 0 to 2"),
        (changed(classifier={"max_depth": 5}), "max_depth must be a whole number from 1 to 4"),
        (
            source(unknown_value="any"),
            "unknown_value must be a whole number from 0 to 255, 'none', or None, got 'any'",
        ),
        (changed(train=[{"map": "a.yaml"}]), "train[0]: either labels (an image), regions"),
        (changed(labels={"names": ["room", "room"]}), "labels: names must differ"),
        (changed(methods=[{"name": "relaxaton"}]), "Did you mean 'relaxation'?"),
        (
            changed(methods=[{"name": "relaxation", "iteration": 3}]),
            "has no option 'iteration'. Did you mean 'max_iterations'?",
        ),
        (
            changed(methods=[{"name": "relaxation", "max_iterations": "many"}]),
            "method 'relaxation': max_iterations must be a whole number of at least 1 or 'auto', "
            "got 'many'",
        ),
        (changed(methods=[{"name": "independent"}] * 2), "give each its own id"),
        (changed(methods={"name": "independent"}), "write [[methods]] above each"),
        (changed(methods=[{"id": "x"}]), "methods[0] has no name"),
        (
            changed(
                context={"half_widths_m": []},
                methods=[{"name": "independent", "unary": "context"}],
            ),
            "a method has unary = 'context' but [context] half_widths_m is empty",
        ),
        (changed(classifier={"order": ["corridor", "kitchen"]}), "classifier.order must name each"),
        (
            changed(train=[{"map": "a", "regions": "r.geojson", "classes": {"CR": "corridors"}}]),
            "train[0].classes: 'CR' is translated to 'corridors', which is not a label",
        ),
    ],
)
def test_mistakes_are_named_with_their_place(content: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_config(content, "office.toml")
    assert str(caught.value).startswith("office.toml: ")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_classifier_takes_the_options_of_its_trees() -> None:
    config = parse_config(changed(classifier={"n_rounds": 7, "max_depth": 3, "shrinkage": 0.3}))
    classifier = make_labeler(config).classifier
    assert classifier is not None
    options = classifier.get_params()
    assert (options["n_rounds"], options["max_depth"], options["shrinkage"]) == (7, 3, 0.3)


def test_a_preset_sets_what_the_file_leaves_open() -> None:
    methods = [
        {"name": "relaxation", "max_iterations": 7},
        {"name": "amn"},
        {"name": "independent"},
    ]
    given = changed(preset="paper", methods=methods, classifier={"prior_weight": 1.0})
    config = parse_config(given)
    assert (config.classifier.order, config.classifier.prior_weight) == ("heuristic", 1.0)
    assert [item.unary for item in config.methods] == ["laser"] * 3
    assert [item.options for item in config.methods] == [
        {"max_iterations": 7},
        {"node_features": "raw", "C": 100.0},
        {},
    ]
    assert given["classifier"] == {"prior_weight": 1.0}  # as it was
    assert given["methods"][1] == {"name": "amn"}


def test_a_preset_sets_nothing_that_the_nodes_do_not_have() -> None:
    log = {"log": "a.csv", "truth": "b.csv"}
    given = changed(preset="paper", nodes="steps", train=[log], methods=[{"name": "hmm"}])
    config = parse_config(given)
    assert (config.steps.every_m, config.steps.n_runs) == (0.35, 1000)
    assert config.methods[0].unary == "auto"
    assert config.methods[0].options == {"observation": "hard", "evidence_weight": 1.0}
    graph = changed(preset="paper", nodes="graph", train=[{"graph": "a.graphml"}])
    assert parse_config(graph).classifier.order == "heuristic"


def test_noise_is_a_preset_of_its_own() -> None:
    config = parse_config(changed(preset="paper-noise", sensor={"noise": {"sigma_m": 0.1}}))
    assert config.sensor.noise is not None
    noise = config.sensor.noise
    assert (noise.sigma_m, noise.p_random, noise.p_max) == (0.1, 0.01, 0.01)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (changed(preset="paper", classifier=3), "classifier must be a table of options"),
        (changed(preset="article"), "preset must be 'paper' or 'paper-noise' or None, got '"),
        (changed(base_model="default", preset="paper"), "preset is for training from scratch"),
    ],
)
def test_a_bad_preset_gets_one_line(content: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError) as raised:
        parse_config(content)
    assert message in str(raised.value)


def test_what_a_preset_set_is_told_from_what_was_given() -> None:
    methods = [{"name": "relaxation", "max_iterations": 7}, {"id": "b", "name": "relaxation"}]
    config = parse_config(changed(preset="paper", methods=methods, classifier={"order": ["room"]}))
    resolved = resolved_config(config, make_labeler(config).resolved_methods())
    assert preset_record(resolved) == {
        "name": "paper",
        "set": {
            "classifier.prior_weight": 0.0,
            "methods.*.unary": "laser",
            "methods.relaxation.max_iterations": 10,
        },
        "given": {"classifier.order": ["room"], "methods.relaxation.max_iterations": 7},
    }
    assert preset_record({"preset": None}) is None


def test_ids_may_say_what_a_method_does() -> None:
    config = parse_config(changed(methods=[{"name": "amn", "id": "amn (C = 10, lp) [raw]"}]))
    assert config.methods[0].id == "amn (C = 10, lp) [raw]"
    with pytest.raises(ConfigError, match=r"digits, spaces and _\.,\+=\(\)\[\]-.* got 'a/b'"):
        parse_config(changed(methods=[{"name": "amn", "id": "a/b"}]))
