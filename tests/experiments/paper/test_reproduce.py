"""The paper's experiments run on whatever maps there are, keep what is finished, and say so."""

import json
from pathlib import Path

import pytest

from experiments.paper.run import RECORD, data_for, finished_section, reproduce
from experiments.paper.section import Finding, Outcome, Picture, Section, Table
from experiments.paper.sections import SECTIONS, chosen_sections
from experiments.paper.setting import CONFIGS, Setting, with_stand_ins
from pgm_places.errors import ConfigError
from pgm_places.experiment.config import load_config
from pgm_places.io.output_set import RECORD_FILE

CALLS: list[bool] = []


def fake_run(setting: Setting) -> Outcome:
    """An experiment that takes no time."""
    CALLS.append(setting.data is not None)
    return Outcome(
        "a setting",
        (Finding("poses", 0.981, 0.92, 0.7, 0.973, (0.97, 0.99)), Finding("a picture")),
        (Table("Orders", ("list", "accuracy"), (("room | doorway", "98.1"),)),),
        (Picture("map.png", "A <map>"),),
        {"map.png": b"\x89PNG"},
        ("A remark.",),
    )


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> list[bool]:
    """Section 7.1 is replaced; whether each run had real data."""
    CALLS.clear()
    monkeypatch.setattr("experiments.paper.poses.run", fake_run)
    monkeypatch.delenv("PGM_PLACES_DATA", raising=False)
    return CALLS


def test_a_finished_section_is_kept_and_not_run_again(fake: list[bool], tmp_path: Path) -> None:
    first = list(reproduce(["7.1"], tmp_path))
    second = list(reproduce(["7.1"], tmp_path))
    assert first == second
    assert len(fake) == 1
    list(reproduce(["7.1"], tmp_path, again=True))
    assert len(fake) == 2


def test_real_data_replace_what_generated_buildings_gave(
    fake: list[bool], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    list(reproduce(["7.1"], tmp_path / "out"))
    (tmp_path / "data" / "freiburg079").mkdir(parents=True)
    monkeypatch.setenv("PGM_PLACES_DATA", str(tmp_path / "data"))
    [section] = reproduce(["7.1"], tmp_path / "out")
    assert fake == [False, True]
    assert section.real


def test_the_pages_hold_figures_tables_pictures_and_say_what_stood_in(
    fake: list[bool], tmp_path: Path
) -> None:
    list(reproduce(["7.1"], tmp_path))
    page = (tmp_path / "reproduce.md").read_text()
    assert "| 7.1 poses | generated | 97.3 | 98.1 / 92.0 |" in page
    assert "| 7.1 a picture | generated | - | - / - |" in page
    assert "generated buildings stand in" in page
    assert "| room \\| doorway | 98.1 |" in page
    assert "![A <map>](7.1/map.png)" in page
    html = (tmp_path / "reproduce.html").read_text()
    assert "generated buildings stand in" in html
    assert "A &lt;map&gt;" in html
    assert "data:image/png;base64,iVBORw==" in html


def test_an_experiment_that_fails_leaves_the_finished_ones(
    fake: list[bool], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(setting: Setting) -> Outcome:
        raise KeyboardInterrupt

    monkeypatch.setattr("experiments.paper.topology.run", interrupted)
    with pytest.raises(KeyboardInterrupt):
        list(reproduce(["7.1", "7.3"], tmp_path))
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        RECORD_FILE,
        "7.1",
        "reproduce.html",
        "reproduce.md",
    ]


def test_a_section_survives_its_file(fake: list[bool], tmp_path: Path) -> None:
    [section] = reproduce(["7.1"], tmp_path)
    assert isinstance(section, Section)
    assert finished_section(tmp_path, "7.1") == section


@pytest.mark.parametrize("content", ["", "{", "{}", json.dumps({"findings": 3})])
def test_a_damaged_record_counts_as_not_there(tmp_path: Path, content: str) -> None:
    (tmp_path / "7.1").mkdir()
    (tmp_path / "7.1" / RECORD).write_text(content)
    assert finished_section(tmp_path, "7.1") is None


def test_sections_come_in_the_order_of_the_paper() -> None:
    assert chosen_sections(("7.5", "7.1")) == ("7.1", "7.5")
    assert chosen_sections(())[:2] == ("7.1", "7.2")
    assert chosen_sections(())[-1] == "7.6"
    assert chosen_sections(("7.6",), stockholm=True) == ("7.6", "7.6-kth")
    assert chosen_sections((), stockholm=True)[-1] == "7.6-kth"
    with pytest.raises(ConfigError, match=r"no section '7\.11'.*7\.1"):
        chosen_sections(("7.11",))


def test_data_without_a_section_s_folder_are_no_data(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PGM_PLACES_DATA", str(tmp_path))
    assert data_for(SECTIONS["7.1"]) is None
    (tmp_path / "freiburg079").mkdir()
    assert data_for(SECTIONS["7.1"]) == tmp_path


def test_the_paper_s_floors_are_refused_in_one_line_where_they_are_missing(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"needs COLD-Stockholm: --stockholm FOLDER"):
        list(reproduce(["7.6-kth"], tmp_path / "out"))
    (tmp_path / "cold_stockholm_floor6").mkdir()
    with pytest.raises(ConfigError, match=r"no folder cold_stockholm_floor7 in .*--stockholm"):
        data_for(SECTIONS["7.6-kth"], tmp_path)


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.toml")), ids=lambda path: path.stem)
def test_every_configuration_is_good_and_has_stand_ins(path: Path) -> None:
    config = load_config(path)
    replaced = with_stand_ins(config)
    for part in ("train", "test"):
        for before, after in zip(getattr(config, part), getattr(replaced, part), strict=True):
            assert after.generated is not None
            windows = (before.columns, before.x_m, before.y_m)
            assert (after.half is None) == (windows == (None, None, None))
    assert [item.id for item in replaced.methods] == [item.id for item in config.methods]


@pytest.mark.parametrize("key", SECTIONS)
def test_every_section_has_a_function(key: str) -> None:
    assert callable(SECTIONS[key].run)
