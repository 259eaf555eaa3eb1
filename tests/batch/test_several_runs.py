"""Every building is left out once, and nothing of it is seen in training."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pgm_places.batch.local_workers import LocalWorkers
from pgm_places.batch.several_runs import RunTask, compare_several, run_tasks
from pgm_places.errors import ConfigError
from pgm_places.evaluation.evaluation import Evaluation
from pgm_places.experiment.config import load_config
from pgm_places.experiment.experiment import Experiment, FeatureCache
from pgm_places.experiment.runs import compare
from pgm_places.experiment.splits import splits_of
from pgm_places.io.maps.label_image import save_labels
from pgm_places.io.maps.map_server import save_map
from pgm_places.report.comparison_files import write_comparison
from pgm_places.simulation import generate_building
from tests.batch.shared import CrashingWorkers, InProcessWorkers

CONFIG = """
labels.names = ["corridor", "room", "doorway"]
classifier = { n_rounds = 3, max_examples_per_map = 200 }

[[train]]
map = "*/map.yaml"
labels = "*/labels.png"
buildings = "buildings.csv"

[[methods]]
name = "independent"
unary = "laser"
"""


@pytest.fixture
def experiment(tmp_path: Path) -> Experiment:
    """Four floors of three buildings."""
    for seed in range(4):
        made = generate_building(seed, size="small", resolution_m=0.2)
        save_map(made.grid, tmp_path / f"floor{seed}" / "map")
        save_labels(tmp_path / f"floor{seed}" / "labels.png", made.labels, made.label_names)
    table = "map,building\nfloor0,a\nfloor1,b\nfloor2,a\nfloor3,c\n"
    (tmp_path / "buildings.csv").write_text(table)
    (tmp_path / "config.toml").write_text(CONFIG)
    return Experiment(load_config(tmp_path / "config.toml"), tmp_path)


def held_out(experiment: Experiment) -> list[RunTask]:
    return run_tasks(experiment, splits_of(experiment))


def names(sources: tuple[object, ...]) -> list[str]:
    return [str(vars(item)["map"]).partition("/")[0] for item in sources]


def test_a_building_is_never_in_its_own_training(experiment: Experiment) -> None:
    tasks = held_out(experiment)
    assert [task.split for task in tasks] == ["a", "b", "c"]
    assert [names(task.config.test) for task in tasks] == [
        ["floor0", "floor2"],
        ["floor1"],
        ["floor3"],
    ]
    for task in tasks:
        tested = names(task.config.test)
        assert sorted(names(task.config.train) + tested) == [f"floor{n}" for n in range(4)]


def test_a_copy_of_a_map_in_another_building_is_told_once(
    experiment: Experiment, tmp_path: Path
) -> None:
    """Each fold is compared by a worker, which tells nobody."""
    shutil.rmtree(tmp_path / "floor3")
    shutil.copytree(tmp_path / "floor1", tmp_path / "floor3")
    found = compare_several(experiment, InProcessWorkers(), by_building=True)
    overlaps = [message for message in found.warnings if "also trained on" in message]
    assert [message.split("(")[1].split(")")[0] for message in overlaps] == ["floor1", "floor3"]
    assert experiment.warnings == list(found.warnings)


def test_the_results_of_all_folds_are_one_comparison(
    experiment: Experiment, tmp_path: Path
) -> None:
    cached = replace(experiment, feature_cache=FeatureCache(tmp_path / "cache"))
    found = compare_several(cached, InProcessWorkers(), by_building=True)
    assert [item.name for item in found.maps] == ["floor0", "floor2", "floor1", "floor3"]
    assert found.title == "Place labelling: each of 3 buildings left out"
    alone = [compare(Experiment(task.config, experiment.folder)) for task in held_out(experiment)]
    [method], parts = found.methods, [part.methods[0] for part in alone]
    every = [item for part in parts for item in part.labelings]
    for one, other in zip(method.labelings, every, strict=True):
        np.testing.assert_array_equal(one.labels, other.labels)
    confusion = Evaluation.merged([part.evaluation for part in parts]).confusion
    np.testing.assert_array_equal(method.evaluation.confusion, confusion)
    assert (
        found.inputs.keys()
        == {name for part in alone for name in part.inputs} | experiment.inputs.keys()
    )
    write_comparison(found, tmp_path / "report")


def test_processes_find_the_same(experiment: Experiment) -> None:
    here, there = (
        compare_several(experiment, item, by_building=True)
        for item in (InProcessWorkers(), LocalWorkers(1))
    )
    np.testing.assert_array_equal(
        here.methods[0].evaluation.confusion, there.methods[0].evaluation.confusion
    )


def test_a_building_whose_workers_die_is_an_error(experiment: Experiment) -> None:
    with pytest.raises(Exception, match="every worker was killed on a,"):
        compare_several(experiment, CrashingWorkers(), by_building=True)


def test_one_building_cannot_be_left_out(experiment: Experiment) -> None:
    alone = replace(experiment.config, train=experiment.config.train[1:2])
    with pytest.raises(ConfigError, match="needs maps of at least two buildings"):
        compare_several(replace(experiment, config=alone), InProcessWorkers(), by_building=True)
