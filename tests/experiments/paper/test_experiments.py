"""The experiments themselves, on buildings of a few rooms."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest

from experiments.paper import poses, resolutions, topology
from experiments.paper.setting import Setting
from pgm_places.experiment.config_changes import changed_config
from pgm_places.experiment.experiment import Experiment
from tests.experiments.paper.small_data import write_small_data

QUICK = {"classifier.n_rounds": 5, "classifier.n_folds": 2, "space.n_rounds": 5}


class QuickSetting(Setting):
    """Few rounds of boosting."""

    def experiment(self, name: str, changes: Mapping[str, Any] | None = None) -> Experiment:
        found = super().experiment(name, changes)
        return replace(found, config=changed_config(found.config, QUICK))


@pytest.fixture(scope="module")
def setting(tmp_path_factory: pytest.TempPathFactory) -> QuickSetting:
    data = tmp_path_factory.mktemp("data")
    write_small_data(data)
    return QuickSetting(data)


@pytest.fixture(autouse=True)
def _data(setting: Setting, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PGM_PLACES_DATA", str(setting.data))


def test_all_orders_of_the_list_are_scored_and_each_search_takes_one(setting: Setting) -> None:
    found = poses.run(setting)
    [table] = found.tables
    assert len({row[0] for row in table.rows}) == 6
    chosen = [name for row in table.rows for name in row[-1].split(", ") if name != "-"]
    assert sorted(chosen) == ["exhaustive", "heuristic", "rarest-first"]
    assert [item.paper for item in found.findings] == [0.973, None, None]
    assert {item.file for item in found.pictures} == set(found.files)
    for item in found.findings:
        assert item.interval is not None
        assert item.interval[0] <= (item.accuracy or 0.0) <= item.interval[1]


def test_the_topological_maps_are_counted_against_the_truth(setting: Setting) -> None:
    found = topology.run(setting)
    [table] = found.tables
    assert len(table.rows) == 12  # four methods without corrections, with the paper's, with gates
    assert {item.file for item in found.pictures} == set(found.files)
    assert "topology_ground_truth.png" in found.files


def test_the_paper_s_figures_stand_beside_20_cm(
    setting: Setting, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(resolutions, "CELLS_M", (0.2, 0.1))
    found = resolutions.run(setting)
    papers = {item.what: item.paper for item in found.findings if item.paper}
    assert papers == {"20 cm, relaxation": 0.921, "20 cm, amn": 0.988}
    assert {item.file for item in found.pictures} == set(found.files)
