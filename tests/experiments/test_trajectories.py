"""Finished parts of the tables of trajectories are read instead of computed."""

from pathlib import Path

from experiments.trajectories import KeptText


def test_a_text_is_made_once_where_there_is_a_folder(tmp_path: Path) -> None:
    made = []

    def make() -> str:
        made.append(1)
        return "| a | b |\n"

    kept = KeptText(tmp_path / "kept")
    assert kept.text("table", make) == KeptText(tmp_path / "kept").text("table", make)
    assert len(made) == 1
    assert KeptText().text("table", make) == "| a | b |\n"
    assert len(made) == 2
