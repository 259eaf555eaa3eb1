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

    def experiment(
        self, name: str, changes: Mapping[str, Any] | None = None, *, preset: str | None = None
    ) -> Experiment:
        found = super().experiment(name, changes, preset=preset)
        return replace(found, config=changed_config(found.config, QUICK))


@pytest.fixture(scope="module")
def setting(tmp_path_factory: pytest.TempPathFactory) -> QuickSetting:
    data = tmp_path_factory.mktemp("data")
    write_small_data(data)
    return QuickSetting(data)


@pytest.fixture(autouse=True)
def _data(setting: Setting, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PGM_PLACES_DATA", str(setting.data))


def test_all_orders_of_the_list_are_scored_and_the_heuristic_takes_one(setting: Setting) -> None:
    found = poses.run(setting)
    [table] = found.tables
    assert [row[0] for row in table.rows] == ["as printed"] * 6 + ["by default"]
    assert len({row[1] for row in table.rows}) == 7
    assert [row[1] for row in table.rows if row[-1] == "the heuristic"] != []
    assert [item.paper for item in found.findings] == [0.973, None, None]
    assert {item.file for item in found.pictures} == set(found.files)
    for item in found.findings:
        assert item.interval is not None
        assert item.interval[0] <= (item.accuracy or 0.0) <= item.interval[1]


def test_the_topological_maps_are_counted_against_the_truth(setting: Setting) -> None:
    found = topology.run(setting)
    printed, default = found.tables
    assert printed.caption.startswith("as printed: ")
    assert len(printed.rows) == 6  # three methods without corrections, and with the paper's
    assert {row[1].partition(":")[0] for row in default.rows} >= {"none", "the paper's"}
    assert {item.file for item in found.pictures} == set(found.files)
    assert "topology_as_printed_ground_truth.png" in found.files


def test_the_paper_s_figures_stand_beside_20_cm(setting: Setting) -> None:
    found = resolutions.run(setting, (0.2, 0.1))
    papers = {(item.what, item.way): item.paper for item in found.findings if item.paper}
    assert papers == {
        (f"20 cm, {name}", way): figure
        for name, figure in (("relaxation", 0.921), ("amn", 0.988))
        for way in ("as printed", "by default")
    }
    assert {item.file for item in found.pictures} == set(found.files)


@pytest.mark.parametrize("name", ["resolutions", "transfer_52", "topology", "poses"])
@pytest.mark.parametrize("preset", ["paper", None])
def test_all_methods_of_a_row_have_one_classifier(name: str, preset: str | None) -> None:
    config = Setting().experiment(name, preset=preset).config
    assert config.preset == preset
    assert {item.unary for item in config.methods} == {"laser" if preset else "auto"}


def test_the_preset_alone_tells_the_ways_apart() -> None:
    printed = Setting().experiment("resolutions", preset="paper").config
    default = Setting().experiment("resolutions").config
    assert [item.options for item in default.methods] == [{}, {}, {}]
    assert (printed.classifier.order, printed.classifier.prior_weight) == ("heuristic", 0.0)
