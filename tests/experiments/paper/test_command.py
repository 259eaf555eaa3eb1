"""The paper's experiments from the command line."""

from pathlib import Path

import pytest

from experiments.paper.__main__ import main
from experiments.paper.section import Finding, Outcome
from experiments.paper.setting import Setting
from pgm_places.io.output_set import RECORD_FILE


def test_an_unknown_section_is_refused_with_the_nearest_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["7.11", "--out", str(tmp_path / "out")])
    assert ended.value.code == 2
    assert "no section '7.11'" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_table_comes_with_a_warning_where_buildings_stand_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fake(setting: Setting) -> Outcome:
        return Outcome("a setting", (Finding("single poses", 0.981, 0.9, 0.7, 0.973),))

    monkeypatch.delenv("PGM_PLACES_DATA", raising=False)
    monkeypatch.setattr("experiments.paper.poses.run", fake)
    out = tmp_path / "out"
    main(["7.1", "--out", str(out), "--threads", "1"])
    text, error = capsys.readouterr()
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
