"""Training on top of a model: what a configuration may say, and what comes of it."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pgm_places.errors import ConfigError, LabelError, ModelFileError
from pgm_places.experiment.config import load_config, parse_config
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.runs import compare, train
from pgm_places.io.maps.label_image import save_labels
from pgm_places.io.maps.map_server import save_map
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.persistence.stored import save
from pgm_places.simulation import generate_building
from pgm_places.teaching.interactive_labeler import InteractiveLabeler
from pgm_places.teaching.paint import Paint
from pgm_places.teaching.training_selection import TeachingOptions
from pgm_places.trained import trained_labeler

NAMES = ("corridor", "room", "doorway")
CONFIG: dict[str, Any] = {
    "base_model": "generated",
    "labels": {"names": list(NAMES)},
    "train": [{"map": "map.yaml", "corrections": "paint.png"}],
}


def test_a_base_model_goes_on_learning_with_options_that_are_checked() -> None:
    config = parse_config({**CONFIG, "teaching": {"n_rounds": 7, "seed": 3}})
    assert config.base_model == "generated"
    assert config.teaching == TeachingOptions(n_rounds=7, seed=3)
    assert config.methods == ()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"base_model": None}, "methods: give at least one, as a table [[methods]]"),
        (
            {"base_model": None, "methods": [{"name": "potts"}], "teaching": {"keep": 1.0}},
            "[teaching] has the options of further training and requires base_model",
        ),
        ({"methods": [{"name": "potts"}]}, "methods is for training from scratch; base_model"),
        ({"classifier": {"n_rounds": 7}}, "classifier is for training from scratch"),
        ({"resolution_m": 0.1}, "resolution_m is for training from scratch"),
        (
            {"base_model": "none", "teaching": {"keep": 1.0}},
            "[teaching] has only the options max_cells_per_class",
        ),
        ({"teaching": {"n_round": 3}}, "Did you mean 'n_rounds'?"),
        ({"teaching": {"seed": -1}}, "teaching.seed must be a whole number from 0 to"),
        ({"train": [{"map": "map.yaml"}]}, "either labels (an image), regions (a GeoJSON"),
    ],
)
def test_what_does_not_fit_a_base_model_is_refused(changes: dict[str, Any], message: str) -> None:
    content = {key: value for key, value in {**CONFIG, **changes}.items() if value is not None}
    with pytest.raises(ConfigError) as caught:
        parse_config(content)
    assert message in str(caught.value)


@pytest.fixture(scope="module")
def painted(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Paint]:
    """A small building as a map, a twelfth of whose cells are painted as they are, and another."""
    folder = tmp_path_factory.mktemp("painted")
    building = generate_building(3, size="small", resolution_m=0.1)
    save_map(building.grid, folder / "map")
    other = generate_building(4, size="small", resolution_m=0.1)
    save_map(other.grid, folder / "other")
    save_labels(folder / "other_labels.png", other.labels, other.label_names)
    cells = np.argwhere(building.grid.free)[::12]
    paint = Paint.blank(building.grid.shape, NAMES)
    for label, name in enumerate(NAMES):
        paint = paint.with_cells(cells[building.labels[tuple(cells.T)] == label], name)
    paint.save(folder / "paint.png", building.grid)
    return folder, paint


def configured(folder: Path, text: str) -> Experiment:
    path = folder / "train.toml"
    train = '[[train]]\nmap = "map.yaml"\ncorrections = "paint.png"\n'
    path.write_text(f"{text}\n{train}")
    return Experiment(load_config(path), folder)


def same(one: PlaceLabeler, other: PlaceLabeler, folder: Path) -> bool:
    """Whether two labelers have the same numbers."""
    arrays = [
        (save(item, folder / name) / "arrays.safetensors").read_bytes()
        for name, item in (("one", one), ("other", other))
    ]
    return arrays[0] == arrays[1]


@pytest.mark.parametrize("base", ["generated", "none"])
def test_training_teaches_just_what_a_teacher_does(
    base: str, painted: tuple[Path, Paint], tmp_path: Path
) -> None:
    folder, paint = painted
    changes = {"max_cells_per_class": 60, "seed": 5} | ({"n_rounds": 4} if base != "none" else {})
    listed = "\n".join(f"{key} = {value}" for key, value in changes.items())
    names = f'base_model = "{base}"\n[labels]\nnames = ["corridor", "room", "doorway"]\n'
    labeler = train(configured(folder, f"{names}[teaching]\n{listed}\n")).labeler
    grid = generate_building(3, size="small", resolution_m=0.1).grid
    model = None if base == "none" else trained_labeler(base)
    options = TeachingOptions(**changes)
    expected = InteractiveLabeler(grid, model, classes=NAMES, options=options).learned(paint)
    assert same(labeler, expected, tmp_path)
    options = replace(options, seed=0)
    other = InteractiveLabeler(grid, model, classes=NAMES, options=options).learned(paint)
    assert not same(labeler, other, tmp_path)


def test_a_model_that_was_taught_is_compared_like_any_other(painted: tuple[Path, Paint]) -> None:
    folder, _ = painted
    test = '[[test]]\nmap = "other.yaml"\nlabels = "other_labels.png"\n'
    names = 'base_model = "generated"\n[labels]\nnames = ["corridor", "room", "doorway"]\n'
    found = compare(configured(folder, names + test))
    assert [item.id for item in found.methods] == list(trained_labeler("generated").methods_)
    assert found.config["methods"][0]["name"] == "independent"
    assert "generated/manifest.json" in found.inputs
    assert found.methods[0].evaluation.accuracy > 0.9


def test_labels_that_do_not_fit_and_models_that_are_not_there_are_refused(
    painted: tuple[Path, Paint],
) -> None:
    folder, _ = painted
    names = '[labels]\nnames = ["corridor", "room", "doorway", "lab"]\n'
    with pytest.raises(ModelFileError, match=r"no model at .*nowhere"):
        train(configured(folder, f'base_model = "nowhere"\n{names}'))
    names = names.replace("room", "office")
    experiment = configured(folder, f'base_model = "generated"\n{names}')
    with pytest.raises(LabelError, match="'room'"):
        train(experiment)
