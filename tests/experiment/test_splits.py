"""Splits hold whole buildings out, as listed or in turn."""

from pathlib import Path
from typing import Any

import pytest

from pgm_places.errors import ConfigError
from pgm_places.experiment.config import ExperimentConfig, parse_config
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.splits import Split, splits_of
from tests.experiment.test_graph_runs import content, write_grid

BUILDINGS = ["a", "b", "a", "c", "d"]


def experiment(folder: Path, **changes: Any) -> Experiment:
    """Five graphs of four buildings."""
    train = [
        {"graph": write_grid(folder, n), "name": f"graph {n}", "building": name}
        for n, name in enumerate(BUILDINGS)
    ]
    made = content(folder, train=train, **changes)
    del made["test"]
    return Experiment(parse_config(made), folder)


def buildings(split: Split) -> tuple[list[str | None], list[str | None]]:
    config: ExperimentConfig = split.config
    return [item.building for item in config.train], [item.building for item in config.test]


def test_each_building_is_held_out_by_default(tmp_path: Path) -> None:
    splits = splits_of(experiment(tmp_path))
    assert [item.name for item in splits] == ["a", "b", "c", "d"]
    assert buildings(splits[0]) == (["b", "c", "d"], ["a", "a"])
    assert buildings(splits[3]) == (["a", "b", "a", "c"], ["d"])


def test_folds_hold_groups_of_buildings_out_each_once(tmp_path: Path) -> None:
    splits = splits_of(experiment(tmp_path), n_folds=3)
    assert [item.name for item in splits] == ["fold 1", "fold 2", "fold 3"]
    assert [buildings(item)[1] for item in splits] == [["a", "a", "d"], ["b"], ["c"]]
    assert buildings(splits[0])[0] == ["b", "c"]


def test_listed_splits_learn_from_what_they_name_or_from_the_rest(tmp_path: Path) -> None:
    listed = [{"test": ["a"], "train": ["b"], "name": "little"}, {"test": ["b", "d"]}]
    splits = splits_of(experiment(tmp_path, splits=listed))
    assert [item.name for item in splits] == ["little", "b + d"]
    assert buildings(splits[0]) == (["b"], ["a", "a"])
    assert buildings(splits[1]) == (["a", "a", "c"], ["b", "d"])
    assert all(not item.config.splits for item in splits)


@pytest.mark.parametrize(
    ("splits", "text"),
    [
        ([{"test": ["e"]}], r"splits\[0\].test: no building 'e' in \[\[train\]\] to test on"),
        ([{"test": ["a"], "train": ["x"]}], r"splits\[0\].train: no building 'x'"),
        ([{"test": ["a", "b", "c", "d"]}], r"splits\[0\].test has all buildings"),
        ([{"test": ["c", "a"], "train": ["a", "b"]}], "'a' is in both train and test of a split"),
        ([], r"5 folds need at least 5 buildings .* has 4"),
    ],
)
def test_splits_that_fit_no_building_are_refused(
    tmp_path: Path, splits: list[Any], text: str
) -> None:
    with pytest.raises(ConfigError, match=text):
        splits_of(experiment(tmp_path, splits=splits), n_folds=None if splits else 5)
    with pytest.raises(ConfigError, match=r"\[\[splits\]\] and \[\[test\]\] cannot be combined"):
        parse_config(content(tmp_path, splits=[{"test": ["a"]}]))
