"""A small building as files, and the command line as a function."""

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from pgm_places.cli.entry import main
from pgm_places.io.maps.label_image import save_labels
from pgm_places.io.maps.map_server import save_map
from pgm_places.simulation import generate_building

CONFIG = """\
[labels]
names = ["corridor", "room", "doorway"]

[classifier]
n_rounds = 10
n_folds = 2
max_examples_per_map = 500

[space]
n_rounds = 5

[[train]]
map = "map.yaml"
labels = "labels.png"

[[test]]
map = "map.yaml"
labels = "labels.png"

[[methods]]
id = "adaboost"
name = "independent"

[[methods]]
name = "relaxation"
max_iterations = 5
"""

Run = Callable[..., tuple[int, str, str]]


def building_in(folder: Path) -> Path:
    """The folder, with map.yaml, labels.png and config.toml."""
    made = generate_building(size="small", resolution_m=0.1)
    save_map(made.grid, folder / "map")
    save_labels(folder / "labels.png", made.labels, made.label_names)
    (folder / "config.toml").write_text(CONFIG)
    return folder


@pytest.fixture
def building(tmp_path: Path) -> Path:
    """A folder with map.yaml, labels.png and config.toml."""
    return building_in(tmp_path)


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """Run the command line; its exit code, standard output and standard error."""

    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["pgm-places", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        captured = capsys.readouterr()
        code = ended.value.code
        return (0 if code is None else int(code)), captured.out, captured.err

    return call
