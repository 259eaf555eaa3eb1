"""The tables of trajectories: what is kept, and drives by their kind."""

from pathlib import Path

from experiments.drives.kept_text import KeptText
from experiments.drives.methods import FOLDER, KINDS
from pgm_places.experiment.config import load_config


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


def test_floors_are_of_a_known_kind_and_in_buildings_of_their_own() -> None:
    config = load_config(FOLDER / "floors.toml")
    starts = [start for start in KINDS if start]
    assert all(str(item.name).startswith(tuple(starts)) for item in config.test)
    learned = {item.building for item in config.train}
    assert len(learned) == 6
    assert not learned & {item.building for item in config.test}
