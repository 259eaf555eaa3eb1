"""The paper's experiments from the command line."""

import sys
from pathlib import Path

import pytest

from experiments.paper.section import Finding, Outcome
from experiments.paper.setting import Setting
from pgm_places.io.output_set import RECORD_FILE
from tests.cli.conftest import Run


def test_an_unknown_section_is_refused_with_the_nearest_one(run: Run, tmp_path: Path) -> None:
    code, _, error = run("reproduce", "7.11", "--out", tmp_path / "out")
    assert code == 2
    assert "no section '7.11'" in error
    assert not (tmp_path / "out").exists()


def test_the_table_comes_with_a_warning_where_buildings_stand_in(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fake(setting: Setting) -> Outcome:
        return Outcome("a setting", (Finding("single poses", 0.981, 0.9, 0.7, 0.973),))

    monkeypatch.delenv("PGM_PLACES_DATA", raising=False)
    monkeypatch.setattr("experiments.paper.poses.run", fake)
    out = tmp_path / "out"
    code, text, error = run("reproduce", "7.1", "--out", out, "--threads", 1)
    assert code == 0
    assert "generated buildings stand in" in error
    assert "Set PGM_PLACES_DATA" in error
    [line] = [line for line in text.splitlines() if "single poses" in line]
    assert line.split()[-4:] == ["97.3", "98.1", "/", "90.0"]
    assert f"wrote {out / 'reproduce.html'}" in text
    assert sorted(path.name for path in out.iterdir()) == [
        RECORD_FILE,
        "7.1",
        "reproduce.html",
        "reproduce.md",
    ]


def test_an_installed_package_says_where_the_experiments_are(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pgm_places.cli.experiments._CHECKOUT", tmp_path)
    monkeypatch.setitem(sys.modules, "experiments.paper.command", None)
    code, text, error = run("reproduce", "7.1", "--out", tmp_path / "out")
    assert (code, text) == (2, "")
    assert error == (
        "pgm-places: the paper's experiments come with the source, not with the installed package; "
        "run 'python -m experiments.paper' in a checkout of it\n"
    )
