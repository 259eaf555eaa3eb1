"""Finished parts of the tables of trajectories are read instead of computed."""

from pathlib import Path

from experiments.trajectories import TextCache


def test_a_text_is_made_once_where_there_is_a_folder(tmp_path: Path) -> None:
    made = []

    def make() -> str:
        made.append(1)
        return "| a | b |\n"

    cache = TextCache(tmp_path / "kept")
    assert cache.text("table", make) == TextCache(tmp_path / "kept").text("table", make)
    assert len(made) == 1
    assert TextCache().text("table", make) == "| a | b |\n"
    assert len(made) == 2
